from __future__ import annotations

import math
from pathlib import Path

import pytest

import stadimeter
from pipeline.core.config import Config, load_config
from pipeline.core.errors import UsageError
from pipeline.core.setting_bounds import impossible_settings

CAMERA = '[[camera]]\nname = "mast"\n'
PRIOR = '[[size_prior]]\nobject_class = "{kind}"\ndimension = "height"\nmean_m = {mean}\nstd_m = {std}\n'
KNOWN = "known_length = [{{ points_px = [{px}], length_m = {m}{rest} }}]"
SIZE = (
    '[[calibration]]\nmethod = "size"\nobject_class = "van"\ndimension = "width"\n'
    'parameters = [{{ name = "object_size_m", value = {value}, std_error = {error} }}]\n{rest}\n'
)

IMPOSSIBLE = {
    CAMERA
    + "tilt_deg = 100.0": "camera[0].tilt_deg is 100; it must be at least -90 and at most 90",
    CAMERA + "tilt_deg = -90.5": "camera[0].tilt_deg",
    CAMERA + "roll_deg = 400.0": "camera[0].roll_deg",
    CAMERA + "camera_height_m = 0.0": "camera[0].camera_height_m is 0; it must be more than 0",
    CAMERA + "camera_height_m = -3.0": "camera[0].camera_height_m",
    CAMERA + "camera_height_m = inf": "camera[0].camera_height_m",
    CAMERA + "camera_height_m = 3.0\ncamera_height_std_m = inf": "camera_height_std_m",
    CAMERA + "camera_height_m = 3.0\ncamera_height_std_m = 4.0": "at most camera_height_m, 3",
    CAMERA + "camera_height_m = 3.0\ncamera_height_std_m = -0.1": "camera_height_std_m",
    CAMERA + "tilt_std_deg = inf": "camera[0].tilt_std_deg",
    CAMERA + "tilt_std_deg = -1.0": "camera[0].tilt_std_deg",
    CAMERA + "focal_length_mm = -4.0": "camera[0].focal_length_mm",
    CAMERA + "focal_length_mm = 0.0": "camera[0].focal_length_mm",
    CAMERA + "f_number = 0.0": "camera[0].f_number",
    CAMERA + "focus_distance_m = -1.0": "camera[0].focus_distance_m",
    CAMERA + "pixel_pitch_x_um = 0.0": "camera[0].pixel_pitch_x_um",
    CAMERA + "fx_px = 0.0": "camera[0].fx_px",
    CAMERA + "fx_px = inf": "camera[0].fx_px",
    CAMERA + "fy_px = -1000.0": "camera[0].fy_px",
    CAMERA + "cx_px = inf": "camera[0].cx_px",
    CAMERA + "blur_floor_px = -1.0": "camera[0].blur_floor_px",
    CAMERA + "distortion = [inf, 0.0]": "camera[0].distortion[0] is inf; it must be finite",
    CAMERA + "roi_xyxy_px = [10.0, 0.0, 5.0, 9.0]": "camera[0].roi_xyxy_px",
    CAMERA + "roi_xyxy_px = [10.0, 0.0]": "camera[0].roi_xyxy_px",
    CAMERA + KNOWN.format(px="1, 9, 1", m=2.0, rest=""): "camera[0].known_length[0].points_px",
    CAMERA + KNOWN.format(px="1, 9, 1, 9", m=2.0, rest=""): "two points that are apart",
    CAMERA + KNOWN.format(px="1, 2, 1, 9", m=2.0, rest=", upright = true"): "foot must come first",
    CAMERA + KNOWN.format(px="1, 9, 1, 2", m=-2.0, rest=""): "known_length[0].length_m is -2",
    CAMERA + KNOWN.format(px="1, 9, 1, 2", m=2.0, rest=", std_m = 3.0"): "at most length_m, 2",
    CAMERA + KNOWN.format(px="1, 9, 1, 2", m=2.0, rest=", std_px = 0.0"): "known_length[0].std_px",
    CAMERA + CAMERA: "camera[1].name 'mast' is there twice",
    '[[camera]]\nname = ""': "camera[0].name is empty",
    PRIOR.format(kind="person", mean=-1.7, std=0.1): "size_prior[0].mean_m",
    PRIOR.format(kind="person", mean=17.0, std=0.1): "the mean stature of people must be",
    PRIOR.format(kind="person", mean=170.0, std=9.0): "size_prior[0].mean_m",
    PRIOR.format(kind="van", mean=2.0, std=-0.1): "size_prior[0].std_m",
    PRIOR.format(kind="van", mean=2.0, std="inf"): "size_prior[0].std_m",
    PRIOR.format(kind="van", mean=2.0, std=2.5): "at most mean_m, 2",
    PRIOR.format(kind="van", mean=2.0, std=0.1) + "mean_std_m = -0.1": "size_prior[0].mean_std_m",
    PRIOR.format(kind="", mean=2.0, std=0.1): "size_prior[0].object_class is empty",
    SIZE.format(value="inf", error=0.1, rest=""): "calibration[0].parameters[0].value",
    SIZE.format(value=1.9, error=-0.1, rest=""): "calibration[0].parameters[0].std_error",
    SIZE.format(value=1.9, error=0.1, rest="depth_min_m = 9.0\ndepth_max_m = 3.0"): "depth_min_m",
    SIZE.format(value=1.9, error=0.1, rest="residual_std_m = -1.0"): "residual_std_m",
    "[detect]\nmin_height = -0.1": "detect.min_height",
    "[detect]\nmin_score = 1.5": "detect.min_score is 1.5; it must be at least 0 and at most 1",
    "[detect]\nlearning_s = 0.0": "detect.learning_s is 0; it must be more than 0",
    "[detect]\nlearning_s = inf": "detect.learning_s",
    "[detect]\nmodel_input_px = 7": "detect.model_input_px is 7; it must be 0 or at least 32",
    "[detect]\nmax_overlap = -0.5": "detect.max_overlap",
    "[detect]\nmin_side_px = 0": "detect.min_side_px",
    "[track]\ncoast_s = -1.0": "track.coast_s",
    "[track]\nmin_count = 0": "track.min_count",
    "[track]\nmin_duration_s = inf": "track.min_duration_s",
    "[ingest]\nexposure_tolerance_s = -0.1": "ingest.exposure_tolerance_s",
    "[ingest]\nreorder_s = inf": "ingest.reorder_s",
    "[limits]\nrecord_bytes = 0": "limits.record_bytes",
    "[limits]\ncameras = -1": "limits.cameras",
    "[timeline]\nsplit_s = 0.0": "timeline.split_s",
    "[timeline]\npreview_px = 1": "timeline.preview_px",
}


