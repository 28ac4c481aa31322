"""Focal length and pose from walkers, on simulated cameras whose lens is kept from the fit."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize._numdiff import approx_derivative

from bench.walkers import HEIGHT_PX, WIDTH_PX, Scene, scene, score, without_lens
from pipeline.calibrate.walkers import focal_length as focal
from pipeline.calibrate.walkers.focal_length import calibrate_lens_from_walkers, focal_px, scaled
from pipeline.calibrate.walkers.known_lengths import NOTHING_KNOWN, scale_of
from pipeline.calibrate.walkers.model import Sample, Scale
from pipeline.calibrate.walkers.pace import Pace, pace_of
from pipeline.calibrate.walkers.pose import best_fit
from pipeline.calibrate.walkers.sample import chosen_tracks, sample_of
from pipeline.calibrate.walkers.segments import Segments
from pipeline.calibrate.walkers.upright_edges import NO_UPRIGHTS
from pipeline.core.config import ADULT, Config
from pipeline.core.errors import CalibrationUndetermined
from pipeline.core.records import GroundPlane, KnownLength
from pipeline.estimate.boxes.geometry import Geometry
from pipeline.estimate.methods import ground

SIZE_PX = (WIDTH_PX, HEIGHT_PX)


@pytest.mark.slow
def test_focal_lengths_depths_and_intervals_over_cameras() -> None:
    random, scores, z = np.random.default_rng(1004), [], []
    for _ in range(4):
        simulated = scene(random, 60)
        with suppress(CalibrationUndetermined):
            seen, plane, _, focal_z = without_lens(simulated)
            z.append(focal_z)
            scores.append(score(seen, plane))
    assert len(scores) >= 2
    assert np.median([s.depth_relative for s in scores]) < 0.15
    assert np.median([s.height_mae_m for s in scores]) < 0.09
    assert np.abs(z).max() < 3.0
    assert np.sqrt(np.mean(np.square(z))) < 1.5
    depth_z = np.concatenate([s.depth_z for s in scores])
    # One camera of those, all of whose depths go together, may be outside.
    assert np.nanmean(np.abs(depth_z) < 1.96) > 0.6


def test_people_at_one_distance_do_not_fix_a_focal_length() -> None:
    simulated = scene(np.random.default_rng(2), 12)
    measured, depth_m = replace(simulated.measured, intrinsics=None), simulated.true_depth_m
    near = np.abs(depth_m / np.median(depth_m) - 1) < 0.25
    with pytest.raises(CalibrationUndetermined, match=r"focal length|people"):
        calibrate_lens_from_walkers(measured.take(near), SIZE_PX, ADULT)


def test_nobody_is_refused_with_what_to_do() -> None:
    simulated = scene(np.random.default_rng(2), 12)
    few = simulated.measured.take(simulated.measured.track_id < 2)
    with pytest.raises(CalibrationUndetermined, match="2 people"):
        calibrate_lens_from_walkers(few, SIZE_PX, ADULT)


def posed(seed: int) -> tuple[Scene, Sample, Scale]:
    simulated = scene(np.random.default_rng(seed), 8, bad_share=0.0)
    measured, people = chosen_tracks(simulated.measured, ADULT, NOTHING_KNOWN)
    sample = sample_of(measured, ADULT, people)
    return simulated, sample, scale_of(sample, ADULT, NOTHING_KNOWN, measured, NO_UPRIGHTS)


def test_another_focal_length_only_scales_the_points() -> None:
    simulated, sample, scale = posed(3)
    lens = simulated.measured.intrinsics
    assert lens is not None
    longer = replace(lens, fx_px=lens.fx_px * 1.3, fy_px=lens.fy_px * 1.3)
    again = sample_of(replace(simulated.measured, intrinsics=longer), ADULT, sample.track_id)
    known = (KnownLength((200.0, 600.0, 210.0, 400.0), 2.0, upright=True),)
    scale = replace(scale, segments=Segments.of(known, lens))
    by_scale, lengths = scaled(sample, scale, np.log(1.3))
    of_longer = Segments.of(known, longer).points
    np.testing.assert_allclose(lengths.segments.points, of_longer, rtol=1e-9)
    np.testing.assert_allclose(by_scale.foot, again.foot, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(by_scale.head, again.head, rtol=1e-9, atol=1e-12)


def test_the_jacobian_is_that_of_the_residuals() -> None:
    _, sample, scale = posed(4)
    pace = pace_of(sample, None)
    assert len(pace)
    x = np.append(best_fit(sample, scale).x, 0.1)
    exact = focal._jacobian(x, sample, scale, pace, 0.3).toarray()
    args = (sample, scale, pace, 0.3)
    differences = approx_derivative(focal._residuals, x, method="3-point", args=args)
    of_pose = [i for i in range(len(x)) if i not in range(7, len(x) - 1)]
    np.testing.assert_allclose(
        exact[:, of_pose], differences[:, of_pose], rtol=1e-3, atol=1e-3 * np.abs(exact).max() / 100
    )


def test_speeds_are_most_alike_by_the_true_focal_length() -> None:
    wrong = []
    for seed in range(5):
        simulated, sample, scale = posed(seed)
        pace = Pace(np.arange(sample.people), np.full(sample.people, 0.22))
        truth = simulated.plane
        pose = [np.log(truth.camera_height_m), truth.tilt_rad, truth.roll_rad]
        x = np.array([*pose, 0, 0, 0, 0, *scale.mean_m, 0.0])

        def spread(
            q: float,
            x: np.ndarray = x,
            pace: Pace = pace,
            sample: Sample = sample,
            scale: Scale = scale,
        ) -> float:
            # With the pose that keeps all depths over the focal length as they are.
            c, s = np.cos(x[1]), np.sin(x[1])
            moved = x.copy()
            moved[0] -= c**2 * q
            moved[1] -= s * c * q
            return float(np.square(pace.off(moved, scaled(sample, scale, q)[0])).sum())

        wrong.append([spread(-0.4) - spread(0.0), spread(0.4) - spread(0.0)])
    assert (np.sum(wrong, axis=0) > 2.0).all()


def test_the_starts_are_fields_of_view() -> None:
    assert focal_px(np.deg2rad(90.0), 1000) == pytest.approx(500.0)


def test_a_focal_lengths_error_is_carried_to_depth_and_height() -> None:
    simulated = scene(np.random.default_rng(6), 6, bad_share=0.0)
    lens = simulated.measured.intrinsics
    assert lens is not None
    truth = simulated.plane
    root = np.array(
        [[0.05, 0, 0, 0], [0.002, 0.002, 0, 0], [0, 0, 0.003, 0], [-0.004, 0.006, 0, 0.01]]
    )
    covariance = root @ root.T
    plane = GroundPlane(
        truth.camera_height_m,
        truth.tilt_rad,
        truth.roll_rad,
        covariance[:3, :3],
        "walkers",
        covariance[3],
    )
    none = np.zeros_like(simulated.measured.std_xyxy_px)
    measured = replace(simulated.measured, std_xyxy_px=none)
    stated = ground.estimate(Geometry.of(replace(measured, ground_plane=plane)), Config())
    random, depths, heights = np.random.default_rng(0), [], []
    for draw in random.normal(size=(400, 4)) @ root.T:
        at = replace(lens, fx_px=lens.fx_px * np.exp(draw[3]), fy_px=lens.fy_px * np.exp(draw[3]))
        moved = GroundPlane(
            truth.camera_height_m + draw[0], truth.tilt_rad + draw[1], truth.roll_rad + draw[2]
        )
        made = ground.estimate(
            Geometry.of(replace(measured, intrinsics=at, ground_plane=moved)), Config()
        )
        depths.append(made.depth_m)
        heights.append(made.height_m)
    depth_ratio = np.std(depths, axis=0) / stated.depth_std_m
    height_ratio = np.std(heights, axis=0) / stated.height_std_m
    assert np.median(depth_ratio) == pytest.approx(1.0, abs=0.1)
    assert np.median(height_ratio) == pytest.approx(1.0, abs=0.1)
