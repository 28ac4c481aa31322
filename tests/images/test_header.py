"""Pictures that would need far more memory than their size: refused by their headers."""

from __future__ import annotations

import struct
import time
import tracemalloc
import zlib

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.core.errors import UndecodableImage
from pipeline.images.decode import decode
from pipeline.images.header import hidden_cost, image_size

MAX_PIXELS = 100_000_000


def chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def png(width: int, height: int, *before_data: bytes, rows: int = 4) -> bytes:
    head = chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0))
    data = zlib.compress(bytes(width * 3 + 1) * rows, 9)
    parts = (b"\x89PNG\r\n\x1a\n", head, *before_data, chunk(b"IDAT", data), chunk(b"IEND", b""))
    return b"".join(parts)


def jpeg(*, progressive: bool) -> bytes:
    random = np.random.default_rng(0)
    image = random.integers(0, 255, (96, 128, 3), dtype=np.uint8)
    options = [cv2.IMWRITE_JPEG_PROGRESSIVE, int(progressive)]
    return cv2.imencode(".jpg", image, options)[1].tobytes()


def test_a_picture_of_60000_by_60000_in_a_few_kilobytes_takes_no_memory() -> None:
    bomb = png(60_000, 60_000, rows=8)
    assert len(bomb) < 4_000
    tracemalloc.start()
    with pytest.raises(UndecodableImage, match="60000 x 60000"):
        decode(bomb, max_pixels=MAX_PIXELS)
    assert tracemalloc.get_traced_memory()[1] < 1_000_000
    tracemalloc.stop()


@pytest.mark.parametrize(
    "bomb",
    [
        b"\xff\xd8\xff\xc0\x00\x11\x08\xff\xff\xff\xff\x03" + bytes(20),
        b"RIFF\x00\x00\x00\x00WEBPVP8X\x0a\x00\x00\x00\x00\x00\x00\x00" + b"\xff" * 6 + bytes(4),
        png(100, 0),
    ],
    ids=["jpeg", "webp", "no rows"],
)
def test_absurd_sizes_are_refused_by_the_header(bomb: bytes) -> None:
    with pytest.raises(UndecodableImage):
        decode(bomb, max_pixels=MAX_PIXELS)


def test_a_jpeg_of_thousands_of_scans_is_refused_at_once() -> None:
    good = jpeg(progressive=True)
    assert hidden_cost(good, 100) is None
    assert decode(good, max_pixels=MAX_PIXELS).width_px == 128
    last = good.rindex(b"\xff\xda")
    bomb = good[:last] + good[last:-2] * 5000 + good[-2:]
    started = time.process_time()
    with pytest.raises(UndecodableImage, match="scans"):
        decode(bomb, max_pixels=MAX_PIXELS)
    assert time.process_time() - started < 1


def test_what_looks_like_a_scan_in_a_plain_jpeg_costs_nothing() -> None:
    good = jpeg(progressive=False)
    assert hidden_cost(good + b"\xff\xda" * 500, 100) is None


def test_animations_are_refused() -> None:
    still = png(8, 4)
    assert decode(still, max_pixels=MAX_PIXELS).width_px == 8
    text = chunk(b"tEXt", b"Comment\0acTL is a word here" + bytes(100_000))
    assert decode(png(8, 4, text), max_pixels=MAX_PIXELS).width_px == 8
    animated = png(8, 4, text, chunk(b"acTL", struct.pack(">II", 1000, 0)))
    with pytest.raises(UndecodableImage, match="animated"):
        decode(animated, max_pixels=MAX_PIXELS)


@given(
    st.binary(max_size=200),
    st.sampled_from([b"", b"\xff\xd8", b"\x89PNG\r\n\x1a\n", b"RIFF1234WEBP"]),
)
def test_no_header_is_too_strange(tail: bytes, start: bytes) -> None:
    image_size(start + tail)
    hidden_cost(start + tail, 100)


@pytest.mark.parametrize("stray", [b"\x00", b"\x00\x00\x12", b"\xff\x00", b"garbage" * 9])
def test_stray_bytes_between_segments_are_skipped_as_decoders_do(stray: bytes) -> None:
    """Some cameras leave them; OpenCV and Pillow read such pictures."""
    plain = jpeg(progressive=False)
    at = 4 + int.from_bytes(plain[4:6], "big")
    dirty = plain[:at] + stray + plain[at:]
    assert image_size(dirty) == image_size(plain)
    ours = decode(dirty, max_pixels=10**7, full_resolution=True).bgr
    assert np.array_equal(ours, decode(plain, max_pixels=10**7, full_resolution=True).bgr)


def test_bytes_that_only_start_as_a_jpeg_have_no_size() -> None:
    assert image_size(b"\xff\xd8" + b"x" * 10_000) is None
    assert image_size(b"\xff\xd8" + b"\xff\x00" * 10_000) is None
