"""EXIF against Pillow's writer, in three kinds of pictures, and against any bytes."""

from __future__ import annotations

import io
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image
from PIL.TiffImagePlugin import IFDRational

from pipeline.core.config import CameraConfig
from pipeline.core.exposure import Exposure
from pipeline.core.lens import lens_of
from pipeline.images.exif import exif_block, exposure_of, read_tags

SIZE = (600, 400)


def photo(kind: str = "jpeg", /, **values: object) -> bytes:
    """Return a picture with EXIF as Pillow writes it."""
    numbers = {
        "ExposureTime": 0x829A,
        "FNumber": 0x829D,
        "ISO": 0x8827,
        "Brightness": 0x9203,
        "ExposureBias": 0x9204,
        "SubjectDistance": 0x9206,
        "FocalLength": 0x920A,
        "PixelX": 0xA002,
        "PixelY": 0xA003,
        "FocalPlaneX": 0xA20E,
        "FocalPlaneY": 0xA20F,
        "FocalPlaneUnit": 0xA210,
        "Focal35": 0xA405,
    }
    exif = Image.Exif()
    exif[0x0110] = "Model X"
    inner = exif.get_ifd(0x8769)
    for name, value in values.items():
        inner[numbers[name]] = value
    stream = io.BytesIO()
    Image.new("RGB", SIZE).save(stream, kind, exif=exif)
    return stream.getvalue()


def exposure(image: bytes) -> Exposure:
    block = exif_block(image)
    assert block is not None
    found, refused = exposure_of(read_tags(block), *SIZE)
    assert not refused
    return found


@pytest.mark.parametrize("kind", ["jpeg", "png", "webp"])
def test_the_values_that_pillow_writes(kind: str) -> None:
    image = photo(
        kind,
        ExposureTime=IFDRational(1, 250),
        FNumber=IFDRational(28, 10),
        ISO=400,
        ExposureBias=IFDRational(-2, 3),
        SubjectDistance=IFDRational(35, 10),
        FocalLength=IFDRational(50, 1),
        PixelX=6000,
        PixelY=4000,
        FocalPlaneX=IFDRational(6000 * 10, 234),  # a sensor of 23.4 mm
        FocalPlaneY=IFDRational(6000 * 10, 234),
        FocalPlaneUnit=4,  # millimetres
    )
    found = exposure(image)
    assert found.exposure_time_s == pytest.approx(1 / 250)
    assert (found.f_number, found.iso_speed) == (pytest.approx(2.8), 400)
    assert found.exposure_bias_ev == pytest.approx(-2 / 3)
    assert (found.focus_distance_m, found.focal_length_mm) == (pytest.approx(3.5), 50)
    assert found.pixel_pitch_x_um == pytest.approx(3.9)
    assert (found.sensor_width_px, found.sensor_height_px) == (6000, 4000)


@pytest.mark.parametrize(
    ("written", "expected"),
    [((0, 1), math.nan), ((0xFFFFFFFF, 1), math.inf), ((7, 2), 3.5), ((0, 0), math.nan)],
)
def test_conventions_of_the_subject_distance(written: tuple[int, int], expected: float) -> None:
    found = exposure(photo(FNumber=IFDRational(4), SubjectDistance=IFDRational(*written)))
    assert found.focus_distance_m == pytest.approx(expected, nan_ok=True)
    assert found.f_number == 4


def test_the_pitch_by_the_focal_length_for_35_mm_film() -> None:
    found = exposure(photo(FocalLength=IFDRational(43, 10), Focal35=26))
    lens = lens_of(found, CameraConfig("phone"), None, *SIZE)
    focal_px = lens.focal_length_mm * 1e3 / lens.pixel_pitch_x_um
    half_diagonal = math.atan(math.hypot(*SIZE) / 2 / focal_px)
    assert half_diagonal == pytest.approx(math.atan(math.hypot(36, 24) / 2 / 26))


@pytest.mark.parametrize(
    ("written", "expected"),
    [((5, 2), 2.5), ((0, 1), 0.0), ((-7, 2), -3.5), ((-1, 100), math.nan), ((0, 0), math.nan)],
)
def test_brightness_is_signed_and_unknown_by_its_numerator(
    written: tuple[int, int], expected: float
) -> None:
    found = exposure(photo(FNumber=IFDRational(4), Brightness=IFDRational(*written)))
    assert found.brightness_ev == pytest.approx(expected, nan_ok=True)
    assert found.f_number == 4


def test_the_resolution_of_a_picture_that_was_shrunk_is_not_believed() -> None:
    values = {"FocalLength": IFDRational(54, 10), "PixelX": 600, "PixelY": 400}
    found = exposure(photo(**values, FocalPlaneX=9892.0, FocalPlaneY=9892.0, FocalPlaneUnit=2))
    assert math.isnan(found.pixel_pitch_x_um)


def test_impossible_values_are_refused_one_by_one() -> None:
    image = photo(FNumber=IFDRational(4), ExposureTime=IFDRational(10**6, 1))
    block = exif_block(image)
    assert block is not None
    found, refused = exposure_of(read_tags(block), *SIZE)
    assert found.f_number == 4
    assert math.isnan(found.exposure_time_s)
    assert len(refused) == 1
    assert "exposure_time_s" in refused[0]


@given(st.integers(0, 400), st.binary(max_size=60), st.sampled_from(["jpeg", "png", "webp"]))
def test_any_bytes_are_read_or_left(at: int, junk: bytes, kind: str) -> None:
    image = photo(kind, FNumber=IFDRational(4), ExposureTime=IFDRational(1, 8))
    image = image[:at] + junk + image[at + len(junk) :]
    block = exif_block(image)
    if block is not None:
        exposure_of(read_tags(block), *SIZE)


@given(st.binary(max_size=300), st.sampled_from([b"II*\0\x08\0\0\0", b"MM\0*\0\0\0\x08", b""]))
def test_any_block_is_read(data: bytes, head: bytes) -> None:
    exposure_of(read_tags(head + data), *SIZE)