@pytest.mark.parametrize("text", IMPOSSIBLE, ids=range(len(IMPOSSIBLE)))
def test_impossible_settings_are_refused_with_their_key_and_bound(tmp_path: Path, text: str):
    path = tmp_path / "camera.toml"
    path.write_text(text)
    with pytest.raises(UsageError) as refused:
        load_config(path)
    assert IMPOSSIBLE[text] in str(refused.value)
    assert str(path) in str(refused.value)


def test_unusual_settings_are_taken(tmp_path: Path):
    path = tmp_path / "camera.toml"
    path.write_text(
        CAMERA + "tilt_deg = 90.0\nroll_deg = 180.0\ncamera_height_m = 400.0\n"
        "focal_length_mm = 800.0\nfocus_distance_m = inf\nfx_px = 60000.0\n"
        "[detect]\nmodel_input_px = 0\nmin_score = 0.0\n[timeline]\nsplit_s = inf\n"
        + PRIOR.format(kind="person", mean=1.1, std=0.0)
    )
    camera = load_config(path).camera[0]
    assert camera.tilt_deg == 90.0
    assert math.isinf(camera.focus_distance_m)


def test_all_problems_are_named_at_once(tmp_path: Path):
    path = tmp_path / "camera.toml"
    path.write_text(CAMERA + "tilt_deg = 100.0\nroll_deg = 400.0\n[track]\nmin_count = 0\n")
    with pytest.raises(UsageError) as refused:
        load_config(path)
    for key in ("camera[0].tilt_deg", "camera[0].roll_deg", "track.min_count"):
        assert key in str(refused.value)


def test_the_defaults_are_possible():
    assert impossible_settings(Config()) == []


@pytest.mark.parametrize("window_s", [-5.0, math.nan, math.inf, 0.2])
def test_impossible_windows_are_refused_before_any_work(tmp_path: Path, window_s: float):
    with pytest.raises(UsageError, match="at least 1"):
        stadimeter.measure_parts([tmp_path / "a.mcap"], tmp_path / "parts", window_s=window_s)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("workers", [0, -3])
def test_impossible_workers_are_refused_before_any_work(tmp_path: Path, workers: int):
    with pytest.raises(UsageError, match="at least 1"):
        stadimeter.measure([tmp_path / "a.mcap"], tmp_path / "x.duckdb", workers=workers)
    assert not list(tmp_path.iterdir())
