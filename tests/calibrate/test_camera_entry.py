"""A pose and a lens that were found, written to a camera file and read back."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pipeline.calibrate.camera_entry import (
    CENTRE_STD,
    as_given,
    given_pose,
    with_assumed_centre,
)
from pipeline.calibrate.stored_lens import known_lens
from pipeline.core.arrays import FloatArray
from pipeline.core.camera_file import write_camera_file
from pipeline.core.camera_row import CameraRow
from pipeline.core.config import CameraConfig, Config, load_config
from pipeline.core.errors import UsageError
from pipeline.core.records import FoundLens, GroundPlane, Intrinsics

LENS = FoundLens(Intrinsics(640, 480, 700.0, 700.0, 319.5, 239.5), 70.0)
BARE = CameraRow("yard", width_px=640, height_px=480)


def found(seed: int) -> tuple[GroundPlane, FloatArray]:
    """Return a pose, and the covariance of height, tilt, roll and the focal length's logarithm."""
    random = np.random.default_rng(seed)
    root = random.normal(size=(4, 4)) * np.array([[0.3], [0.02], [0.01], [0.1]])
    covariance = root @ root.T
    plane = GroundPlane(4.2, 0.3, -0.02, covariance[:3, :3], "walkers", covariance[3])
    return plane, covariance


def read_back(path: Path, camera: CameraConfig) -> CameraConfig:
    write_camera_file(path, Config(camera=(camera,)))
    return load_config(path).camera_named("yard")


@pytest.mark.parametrize("seed", range(3))
def test_what_was_found_is_as_sure_when_it_is_read_back(tmp_path: Path, seed: int) -> None:
    plane, covariance = found(seed)
    camera = read_back(tmp_path / "camera.toml", as_given("yard", plane, LENS))
    row = known_lens(BARE, camera)
    given = given_pose(camera, row)
    assert given is not None
    assert given.focal_covariance is not None
    np.testing.assert_allclose(given.covariance, covariance[:3, :3], rtol=1e-9)
    np.testing.assert_allclose(given.focal_covariance, covariance[3], rtol=1e-9)
    assert row.focal_std_px == pytest.approx(700.0 * np.sqrt(covariance[3, 3]))
    assert (given.camera_height_m, given.tilt_rad) == pytest.approx((4.2, 0.3))


def test_a_recordings_own_lens_does_not_err_with_the_pose(tmp_path: Path) -> None:
    plane, _ = found(0)
    camera = read_back(tmp_path / "camera.toml", as_given("yard", plane, LENS))
    row = replace(BARE, fx_px=700.0, intrinsics_source="recording")
    given = given_pose(camera, row)
    assert given is not None
    assert given.focal_covariance is None


def test_files_without_correlations_are_read_as_before() -> None:
    plane, covariance = found(0)
    camera = replace(as_given("yard", plane, None), pose_correlation=())
    given = given_pose(camera, BARE)
    assert given is not None
    np.testing.assert_allclose(given.covariance, np.diag(np.diag(covariance)[:3]), rtol=1e-9)
    assert given.focal_covariance is None


@pytest.mark.parametrize("correlation", ["[0.1, 0.2]", "[0.1, 0.2, 1.5]"])
def test_correlations_that_are_none_are_refused(tmp_path: Path, correlation: str) -> None:
    path = tmp_path / "camera.toml"
    path.write_text(f'[[camera]]\nname = "yard"\npose_correlation = {correlation}\n')
    with pytest.raises(UsageError, match="pose_correlation must be three numbers from -1 to 1"):
        load_config(path)


def test_an_assumed_centre_makes_a_surveyed_tilt_less_sure() -> None:
    surveyed = CameraConfig("yard", camera_height_m=4.0, tilt_deg=15.0, tilt_std_deg=0.1)
    assumed = replace(BARE, fx_px=700.0, fy_px=700.0, centre_source="assumed")
    pose = given_pose(surveyed, assumed)
    assert pose is not None
    std = np.sqrt(with_assumed_centre(pose, assumed, surveyed).covariance[1, 1])
    # A point that is y rows below the middle is seen arctan(y / f) below it.
    expected = np.hypot(np.deg2rad(0.1), np.arctan(CENTRE_STD * 640 / 700.0))
    assert std == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize("source", ["recording", "camera_file", "walkers", None])
def test_a_stated_centre_leaves_a_pose_as_it_is(source: str | None) -> None:
    surveyed = CameraConfig("yard", camera_height_m=4.0, tilt_deg=15.0)
    row = replace(BARE, fx_px=700.0, fy_px=700.0, centre_source=source)
    pose = given_pose(surveyed, row)
    assert pose is not None
    assert with_assumed_centre(pose, row, surveyed) is pose


def test_a_pose_by_walkers_was_fitted_with_the_centre_that_was_assumed(tmp_path: Path) -> None:
    plane, _ = found(0)
    camera = read_back(tmp_path / "camera.toml", as_given("yard", plane, LENS))
    row = replace(BARE, fx_px=700.0, fy_px=700.0, centre_source="assumed")
    assert with_assumed_centre(plane, row, camera) is plane
