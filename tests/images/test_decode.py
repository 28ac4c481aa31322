"""Decoding: sizes, brightness, and hostile bytes."""

from __future__ import annotations

import contextlib
import struct
import zlib

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.core.errors import UndecodableImage
from pipeline.images.decode import decode, relative_luminance_of
from pipeline.images.header import image_size


def encoded(kind: str, width: int = 321, height: int = 243, value: int = 120) -> bytes:
    image = np.full((height, width, 3), value, np.uint8)
    return cv2.imencode(f".{kind}", image)[1].tobytes()


@pytest.mark.parametrize("kind", ["jpg", "png", "webp"])
def test_the_header_tells_the_size(kind: str) -> None:
    assert image_size(encoded(kind)) == (321, 243)


@pytest.mark.parametrize("kind", ["jpg", "png", "webp"])
def test_pictures_decode_to_their_brightness(kind: str) -> None:
    picture = decode(encoded(kind, value=188), max_pixels=10**6)
    assert (picture.width_px, picture.height_px) == (321, 243)
    assert picture.luminance == pytest.approx(0.503, abs=0.01)  # sRGB 188 is half of full light
    assert picture.clipped_fraction == 0.0


def test_large_pictures_are_reduced_and_say_so() -> None:
    picture = decode(encoded("jpg", 1280, 720), max_pixels=10**7)
    assert picture.reduction == 2
    assert picture.bgr.shape == (360, 640, 3)
    assert decode(encoded("jpg", 1280, 720), max_pixels=10**7, full_resolution=True).reduction == 1
    sizes = {}
    for side_px in (720, 360, 180, 90):
        sizes[side_px] = decode(encoded("jpg", 1280, 720), max_pixels=10**7, min_side_px=side_px)
        assert min(sizes[side_px].bgr.shape[:2]) == side_px
    assert sizes[90].luminance == pytest.approx(sizes[720].luminance)


def test_white_and_black_are_clipped() -> None:
    assert decode(encoded("png", value=255), max_pixels=10**6).clipped_fraction == 1.0
    assert decode(encoded("png", value=0), max_pixels=10**6).clipped_fraction == 1.0


def test_a_huge_picture_in_few_bytes_is_refused_before_it_is_decoded() -> None:
    def chunk(name: bytes, data: bytes) -> bytes:
        return (
            struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))
        )

    header = struct.pack(">IIBBBBB", 60_000, 60_000, 8, 2, 0, 0, 0)
    bomb = b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(b"\0" * 99))
    with pytest.raises(UndecodableImage, match="60000 x 60000"):
        decode(bomb, max_pixels=10**8)


def test_brightness_is_the_mean_of_the_light_in_each_pixel() -> None:
    """Against the formula, pixel by pixel, of a picture small enough that every pixel is looked at."""
    pixels = np.random.default_rng(5).integers(0, 256, (40, 60, 3), dtype=np.uint8)
    pixels[:10] = 0
    pixels[10:15] = 255
    pixels[15:20] = (0, 0, 255)  # red alone is not clipped
    picture = decode(cv2.imencode(".png", pixels)[1].tobytes(), max_pixels=10**6)
    assert picture.luminance == pytest.approx(relative_luminance_of(pixels).mean())
    grey = pixels.astype(int)
    clipped = (grey <= 2).all(axis=2) | (grey >= 253).all(axis=2)
    assert picture.clipped_fraction == clipped.mean()


@pytest.mark.parametrize(
    "data", [b"", b"\xff\xd8", b"\xff\xd8\xff\xe0", b"hello", encoded("jpg")[:60], b"RIFF0000WEBP"]
)
def test_what_is_no_picture_is_said_to_be_none(data: bytes) -> None:
    with pytest.raises(UndecodableImage):
        decode(data, max_pixels=10**6)


@given(st.binary(max_size=200), st.sampled_from(["jpg", "png", "webp"]), st.integers(0, 150))
def test_any_bytes_decode_or_are_refused(tail: bytes, kind: str, keep: int) -> None:
    with contextlib.suppress(UndecodableImage):
        decode(encoded(kind)[:keep] + tail, max_pixels=10**6)
