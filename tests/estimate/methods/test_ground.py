"""The ground method: exact on exact boxes, NaN where it does not apply, correct intervals."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bench.walkers import Scene, scene
from pipeline.core.config import Config
from pipeline.core.records import GroundPlane
from pipeline.estimate.boxes.geometry import Geometry
from pipeline.estimate.methods import ground
from pipeline.optics.ground_plane import project_person


@pytest.fixture(scope="module")
def simulated() -> Scene:
    return scene(np.random.default_rng(2), 6, bad_share=0.0)


@pytest.mark.parametrize("roll_rad", [0.0, 0.05, -0.05])
def test_depths_and_heights_come_back_from_exact_boxes(simulated: Scene, roll_rad: float) -> None:
    plane, k = simulated.plane, simulated.measured.intrinsics
    assert k is not None
    plane = replace(plane, roll_rad=roll_rad)
    x_m = np.linspace(-2, 2, 5)
    y_m = simulated.true_depth_m[:5] / np.cos(plane.tilt_rad)
    pose = (plane.camera_height_m, plane.tilt_rad, plane.roll_rad)
    foot, head = project_person(x_m, y_m, 1.75, *pose)
    foot_px = foot * [k.fx_px, k.fy_px] + [k.cx_px, k.cy_px]
    head_px = head * [k.fx_px, k.fy_px] + [k.cx_px, k.cy_px]
    middle_px = (foot_px[:, 0] + head_px[:, 0]) / 2  # who leans reaches from one end to the other
    box = np.stack([middle_px - 9, head_px[:, 1], middle_px + 9, foot_px[:, 1]], axis=1)
    m = simulated.measured
    names = [n for n in m.__slots__ if isinstance(getattr(m, n), np.ndarray)]
    first = {n: getattr(m, n)[:5] for n in names} | {"bbox_xyxy_px": box}
    found = ground.estimate(Geometry.of(replace(m, **first, ground_plane=plane)), Config())
    np.testing.assert_allclose(found.height_m, 1.75, rtol=1e-5)
    np.testing.assert_allclose(found.x_m, x_m, atol=1e-4)
    np.testing.assert_allclose(found.y_m, y_m, rtol=1e-5)
    along = y_m * np.cos(plane.tilt_rad) + plane.camera_height_m * np.sin(plane.tilt_rad)
    np.testing.assert_allclose(found.depth_m, along, rtol=1e-5)
    drop = plane.camera_height_m - 0.875
    np.testing.assert_allclose(found.range_m, np.sqrt(x_m**2 + y_m**2 + drop**2), rtol=1e-5)
    assert not found.height_assumed.any()


def test_what_the_picture_cuts_is_not_told(simulated: Scene) -> None:
    cut = np.zeros((len(simulated.measured), 4), bool)
    cut[0, 3] = cut[1, 1] = True
    measured = replace(simulated.measured, truncated=cut, ground_plane=simulated.plane)
    found = ground.estimate(Geometry.of(measured), Config())
    assert np.isnan(found.depth_m[0])
    assert np.isnan(found.height_m[0])
    assert np.isfinite(found.depth_m[1])
    assert np.isnan(found.height_m[1])
    assert np.isfinite(found.height_m[2])


def test_without_a_pose_or_a_lens_there_is_nothing(simulated: Scene) -> None:
    for change in ({"ground_plane": None}, {"intrinsics": None}):
        measured = replace(simulated.measured, **({"ground_plane": simulated.plane} | change))
        assert np.isnan(ground.estimate(Geometry.of(measured), Config()).depth_m).all()


def test_the_stated_deviation_is_that_of_a_simulation(simulated: Scene) -> None:
    """Perturb the pose and the boxes as their deviations say, and look at the spread."""
    random, row = np.random.default_rng(4), 10
    covariance = np.diag([0.05**2, np.deg2rad(0.3) ** 2, np.deg2rad(0.2) ** 2])
    plane = replace(simulated.plane, covariance=covariance)
    measured = replace(simulated.measured, ground_plane=plane)
    stated = ground.estimate(Geometry.of(measured), Config())
    drawn = []
    for _ in range(400):
        h, t, r = random.multivariate_normal(
            [plane.camera_height_m, plane.tilt_rad, plane.roll_rad], covariance
        )
        box = measured.bbox_xyxy_px[[row]] + random.normal(0, measured.std_xyxy_px[[row]])
        names = [n for n in measured.__slots__ if isinstance(getattr(measured, n), np.ndarray)]
        one = {n: getattr(measured, n)[[row]] for n in names} | {"bbox_xyxy_px": box}
        found = ground.estimate(
            Geometry.of(replace(measured, **one, ground_plane=GroundPlane(h, t, r))), Config()
        )
        drawn.append((found.depth_m[0], found.height_m[0]))
    depth_std, height_std = np.std(drawn, axis=0)
    assert stated.depth_std_m[row] == pytest.approx(depth_std, rel=0.12)
    assert stated.height_std_m[row] == pytest.approx(height_std, rel=0.12)
    assert stated.height_common_std_m[row] < stated.height_std_m[row]
