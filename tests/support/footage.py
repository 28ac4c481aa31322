"""Small moving pictures with known truth: a figure with legs that walks over rough ground."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from pipeline.core.exposure import UNKNOWN_EXPOSURE
from pipeline.core.records import Frame, Pairing
from pipeline.images.decode import Picture, decode

WIDTH_PX, HEIGHT_PX = 640, 480
FRAME_NS = 40_000_000


@dataclass(frozen=True)
class Walker:
    """A person whose feet move from `start` by `step` a frame, `tall_px` high."""

    start: tuple[float, float]
    step: tuple[float, float]
    tall_px: float
    colour: tuple[int, int, int] = (40, 30, 120)

    def box(self, frame: int) -> tuple[float, float, float, float]:
        x, y = (s + frame * d for s, d in zip(self.start, self.step, strict=True))
        half = self.tall_px * 0.16
        return x - half, y - self.tall_px, x + half, y


def ground(seed: int = 0) -> np.ndarray:
    noise = np.random.default_rng(seed).normal(0, 12, (HEIGHT_PX, WIDTH_PX, 3))
    return np.clip(cv2.GaussianBlur(noise, (0, 0), 3) * 4 + [110, 125, 120], 0, 255)


def paint(image: np.ndarray, walker: Walker, frame: int, *, shadow: bool = False) -> None:
    x0, y0, x1, y1 = walker.box(frame)
    tall, middle = walker.tall_px, (x0 + x1) / 2
    if shadow:  # on the ground, to the right
        mask = np.zeros(image.shape[:2], np.uint8)
        centre = (round(middle + 0.45 * tall), round(y1 - 0.03 * tall))
        axes = (round(0.45 * tall), round(0.07 * tall))
        cv2.ellipse(mask, centre, axes, 0, 0, 360, 255, -1)
        image[mask > 0] *= 0.6
    swing = np.sin(frame * 0.7) * 0.13 * tall
    hip, dark = y1 - 0.48 * tall, tuple(c * 0.5 for c in walker.colour)
    for foot in (middle - swing, middle + swing):
        _line(image, (middle, hip), (foot, y1 - 0.03 * tall), 0.1 * tall, dark)
    _line(image, (middle, hip), (middle, y1 - 0.75 * tall), 0.24 * tall, walker.colour)
    centre, radius = (middle, y0 + 0.07 * tall), 0.07 * tall
    cv2.circle(image, _fixed(centre), round(radius * 16), (150, 170, 215), -1, cv2.LINE_AA, 4)


def _line(image, start, end, width, colour) -> None:
    cv2.line(image, _fixed(start), _fixed(end), colour, max(1, round(width)), cv2.LINE_AA, 4)


def _fixed(point: tuple[float, float]) -> tuple[int, int]:
    return round(point[0] * 16), round(point[1] * 16)


def clip(
    walkers: list[Walker], frames: int, *, shadow: bool = False, noise: float = 3.0
) -> list[bytes]:
    """Return JPEGs of the walkers over the ground, with sensor noise."""
    base, random = ground(), np.random.default_rng(5)
    pictures = []
    for frame in range(frames):
        image = base.copy()
        for walker in walkers:
            paint(image, walker, frame, shadow=shadow)
        image += random.normal(0, noise, image.shape)
        pixels = np.clip(image, 0, 255).astype(np.uint8)
        pictures.append(cv2.imencode(".jpg", pixels, [cv2.IMWRITE_JPEG_QUALITY, 90])[1].tobytes())
    return pictures


def decoded(picture: bytes) -> Picture:
    return decode(picture, max_pixels=10**7)


def frame(index: int, picture: bytes = b"", camera: str = "cam", **changes: object) -> Frame:
    values: dict[str, object] = {
        "camera": camera,
        "frame_index": index,
        "log_time_ns": index * FRAME_NS,
        "capture_time_ns": index * FRAME_NS,
        "image_format": "jpeg",
        "image": picture,
        "exposure": UNKNOWN_EXPOSURE,
        "exposure_pairing": Pairing.NONE,
        "exposure_offset_ns": None,
        "intrinsics": None,
        "detections": None,
        "truth": (),
        "topic": "/image",
        "byte_offset": 0,
    }
    return Frame(**(values | changes))  # type: ignore[arg-type]
