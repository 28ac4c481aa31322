"""Lenses that people who walk contradict, and those that they do not."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from bench.walkers import Scene, scene
from pipeline.calibrate.walkers.lens_check import LensCheck, check_lens
from pipeline.calibrate.walkers.pose import fit_walkers
from pipeline.calibrate.walkers.pose_and_lens import calibrate_stored
from pipeline.core.camera_row import CameraRow
from pipeline.core.config import ADULT
from pipeline.core.records import GroundPlane, Intrinsics, Severity

ROW = CameraRow("mast", width_px=1280, height_px=720)


@pytest.fixture(scope="module")
def simulated() -> Scene:
    return scene(np.random.default_rng(3), 40)


def longer(simulated: Scene, by: float) -> Scene:
    lens = simulated.measured.intrinsics
    assert isinstance(lens, Intrinsics)
    wrong = replace(lens, fx_px=by * lens.fx_px, fy_px=by * lens.fy_px)
    return replace(simulated, measured=replace(simulated.measured, intrinsics=wrong))


def test_the_right_lens_is_not_contradicted(simulated: Scene) -> None:
    check = check_lens(fit_walkers(simulated.measured, ADULT))
    assert check is not None
    assert not check.contradicts
    assert abs(check.log_ratio) < 2 * check.std


def test_a_wrong_calibration_is_told_and_stays(simulated: Scene) -> None:
    wrong = longer(simulated, 2.0).measured
    row = replace(ROW, intrinsics_source="recording")
    made = calibrate_stored(wrong, row, ADULT)
    assert made.lens is None
    assert made.plane.focal_covariance is None
    assert made.contradiction is not None
    assert abs(made.contradiction.log_ratio + math.log(2.0)) < 3 * made.contradiction.std
    note = made.contradiction.describe("mast", "recording")
    assert note.severity == Severity.WARNING
    assert "the recording's calibration says" in note.message
    assert "Check that the calibration is of this lens" in note.message


def test_wrong_lens_data_become_so_unsure_that_depths_hold(simulated: Scene) -> None:
    wrong = longer(simulated, 2.0).measured
    told = calibrate_stored(wrong, replace(ROW, intrinsics_source="recording"), ADULT).plane
    unsure = calibrate_stored(wrong, replace(ROW, intrinsics_source="lens_data"), ADULT).plane
    assert unsure.focal_covariance is not None
    assert unsure.focal_covariance[3] > (math.log(2.0) / 2) ** 2
    assert (np.diag(unsure.covariance) > np.diag(told.covariance)).all()
    whole = np.block(
        [
            [unsure.covariance, unsure.focal_covariance[:3, None]],
            [unsure.focal_covariance[None]],
        ]
    )
    assert np.linalg.eigvalsh(whole).min() > 0


def test_either_focal_length_is_in_the_interval() -> None:
    plane = GroundPlane(5.0, 0.3, 0.0, np.diag([0.1, 0.01, 0.01]) ** 2)
    check = LensCheck(1000.0, math.log(0.5), 0.1, np.array([1.0, 0.2, 0.0]))
    assert check.contradicts
    wide = check.widened(plane)
    assert wide.focal_covariance is not None
    assert 1.96 * math.sqrt(wide.focal_covariance[3]) > abs(check.log_ratio)
    assert wide.covariance[0, 0] == pytest.approx(0.1**2 + math.log(0.5) ** 2 / 2)
