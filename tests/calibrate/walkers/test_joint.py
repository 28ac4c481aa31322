"""The joint covariance of pose and boxes: slopes, what cancels, and how true it is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bench.walkers import Scene, scene
from pipeline.calibrate.walkers.joint import factor_of, low_rank
from pipeline.calibrate.walkers.pose import fit_walkers
from pipeline.core.config import ADULT, Config
from pipeline.core.errors import CalibrationUndetermined
from pipeline.core.records import RANK, Error, GroundPlane, JointErrors
from pipeline.estimate.boxes.geometry import Geometry
from pipeline.estimate.boxes.joint_slopes import log_slopes
from pipeline.estimate.boxes.reach import with_reach
from pipeline.estimate.methods import ground
from pipeline.estimate.types import Measured

STEP = 1e-5


def nothing(near_log_m: float = np.log(12.0)) -> JointErrors:
    none = np.zeros((len(Error), 1))
    return JointErrors(none, none, none, np.zeros((len(Error), RANK)), near_log_m, 0.1, 0.4)


@pytest.fixture(scope="module")
def simulated() -> Scene:
    return scene(np.random.default_rng(11), 20, bad_share=0.0)


def lengths(m: Measured, plane: GroundPlane) -> tuple[np.ndarray, np.ndarray]:
    found = ground.estimate(Geometry.of(replace(m, ground_plane=plane)), Config())
    return np.log(found.depth_m), np.log(found.height_m)


def off(error: Error, m: Measured, plane: GroundPlane, by: float) -> tuple[Measured, GroundPlane]:
    """Return boxes and pose with one error put in, by the pixels and not by any derivative."""
    joint, lens, box = nothing(), m.intrinsics, m.bbox_xyxy_px.copy()
    assert lens is not None
    fx_px = lens.fx_px
    tall_px = box[:, 3] - box[:, 1]
    near = joint.near_log_m - lengths(m, plane)[0]
    column = Geometry.of(replace(m, ground_plane=plane)).foot[:, 0]
    right = (column - joint.right_mean) / joint.right_std
    match error:
        case Error.LOG_HEIGHT:
            return m, replace(plane, camera_height_m=plane.camera_height_m * np.exp(by))
        case Error.TILT:
            return m, replace(plane, tilt_rad=plane.tilt_rad + by)
        case Error.ALL:
            box[:, 1] -= by * tall_px
        case Error.SIDE:
            box[:, 1] -= by * tall_px * right
        case Error.NEAR_HEAD:
            box[:, 1] -= by * tall_px * near
        case Error.NEAR_FOOT:
            box[:, 3] += by * tall_px * near
        case Error.LOG_FOCAL:
            lens = replace(lens, fx_px=fx_px * np.exp(by), fy_px=lens.fy_px * np.exp(by))
    return replace(m, bbox_xyxy_px=box, intrinsics=lens), plane


@pytest.mark.parametrize(
    "error",
    [e for e in Error if e not in (Error.ROLL, Error.REACH, Error.BEND)],
)
def test_slopes_are_what_an_error_of_boxes_or_pose_does(simulated: Scene, error: Error) -> None:
    """Without roll and outlines, so that an end of a box is where it is drawn."""
    plane = replace(simulated.plane, roll_rad=0.0)
    m = simulated.measured
    found = log_slopes(Geometry.of(replace(m, ground_plane=plane)), nothing())
    high, low = (lengths(*off(error, m, plane, by)) for by in (STEP, -STEP))
    for slopes, one, other in zip(found, high, low, strict=True):
        by_difference = (one - other) / (2 * STEP)
        known = np.isfinite(by_difference)
        assert known.mean() > 0.9
        # Ends lean outwards by some of the box's height, which moves columns and no rows.
        np.testing.assert_allclose(
            slopes[known, error],
            by_difference[known],
            rtol=2e-2,
            atol=5e-3 * (1 + abs(slopes).max()),
        )


def test_boxes_that_are_all_too_tall_shrink_the_scene_and_leave_heights_alone(
    simulated: Scene,
) -> None:
    plane, _ = fit_walkers(simulated.measured, ADULT).result()
    assert plane.joint is not None
    joint, m = plane.joint, replace(simulated.measured, ground_plane=plane)
    depth, height = log_slopes(with_reach(m), joint)
    known = np.isfinite(height).all(axis=1) & np.isfinite(depth).all(axis=1)
    # As if pose and boxes erred independently, the same bias would be in every height.
    alone = np.abs(height[known, Error.ALL]) * 0.01
    both = np.sqrt(joint.variance_of(height[known], joint.boxes))
    assert np.median(both) < 0.5 * np.median(alone)
    assert np.median(np.sqrt(joint.variance_of(depth[known], joint.boxes))) > 0.008


def test_the_scale_of_the_population_is_in_every_length_alike(simulated: Scene) -> None:
    plane, _ = fit_walkers(simulated.measured, ADULT).result()
    assert plane.joint is not None
    m = replace(simulated.measured, ground_plane=plane)
    depth, height = log_slopes(with_reach(m), plane.joint)
    relative = ADULT.mean_uncertainty_m / ADULT.mean_m
    for slopes in (depth, height):
        by_scale = np.abs(slopes[np.isfinite(slopes).all(axis=1)] @ plane.joint.scale)[:, 0]
        assert np.median(by_scale) == pytest.approx(relative, rel=0.15)


def test_six_columns_hold_what_heights_have_in_common(simulated: Scene) -> None:
    plane, _ = fit_walkers(simulated.measured, ADULT).result()
    assert plane.joint is not None
    assert plane.joint.low_rank.shape == (len(Error), RANK)
    m = replace(simulated.measured, ground_plane=plane)
    _, height = log_slopes(with_reach(m), plane.joint)
    height = height[np.isfinite(height).all(axis=1)]
    whole = plane.joint.variance(height)
    few = plane.joint.variance_of(height, plane.joint.low_rank)
    assert np.median(few / whole) > 0.98


def test_low_rank_is_exact_where_rank_suffices() -> None:
    random = np.random.default_rng(0)
    rest = random.normal(size=(len(Error), 4))
    slopes = random.normal(size=(30, len(Error)))
    found = low_rank(np.zeros((len(Error), 1)), rest, slopes)
    np.testing.assert_allclose(
        slopes @ found @ found.T @ slopes.T, slopes @ rest @ rest.T @ slopes.T
    )


def test_a_factor_squared_is_its_covariance() -> None:
    half = np.random.default_rng(1).normal(size=(5, 3))
    covariance = half @ half.T
    factor = factor_of(covariance)
    np.testing.assert_allclose(factor @ factor.T, covariance, atol=1e-12)


@pytest.mark.slow
def test_differences_of_heights_are_as_sure_as_the_joint_covariance_says() -> None:
    """Poses and people drawn anew: the error of a difference beside the deviation that slopes give."""
    random = np.random.default_rng(5)
    z = []
    for _ in range(8):
        one = scene(random, 15, bad_share=0.0)
        try:
            plane, _ = fit_walkers(one.measured, ADULT).result()
        except CalibrationUndetermined:
            continue
        assert plane.joint is not None
        geometry = with_reach(replace(one.measured, ground_plane=plane))
        tall = ground.estimate(geometry, Config()).height_m
        _, slopes = log_slopes(geometry, plane.joint)
        ids = np.unique(one.measured.track_id)
        mine = [one.measured.track_id == i for i in ids]
        found = np.array([np.nanmedian(tall[rows]) for rows in mine])
        loads = np.array([np.nanmedian(slopes[rows], axis=0) for rows in mine])
        loads = found[:, None] * (loads @ plane.joint.low_rank)
        a, b = np.triu_indices(len(ids), 1)
        error = (found[a] - found[b]) - (one.true_height_m[ids[a]] - one.true_height_m[ids[b]])
        own_m = 0.012  # of gaits and noise of a pixel, of each
        std = np.sqrt(((loads[a] - loads[b]) ** 2).sum(axis=1) + 2 * own_m**2)
        z.append(error / std)
    inside = np.mean(np.abs(np.concatenate(z)) < 1.96)
    assert 0.88 < inside < 0.995
