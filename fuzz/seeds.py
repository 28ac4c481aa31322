"""Valid inputs to start from, for each target."""

from __future__ import annotations

import struct
import tempfile
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
from mcap.writer import CompressionType, Writer

from fuzz.targets import ENCODINGS, FAMILIES
from pipeline.core.records import Intrinsics
from pipeline.mcap_file.writer import calibration_message, image_message, timestamp
from pipeline.messages.ros_builtin import DEFINITIONS
from schemas.stadimeter_pb2 import CameraExposure, Detections, GroundTruth

ROOT = Path(__file__).resolve().parents[1]
START_NS = 1_700_000_000_000_000_000


def seeds(target: str) -> Iterator[bytes]:
    """Yield the seeds of a target, and what was once found by it."""
    yield from {"reader": _files, "message": _messages, "picture": _pictures, "config": _configs}[
        target
    ]()
    for path in sorted((ROOT / "tests" / "fuzzed" / target).glob("*")):
        yield path.read_bytes()


def _jpeg() -> bytes:
    return cv2.imencode(".jpg", np.full((8, 8, 3), 90, np.uint8))[1].tobytes()


def protobuf_messages() -> dict[str, bytes]:
    """Return one message of each of the types that are written here."""
    time = timestamp(START_NS)
    found = Detections(timestamp=time, frame_id="cam")
    truth = GroundTruth(timestamp=time, frame_id="cam")
    box = {"x_min_px": 1, "x_max_px": 3, "y_min_px": 2, "y_max_px": 7}
    found.objects.add(box=box, class_name="person", object_id="p", score=0.5, box_std_px=1)
    truth.objects.add(object_id="p", class_name="person", depth_m=9, height_m=1.7, box=box)
    lens = Intrinsics(8, 8, 9.0, 9.0, 3.5, 3.5, "plumb_bob", (0.1, 0.0, 0.0, 0.0, 0.0))
    exposure = CameraExposure(timestamp=time, frame_id="cam", f_number=2.8, exposure_time_s=0.01)
    made = (
        image_message(_jpeg(), "jpeg", START_NS, "cam"),
        calibration_message(lens, START_NS, "cam"),
        exposure,
        found,
        truth,
    )
    return {m.DESCRIPTOR.full_name: m.SerializeToString() for m in made}


def _files() -> Iterator[bytes]:
    for compression in CompressionType:
        for chunked in (True, False):
            with tempfile.TemporaryFile() as stream:
                # Without CRCs, so that changed bytes are not merely refused.
                writer = Writer(
                    stream,
                    chunk_size=300,
                    compression=compression,
                    use_chunking=chunked,
                    enable_crcs=False,
                )
                writer.start()
                for index, (name, data) in enumerate(protobuf_messages().items()):
                    schema = writer.register_schema(name, "protobuf", b"")
                    channel = writer.register_channel(f"/{index}", "protobuf", schema, {"a": "b"})
                    for step in range(2):
                        time_ns = START_NS + step * 40_000_000
                        writer.add_message(channel, time_ns, data, time_ns)
                writer.add_attachment(1, 1, "a", "text/plain", b"data")
                writer.add_metadata("m", {"k": "v"})
                writer.finish()
                stream.seek(0)
                yield stream.read()


def _messages() -> Iterator[bytes]:
    names = [*FAMILIES]
    for name, data in protobuf_messages().items():
        yield bytes([names.index(name.replace(".", "/")), 0, 0, 0]) + data
    for name, definition in DEFINITIONS.items():
        schema = definition.encode()
        for encoding in (2, 3):
            body = struct.pack("<BBBB", 0, 1, 0, 0)[: 4 * (encoding == 2)] + bytes(200)
            yield (
                bytes([names.index(name), encoding])
                + struct.pack("<H", len(schema))
                + schema
                + body
            )
    texts = (
        b'{"timestamp": {"sec": 5, "nsec": 1}, "frame_id": "cam", "f_number": 2.8}',
        b'{"header": {"stamp": {"sec": 1}}, "K": [1,0,1,0,1,1,0,0,1], "width": 8, "D": [1e300]}',
        b'{"data": "AAAA", "format": "jpeg", "objects": [{"box": {"x_max_px": 3}}], "points": []}',
    )
    for index in range(len(names)):
        for text in texts:
            yield bytes([index, ENCODINGS.index("json"), 0, 0]) + text


def _pictures() -> Iterator[bytes]:
    image = np.random.default_rng(0).integers(0, 255, (12, 10, 3), dtype=np.uint8)
    for extension, options in (
        (".jpg", []),
        (".jpg", [cv2.IMWRITE_JPEG_PROGRESSIVE, 1]),
        (".png", []),
        (".webp", []),
        (".webp", [cv2.IMWRITE_WEBP_QUALITY, 101]),
    ):
        yield cv2.imencode(extension, image, options)[1].tobytes()
    # A TIFF directory of two entries, one of which leads to the exposure's.
    tiff = b"II*\0\x08\0\0\0" + struct.pack("<HHHII", 1, 0x8769, 4, 1, 26) + bytes(4)
    tiff += struct.pack("<HHHIII", 1, 0x829D, 5, 1, 44, 0) + struct.pack("<II", 28, 10)
    exif = b"Exif\0\0" + tiff
    jpeg = _jpeg()
    yield jpeg[:2] + b"\xff\xe1" + struct.pack(">H", len(exif) + 2) + exif + jpeg[2:]


def _configs() -> Iterator[bytes]:
    for path in (ROOT / "recordings").glob("*.toml"):
        yield path.read_bytes()
    yield b"""
[limits]
channels = 3
[detect]
method = "motion"
classes = ["person"]
[[camera]]
name = "c"
focal_length_mm = 4.0
roi_xyxy_px = [1, 2, 3, 4]
[camera.exposure]
f_number = "/diag.fnum"
[[size_prior]]
object_class = "person"
dimension = "height"
mean_m = 1.68
std_m = 0.09
[[calibration]]
method = "size"
object_class = "staff"
dimension = "width"
parameters = [{ name = "object_size_m", value = 0.060, std_error = 0.001 }]
"""
