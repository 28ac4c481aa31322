"""A lens by an angle of view, a sensor's name, or the focal length for 35 mm film."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import pytest

from pipeline.core.camera_file import write_camera_file
from pipeline.core.config import CameraConfig, Config, load_config
from pipeline.core.errors import UsageError
from pipeline.core.exposure import UNKNOWN_EXPOSURE, Exposure
from pipeline.core.lens import intrinsics_of, lens_of
from pipeline.core.records import Intrinsics
from pipeline.core.sensors.hints import assumption_of, gives_lens
from pipeline.core.sensors.table import SENSORS, sensor_named

SIZE = (1920, 1080)


def focal_px(
    camera: CameraConfig,
    recorded: Intrinsics | None = None,
    exposure: Exposure = UNKNOWN_EXPOSURE,
    size: tuple[int, int] = SIZE,
) -> tuple[float, str | None, str | None]:
    lens = lens_of(exposure, camera, recorded, *size)
    found, source, complaint = intrinsics_of(recorded, camera, lens, *size)
    return (found.fx_px if found else math.nan), source, complaint


def test_an_angle_of_view_gives_the_focal_length() -> None:
    # Half the width is seen under half the angle: tan 45 degrees is one.
    assert focal_px(CameraConfig("c", hfov_deg=90.0))[:2] == (pytest.approx(960.0), "camera_file")
    # A picture of 36 mm before a lens of 18 mm has 90 degrees too.
    by_film = CameraConfig("c", focal_length_35mm_mm=math.hypot(36, 24) / math.hypot(*SIZE) * 960)
    assert focal_px(by_film)[0] == pytest.approx(960.0)


def test_a_data_sheet_that_gives_both_agrees_with_itself() -> None:
    """Raspberry Pi states sensor, focal length and angle of view: two ways to one lens."""
    stated_deg = {
        "raspberry pi camera 1": (53.5, 2592, 1944),
        "raspberry pi camera 2": (62.2, 3280, 2464),
        "raspberry pi camera 3": (66.0, 4608, 2592),
        "raspberry pi camera 3 wide": (102.0, 4608, 2592),
    }
    for name, (angle_deg, *size) in stated_deg.items():
        by_sensor = focal_px(CameraConfig("c", sensor=name), size=(size[0], size[1]))[0]
        by_angle = focal_px(CameraConfig("c", hfov_deg=angle_deg), size=(size[0], size[1]))[0]
        assert by_sensor == pytest.approx(by_angle, rel=0.06), name


def test_a_sensor_gives_the_pitch_of_the_largest_part_of_its_shape() -> None:
    camera = CameraConfig("c", sensor='1/2.3"', focal_length_mm=4.0)  # 6.17 x 4.55 mm
    wide = lens_of(UNKNOWN_EXPOSURE, camera, None, 1920, 1080)  # less high than 4:3
    assert wide.pixel_pitch_x_um == wide.pixel_pitch_y_um == pytest.approx(6170 / 1920)
    square = lens_of(UNKNOWN_EXPOSURE, camera, None, 1000, 1000)  # less wide
    assert square.pixel_pitch_x_um == pytest.approx(4550 / 1000)
    upright = lens_of(UNKNOWN_EXPOSURE, camera, None, 1080, 1920)  # a telephone held upright
    assert upright.pixel_pitch_x_um == pytest.approx(6170 / 1920)
    shrunk = replace(UNKNOWN_EXPOSURE, sensor_width_px=4000.0, sensor_height_px=3000.0)
    assert lens_of(shrunk, camera, None, 1920, 1080).pixel_pitch_x_um == pytest.approx(6170 / 1920)
    assert focal_px(camera)[0] == pytest.approx(4.0 / 6.17 * 1920)


def test_what_is_stated_goes_before_a_hint() -> None:
    both = CameraConfig("c", hfov_deg=90.0, fx_px=1500.0)
    assert focal_px(both)[0] == 1500.0
    pitched = CameraConfig("c", sensor="1/3", pixel_pitch_x_um=2.0, focal_length_mm=4.0)
    assert focal_px(pitched)[0] == pytest.approx(2000.0)
    recorded = replace(UNKNOWN_EXPOSURE, pixel_pitch_x_um=2.0)
    assert focal_px(replace(pitched, pixel_pitch_x_um=math.nan), exposure=recorded)[0] == 2000.0


def test_a_calibration_stays_unless_a_hint_contradicts_it() -> None:
    recorded = Intrinsics(*SIZE, 980.0, 981.0, 950.0, 530.0, "plumb_bob", (0.1, 0, 0, 0, 0))
    camera = CameraConfig("c", hfov_deg=90.0)
    assert focal_px(camera, recorded)[:2] == (980.0, "recording")
    far = replace(recorded, fx_px=2000.0, fy_px=2000.0)
    found_px, source, complaint = focal_px(camera, far)
    assert (found_px, source) == (pytest.approx(960.0), "camera_file")
    assert "2000 px" in (complaint or "")


@pytest.mark.parametrize(
    ("camera", "code", "words"),
    [
        (CameraConfig("c", hfov_deg=90.0), "lens_by_angle", "0.9%"),
        (CameraConfig("c", sensor="1/2.8"), "lens_by_sensor", "7%"),
        (CameraConfig("c", focal_length_35mm_mm=25.0), "rounded_focal_length", "2.0%"),
    ],
)
def test_a_hint_is_told_with_what_it_costs(camera: CameraConfig, code: str, words: str) -> None:
    told = assumption_of(camera, 1920)
    assert told is not None
    assert told[0] == code
    assert words in told[1]
    assert assumption_of(replace(camera, fx_px=900.0), 1920) is None


def test_each_way_counts_as_a_lens() -> None:
    assert not gives_lens(CameraConfig("c"))
    assert not gives_lens(CameraConfig("c", sensor="1/3"))  # a size without a focal length
    assert gives_lens(CameraConfig("c", sensor="Raspberry Pi Camera 2"))
    assert gives_lens(CameraConfig("c", sensor="1/3", focal_length_mm=4.0))
    assert gives_lens(CameraConfig("c", focal_length_35mm_mm=26.0))


def test_names_of_sensors_are_found_as_people_write_them() -> None:
    for name in ('1/2.8"', "1/2.8-inch type", "1/2.8 inch", "Type 1/2.8"):
        assert sensor_named(name) is SENSORS["1/2.8"], name
    assert sensor_named("Full-Frame") is sensor_named("35mm") is SENSORS["full frame"]
    assert sensor_named("1 inch") is sensor_named('1"') is SENSORS["1 inch"]
    assert sensor_named("MICRO FOUR THIRDS") is SENSORS["4/3"]
    assert sensor_named("1/9.9") is None


def test_settings_that_cannot_be_are_refused_with_what_can(tmp_path: Path) -> None:
    path = tmp_path / "camera.toml"
    for line, words in (
        ("hfov_deg = 180.0", "at most 170"),
        ("focal_length_35mm_mm = 0.0", "at least 1"),
        ('sensor = "1/2.88"', '"1/2.8"'),
    ):
        path.write_text(f'[[camera]]\nname = "c"\n{line}\n')
        with pytest.raises(UsageError, match=words):
            load_config(path)


def test_hints_survive_a_camera_file(tmp_path: Path) -> None:
    path = tmp_path / "camera.toml"
    camera = CameraConfig("c", hfov_deg=78.0, sensor="1/2.8", focal_length_35mm_mm=24.0)
    write_camera_file(path, Config(camera=(camera,)))
    assert load_config(path).camera_named("c").hfov_deg == 78.0
    assert load_config(path).camera_named("c").sensor == "1/2.8"
