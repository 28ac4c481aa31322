"""Footage to measure speed on: `street`, enlarged to 720p and played to and fro."""

from __future__ import annotations

from itertools import islice
from pathlib import Path

import cv2
import numpy as np

from pipeline.config import Config
from pipeline.diagnostics import Notes
from pipeline.ingest.frames import FrameAssembler
from pipeline.ingest.mcap_records import McapFile
from pipeline.ingest.mcap_writer import RecordingWriter, calibration_message, image_message
from pipeline.records import Intrinsics

STREET = Path(__file__).resolve().parents[1] / "recordings" / "street.mcap"
WIDTH_PX, HEIGHT_PX = 1280, 720
FRAME_RATE = 25
QUALITY = 88  # about 136 KB a frame
START_NS = 1_767_225_600_000_000_000
CAMERA = "bench"


def street_pictures(count: int) -> list[bytes]:
    """Return 720p JPEGs of the street, forwards, then backwards, so that nothing jumps."""
    config = Config()
    file = McapFile(STREET, config.limits, lambda note: None)
    frames = islice(FrameAssembler(file, config.ingest, Notes()), count)
    noise = np.random.default_rng(7)
    pictures = []
    for frame in frames:
        small = cv2.imdecode(np.frombuffer(frame.image, np.uint8), cv2.IMREAD_COLOR)
        large = cv2.resize(small, (WIDTH_PX, HEIGHT_PX), interpolation=cv2.INTER_CUBIC)
        grain = noise.normal(0, 2.5, (HEIGHT_PX, WIDTH_PX, 1))
        noisy = np.clip(large + grain, 0, 255).astype(np.uint8)
        _, encoded = cv2.imencode(".jpg", noisy, [cv2.IMWRITE_JPEG_QUALITY, QUALITY])
        pictures.append(encoded.tobytes())
    return pictures


def write_recording(path: Path, pictures: list[bytes], frames: int) -> None:
    """Write a recording of so many frames from the pictures, to and fro."""
    there_and_back = [*pictures, *reversed(pictures)]
    focal_px = 1185.0 * WIDTH_PX / 768
    intrinsics = Intrinsics(
        WIDTH_PX, HEIGHT_PX, focal_px, 1194.6 * HEIGHT_PX / 576, WIDTH_PX / 2, HEIGHT_PX / 2
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
