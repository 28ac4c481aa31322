"""Footage on which speed and memory are measured.

`street`, enlarged and played to and fro; and recordings of any length with people in boxes, whose
pictures are small and grey, so that an hour of rows can be worked without an hour of pixels.
"""

from __future__ import annotations

import math
from itertools import islice
from pathlib import Path
from typing import Any, NamedTuple

import cv2
import numpy as np
import numpy.typing as npt

from pipeline.core.config import Config
from pipeline.core.diagnostics import Notes
from pipeline.core.records import Intrinsics
from pipeline.ingest.frames import FrameAssembler
from pipeline.mcap_file.reader import McapFile
from pipeline.mcap_file.writer import (
    RecordingWriter,
    calibration_message,
    image_message,
    timestamp,
)
from schemas.stadimeter_pb2 import BoundingBox, Detection, Detections

STREET = Path(__file__).resolve().parents[1] / "recordings" / "street.mcap"


class Size(NamedTuple):
    """Of a picture, in pixels."""

    width_px: int
    height_px: int


HD, FULL_HD = Size(1280, 720), Size(1920, 1080)
FRAME_RATE = 25
QUALITY = 88  # with the grain below, 188 KB a frame at 720p and 359 KB at 1080p
START_NS = 1_767_225_600_000_000_000
CAMERA = "bench"


def street_pictures(count: int, size: Size = HD) -> list[bytes]:
    """Return JPEGs of the street, forwards, then backwards, so that nothing jumps."""
    config = Config()
    file = McapFile(STREET, config.limits, lambda note: None)
    frames = islice(FrameAssembler(file, config.ingest, Notes()), count)
    noise = np.random.default_rng(7)
    return [_jpeg(_enlarged(frame.image, size), noise) for frame in frames]


def empty_street_pictures(count: int, size: Size = HD) -> list[bytes]:
    """Return JPEGs of the street with nobody in it: the median of its pictures, with fresh grain."""
    everyone = street_pictures(25, size)
    pictures = [cv2.imdecode(np.frombuffer(p, np.uint8), cv2.IMREAD_COLOR) for p in everyone]
    nobody = np.median(np.stack(pictures), axis=0)
    noise = np.random.default_rng(11)
    return [_jpeg(nobody, noise) for _ in range(count)]


def _enlarged(image: bytes, size: Size) -> npt.NDArray[np.uint8]:
    small = cv2.imdecode(np.frombuffer(image, np.uint8), cv2.IMREAD_COLOR)
    return np.asarray(cv2.resize(small, size, interpolation=cv2.INTER_CUBIC), np.uint8)


def _jpeg(picture: npt.NDArray[Any], noise: np.random.Generator) -> bytes:
    grain = noise.normal(0, 2.5, (*picture.shape[:2], 1))
    noisy = np.clip(picture + grain, 0, 255).astype(np.uint8)
    return cv2.imencode(".jpg", noisy, [cv2.IMWRITE_JPEG_QUALITY, QUALITY])[1].tobytes()


def write_recording(path: Path, pictures: list[bytes], frames: int, size: Size = HD) -> None:
    """Write a recording of a number of frames from the pictures, played forwards and backwards."""
    there_and_back = [*pictures, *reversed(pictures)]
    width_px, height_px = size
    intrinsics = Intrinsics(
        width_px,
        height_px,
        1185.0 * width_px / 768,
        1194.6 * height_px / 576,
        width_px / 2,
        height_px / 2,
    )
    with RecordingWriter(path) as writer:
        for index in range(frames):
            time_ns = START_NS + index * 1_000_000_000 // FRAME_RATE
            if index % FRAME_RATE == 0:
                message = calibration_message(intrinsics, time_ns, CAMERA)
                writer.write(f"/{CAMERA}/calibration", message, time_ns)
            picture = there_and_back[index % len(there_and_back)]
            writer.write(
                f"/{CAMERA}/image", image_message(picture, "jpeg", time_ns, CAMERA), time_ns
            )


PEOPLE = 5
CROSSING_S = 18.0  # each is seen for so long, then for two seconds not
CAMERA_HEIGHT_M, PERSON_M, FOCAL_PX = 3.0, 1.7, 300.0
SMALL = Size(320, 180)


def write_people(path: Path, frames: int) -> None:
    """Write a recording of people who cross one after the other, in recorded boxes without names."""
    grey = np.full((SMALL.height_px, SMALL.width_px, 3), 90, np.uint8)
    picture = cv2.imencode(".jpg", grey)[1].tobytes()
    middle = Intrinsics(*SMALL, FOCAL_PX, FOCAL_PX, SMALL.width_px / 2, SMALL.height_px / 3)
    noise = np.random.default_rng(7)
    with RecordingWriter(path) as writer:
        message = calibration_message(middle, START_NS, CAMERA)
        writer.write(f"/{CAMERA}/calibration", message, START_NS)
        for index in range(frames):
            time_ns = START_NS + index * 1_000_000_000 // FRAME_RATE
            boxes = Detections(timestamp=timestamp(time_ns), frame_id=CAMERA)
            boxes.objects.extend(_crossing(index / FRAME_RATE, middle, noise))
            writer.write(f"/{CAMERA}/detections", boxes, time_ns)
            writer.write(
                f"/{CAMERA}/image", image_message(picture, "jpeg", time_ns, CAMERA), time_ns
            )


def _crossing(time_s: float, view: Intrinsics, noise: np.random.Generator) -> list[Detection]:
    seen = []
    for person in range(PEOPLE):
        at_s = math.fmod(time_s + 4.0 * person, CROSSING_S + 2.0)
        if at_s >= CROSSING_S:
            continue
        depth_m = 7.0 + 2.0 * person + 0.1 * at_s
        scale = FOCAL_PX / depth_m
        foot = view.cy_px + CAMERA_HEIGHT_M * scale
        x = view.width_px * (0.1 + 0.8 * at_s / CROSSING_S)
        tall, half = PERSON_M * scale, 0.25 * scale
        edges = np.array([x - half, foot - tall, x + half, foot]) + noise.normal(0, 0.5, 4)
        names = ("x_min_px", "y_min_px", "x_max_px", "y_max_px")
        box = BoundingBox(**dict(zip(names, edges.tolist(), strict=True)))
        seen.append(Detection(class_name="person", box=box))
    return seen
