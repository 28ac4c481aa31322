"""Raw pixels: every encoding against OpenCV's own conversion of the same picture, and wrong sizes."""

from __future__ import annotations

import contextlib

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.core.errors import UndecodableImage
from pipeline.core.records import RawLayout
from pipeline.images.decode import decode
from pipeline.images.raw import as_jpeg, compressed, decode_raw
from tests.support.footage import frame

WIDTH, HEIGHT = 64, 48


def scene() -> np.ndarray:
    """Return a smooth coloured picture: mosaics and shared colour lose little of it."""
    y, x = np.mgrid[0:HEIGHT, 0:WIDTH].astype(np.float64)
    planes = [60 + 2 * x, 40 + 3 * y, 200 - x - y]
    return np.clip(np.stack(planes, axis=-1), 0, 255).astype(np.uint8)


def mosaic(bgr: np.ndarray, pattern: str) -> np.ndarray:
    out = np.empty(bgr.shape[:2], np.uint8)
    for place, letter in enumerate(pattern):
        row, column = divmod(place, 2)
        out[row::2, column::2] = bgr[row::2, column::2, "bgr".index(letter)]
    return out


def uyvy(bgr: np.ndarray, order: tuple[int, int]) -> np.ndarray:
    yuv = cv2.cvtColor(bgr, cv2.COLOR_BGR2YUV_I420)
    luma = yuv[:HEIGHT]
    u = yuv[HEIGHT : HEIGHT * 5 // 4].reshape(HEIGHT // 2, WIDTH // 2).repeat(2, axis=0)
    v = yuv[HEIGHT * 5 // 4 :].reshape(HEIGHT // 2, WIDTH // 2).repeat(2, axis=0)
    out = np.empty((HEIGHT, WIDTH, 2), np.uint8)
    out[..., order[0]] = luma
    out[:, 0::2, order[1]], out[:, 1::2, order[1]] = u, v
    return out


def nv12(bgr: np.ndarray, swap: bool) -> np.ndarray:
    yuv = cv2.cvtColor(bgr, cv2.COLOR_BGR2YUV_I420)
    u, v = yuv[HEIGHT : HEIGHT * 5 // 4].ravel(), yuv[HEIGHT * 5 // 4 :].ravel()
    colour = np.stack([v, u] if swap else [u, v], axis=-1).reshape(-1, WIDTH)
    return np.concatenate([yuv[:HEIGHT], colour])


def stored(bgr: np.ndarray) -> dict[str, np.ndarray]:
    return {
        "bgr8": bgr,
        "8UC3": bgr,
        "rgb8": bgr[..., ::-1],
        "bgra8": np.dstack([bgr, np.full(bgr.shape[:2], 9, np.uint8)]),
        "rgba8": np.dstack([bgr[..., ::-1], np.full(bgr.shape[:2], 9, np.uint8)]),
        "rgb16": bgr[..., ::-1].astype("<u2") << 8,
        **{f"bayer_{p}8": mosaic(bgr, p) for p in ("rggb", "bggr", "gbrg", "grbg")},
        "rgba16": np.dstack([bgr[..., ::-1], np.full(bgr.shape[:2], 9)]).astype("<u2") << 8,
        "bgra16": np.dstack([bgr, np.full(bgr.shape[:2], 9)]).astype("<u2") << 8,
        "bayer_rggb16": mosaic(bgr, "rggb").astype("<u2") << 8,
        "BayerRG8": mosaic(bgr, "rggb"),
        "BayerBG8": mosaic(bgr, "bggr"),
        "BayerGB8": mosaic(bgr, "gbrg"),
        "BayerGR16": mosaic(bgr, "grbg").astype("<u2") << 8,
        "RGB8Packed": bgr[..., ::-1],
        "YUV422_8": uyvy(bgr, (0, 1)),
        "uyvy": uyvy(bgr, (1, 0)),
        "yuv422": uyvy(bgr, (1, 0)),
        "yuyv": uyvy(bgr, (0, 1)),
        "nv12": nv12(bgr, False),
        "nv21": nv12(bgr, True),
        "i420": cv2.cvtColor(bgr, cv2.COLOR_BGR2YUV_I420),
    }


@pytest.mark.parametrize("encoding", stored(scene()))
@pytest.mark.parametrize("reduction", [1, 2, 4])
def test_every_encoding_gives_the_same_picture(encoding: str, reduction: int) -> None:
    data = np.ascontiguousarray(stored(scene())[encoding]).tobytes()
    bgr = decode_raw(data, RawLayout(encoding, WIDTH, HEIGHT), reduction)
    size = (WIDTH // reduction, HEIGHT // reduction)
    expected = cv2.resize(scene(), size, interpolation=cv2.INTER_AREA).astype(int)
    inner = (slice(2, -2), slice(2, -2))  # a mosaic is guessed at the edges
    assert np.abs(bgr[inner].astype(int) - expected[inner]).max() <= 6


@pytest.mark.parametrize(("encoding", "bits"), [("mono8", 16), ("mono16", 16), ("mono16", 12)])
def test_grey_is_grey_at_any_depth_padding_and_byte_order(encoding: str, bits: int) -> None:
    grey = cv2.cvtColor(scene(), cv2.COLOR_BGR2GRAY)
    wide = encoding == "mono16"
    rows = (grey.astype(np.uint16) << (bits - 8)).astype(">u2").view(np.uint8) if wide else grey
    padded = np.pad(rows.reshape(HEIGHT, -1), ((0, 0), (0, 10)), constant_values=77)
    layout = RawLayout(encoding, WIDTH, HEIGHT, padded.shape[1], big_endian=True, bits=bits)
    picture = decode(padded.tobytes(), max_pixels=10**5, layout=layout)
    assert (picture.width_px, picture.height_px, picture.reduction) == (WIDTH, HEIGHT, 1)
    assert np.array_equal(picture.bgr, np.dstack([grey] * 3))


@pytest.mark.parametrize(
    "layout",
    [
        RawLayout("rgb8", WIDTH, HEIGHT + 1),
        RawLayout("rgb8", WIDTH, HEIGHT, step_bytes=WIDTH),
        RawLayout("rgb8", 2**31, 2**31),
        RawLayout("rgb8", 0, HEIGHT),
        RawLayout("nv12", WIDTH - 1, HEIGHT),
        RawLayout("hsv8", WIDTH, HEIGHT),
    ],
)
def test_claims_that_the_bytes_do_not_bear_are_refused(layout: RawLayout) -> None:
    with pytest.raises(UndecodableImage):
        decode(scene().tobytes(), max_pixels=10**8, layout=layout)


def test_what_must_wait_becomes_a_jpeg_of_the_same_picture() -> None:
    layout = RawLayout("bgr8", WIDTH, HEIGHT)
    kept = compressed(frame(3, scene().tobytes(), layout=layout))
    assert (kept.layout, kept.frame_index) == (None, 3)
    assert kept.image == as_jpeg(scene().tobytes(), layout)
    back = decode(kept.image, max_pixels=10**5, full_resolution=True).bgr
    assert np.abs(back.astype(int) - scene()).mean() < 3
    short = frame(0, b"too short", layout=layout)
    assert compressed(short) is short  # so that the reason is told when it is decoded
    assert compressed(frame(0, b"jpeg")).image == b"jpeg"


@given(
    st.binary(max_size=400),
    st.sampled_from(sorted(stored(scene()))),
    st.integers(-2, 40),
    st.integers(-2, 40),
    st.integers(-2, 90),
    st.sampled_from([1, 2, 4, 8]),
)
def test_any_layout_decodes_or_is_refused(
    data: bytes, encoding: str, width: int, height: int, step: int, reduction: int
) -> None:
    layout = RawLayout(encoding, width, height, step)
    with contextlib.suppress(UndecodableImage):
        assert decode_raw(data, layout, reduction).shape[2] == 3


@pytest.mark.parametrize("encoding", ["mono12", "BayerRG12p", "yuv444", "32FC3", ""])
def test_an_encoding_that_is_not_read_is_named_whatever_else_is_wrong(encoding: str) -> None:
    for data in (b"", b"too short", bytes(10_000)):
        with pytest.raises(UndecodableImage, match="is not read") as caught:
            decode(data, max_pixels=10**5, layout=RawLayout(encoding, WIDTH, HEIGHT))
        assert repr(encoding) in str(caught.value)
        assert "mono16" in str(caught.value)
