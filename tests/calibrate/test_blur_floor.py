from dataclasses import replace

import numpy as np
import pytest

from pipeline.calibrate.blur_floor import BlurFloor, calibrate_blur_floor, combined
from pipeline.core.config import CameraConfig, Config
from pipeline.core.errors import CalibrationUndetermined
from tests.estimate.methods.test_defocus import by_blur, observed

SWEEP = np.array([1.8, 2.8, 4.0, 5.6, 8.0, 11.0, 16.0])
UNKNOWN = np.full(7, np.nan)


def test_a_sweep_gives_the_floor():
    m = observed(np.full(7, 2.0), SWEEP, floor_px=1.1)
    floor = calibrate_blur_floor(m, UNKNOWN)
    assert floor.floor_px == pytest.approx(1.1, abs=0.03)
    assert floor.source == "sweeps"
    assert floor.std_px < 0.1


def test_truth_gives_the_floor():
    depths = np.linspace(1.0, 6.0, 30)
    m = observed(depths, 5.6, floor_px=0.9, track_id=np.arange(30))
    floor = calibrate_blur_floor(m, depths)
    assert floor.floor_px == pytest.approx(0.9, abs=0.03)
    assert floor.source == "truth"


def test_a_few_false_truths_do_not_move_it():
    depths = np.linspace(2.0, 6.0, 30)
    m = observed(depths, 8.0, floor_px=0.9, track_id=np.arange(30))
    wrong = depths.copy()
    wrong[:4] = 1.0
    assert calibrate_blur_floor(m, wrong).floor_px == pytest.approx(0.9, abs=0.05)


def test_without_either_the_sharpest_objects_are_taken_for_sharp():
    depths = np.concatenate([np.full(4, 2.0), np.linspace(1.0, 1.8, 20)])
    m = observed(depths, 2.8, 2.0, floor_px=0.7, track_id=np.arange(24))
    floor = calibrate_blur_floor(m, np.full(24, np.nan))
    assert floor.source == "sharpest"
    assert floor.floor_px == pytest.approx(0.7, abs=0.05)


def test_too_little_blur_is_refused():
    m = observed(np.linspace(1.0, 1.2, 5), track_id=np.arange(5))
    with pytest.raises(CalibrationUndetermined, match="5 tracks"):
        calibrate_blur_floor(m, np.full(5, np.nan))
    with pytest.raises(CalibrationUndetermined):
        calibrate_blur_floor(replace(m, blur_sigma_px=None), np.full(5, np.nan))


def test_floors_that_disagree_are_less_sure():
    alike = combined([BlurFloor(0.6, 0.03, "sweeps", 7), BlurFloor(0.61, 0.03, "truth", 9)])
    apart = combined([BlurFloor(0.5, 0.03, "sweeps", 7), BlurFloor(0.8, 0.03, "truth", 9)])
    assert alike.std_px < 0.03 < apart.std_px
    assert (alike.source, alike.count) == ("sweeps and truth", 16)


def test_a_calibrated_floor_reaches_farther():
    far = observed(8.0, 5.6, floor_px=0.9)
    sweep = calibrate_blur_floor(observed(np.full(7, 2.0), SWEEP, floor_px=0.9), UNKNOWN)
    camera = CameraConfig("cam", blur_floor_px=sweep.floor_px, blur_floor_std_px=sweep.std_px)
    estimated, _ = by_blur(far, config=Config(camera=(camera,)))
    assert estimated.depth_m[0] == pytest.approx(8.0, rel=0.05)
    assert np.isnan(by_blur(observed(8.0, 8.0))[0].depth_m[0])
