"""The pose from people who walk, on simulated cameras whose truth is known."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace

import numpy as np
import pytest

from bench.walkers import Scene, scene, score
from pipeline.calibrate.walkers.known_lengths import KnownHeight, KnownLengths
from pipeline.calibrate.walkers.pose import MIN_PEOPLE, calibrate_from_walkers
from pipeline.core.arrays import FloatArray
from pipeline.core.config import ADULT, POPULATION_MEAN_STD_M
from pipeline.core.errors import CalibrationUndetermined, UsageError
from pipeline.core.records import GroundPlane, KnownLength
from pipeline.estimate.boxes.geometry import Geometry
from pipeline.optics.ground_plane import depth_jacobian, foot_depth_m, project_person


@pytest.mark.slow
def test_depths_heights_and_intervals_over_many_cameras() -> None:
    random, scores = np.random.default_rng(7), []
    for _ in range(30):
        simulated = scene(random, 15)
        try:
            plane, report = calibrate_from_walkers(simulated.measured, ADULT)
        except CalibrationUndetermined:
            continue  # a steep, narrow view of people at one distance
        assert MIN_PEOPLE <= report.people <= 15
        scores.append(score(simulated, plane))
    assert len(scores) >= 27
    # A crowd of any country is as a prior of 3.3 % says: two thirds of that in the median.
    assert np.median([s.depth_relative for s in scores]) < 0.04
    assert np.median([s.height_mae_m for s in scores]) < 0.07
    # A camera's errors go together: of 30 that hold in 95 %, three deviations lower is 83 %.
    for part in ("depth_z", "height_z", "pose_z"):
        z = np.concatenate([getattr(s, part) for s in scores])
        assert np.mean(np.abs(z[np.isfinite(z)]) < 1.96) > 0.83


def test_groups_and_fragments_do_not_decide() -> None:
    random = np.random.default_rng(3)
    errors = []
    for _ in range(6):
        simulated = scene(random, 20, bad_share=0.3)
        with suppress(CalibrationUndetermined):
            plane, _ = calibrate_from_walkers(simulated.measured, ADULT)
            errors.append(plane.camera_height_m / simulated.plane.camera_height_m - 1)
    assert len(errors) >= 5
    assert np.median(np.abs(errors)) < 0.09  # of a scale that is known to 3.3 %


def test_choosing_from_a_few_tracks_at_a_time_changes_nothing(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    simulated = scene(np.random.default_rng(5), 10)
    at_once, _ = calibrate_from_walkers(simulated.measured, ADULT)
    monkeypatch.setattr("pipeline.calibrate.walkers.sample.ROWS_AT_ONCE", 100)
    in_turns, report = calibrate_from_walkers(simulated.measured, ADULT)
    assert report.observations > 100  # so there were turns
    assert in_turns.camera_height_m == pytest.approx(at_once.camera_height_m, rel=1e-6)
    assert in_turns.tilt_rad == pytest.approx(at_once.tilt_rad, rel=1e-6)
    np.testing.assert_allclose(in_turns.covariance, at_once.covariance, rtol=1e-4, atol=1e-12)


def test_a_population_of_another_stature_scales_the_scene() -> None:
    simulated = scene(np.random.default_rng(5), 15)
    usual, _ = calibrate_from_walkers(simulated.measured, ADULT)
    taller = replace(ADULT, mean_m=1.1 * ADULT.mean_m, std_m=1.1 * ADULT.std_m)
    other, _ = calibrate_from_walkers(simulated.measured, taller)
    assert other.camera_height_m == pytest.approx(1.1 * usual.camera_height_m, rel=0.01)
    assert other.tilt_rad == pytest.approx(usual.tilt_rad, abs=0.003)


def scale_errors(known_of: Callable[[Scene], KnownLengths]) -> tuple[FloatArray, FloatArray]:
    """Return errors of the scale and their standard errors, both relative, of some cameras.

    The scale is that of the depths where people walk; the height of the camera also depends on how
    well the tilt is known. The population is believed to be a fifth shorter than it is.
    """
    wrong = replace(ADULT, mean_m=0.8 * ADULT.mean_m)
    found = []
    for seed in (11, 12, 13, 14):
        simulated = scene(np.random.default_rng(seed), 15, bad_share=0.0)
        plane, _ = calibrate_from_walkers(simulated.measured, wrong, known_of(simulated))
        foot, depth_m = _feet(simulated, plane)
        _, true_depth_m = _feet(simulated, simulated.plane)
        by = depth_jacobian(plane.camera_height_m, plane.tilt_rad, *foot.T)[:3]
        slopes = np.stack(by) / depth_m
        relative = np.sqrt(np.einsum("in,ij,jn->n", slopes, plane.covariance, slopes))
        off = np.nanmedian(np.log(depth_m / true_depth_m))
        found.append((off, np.nanmedian(relative)))
    errors, std = np.array(found).T
    return errors, std


def _feet(simulated: Scene, plane: GroundPlane) -> tuple[FloatArray, FloatArray]:
    foot = Geometry.of(replace(simulated.measured, ground_plane=plane)).foot
    return foot, foot_depth_m(plane.camera_height_m, plane.tilt_rad, foot[:, 1])


def test_the_population_alone_leaves_the_scale_unsure() -> None:
    error, std = scale_errors(lambda simulated: KnownLengths())
    assert (np.abs(error) > 0.1).all()
    assert np.median(std) > POPULATION_MEAN_STD_M / ADULT.mean_m


def test_a_known_height_overrides_the_population() -> None:
    """Known to 1 cm, of two people, whose walk takes off 3 +- 1.7 cm, in boxes that are 1 % off."""

    def of_two(simulated: Scene) -> KnownLengths:
        return KnownLengths(
            heights=tuple(KnownHeight(i, float(simulated.true_height_m[i])) for i in (2, 7))
        )

    error, std = scale_errors(of_two)
    assert (np.abs(error) < 3 * std).all()
    assert np.median(std) < 0.025
    assert std.max() < 0.03


@pytest.mark.parametrize("upright", [False, True])
def test_a_known_length_of_the_place_is_the_scale(upright: bool) -> None:
    """Of 1 m to 5 mm, and to 0.2 px where somebody marked its ends: two points apart, or a post."""

    ends_m = [(0.0, 0.0), (0.0, 1.0)] if upright else [(-0.5, 0.0), (0.5, 0.0)]

    def known(simulated: Scene) -> KnownLengths:
        points_px = _marks(simulated, ends_m)
        return KnownLengths(lengths=(KnownLength(points_px, 1.0, 0.005, 0.2, upright),))

    error, std = scale_errors(known)
    assert (np.abs(error) < 3 * std).all()
    # A post is far from most who walk: how its height reaches them follows from the tilt too.
    assert std.max() < (0.025 if upright else 0.012)


def test_known_lengths_outweigh_a_population_that_is_another() -> None:
    """A post measured to 5 mm among children: they stay children, and that is told."""
    simulated = scene(np.random.default_rng(12), 20, bad_share=0.0)
    points_px = _marks(simulated, [(0.0, 0.0), (0.0, 1.0)])
    known = KnownLengths(lengths=(KnownLength(points_px, 1.0, 0.005, 0.2, True),))
    taller = replace(ADULT, mean_m=1.25 * ADULT.mean_m)  # so that all here seem a fifth too small
    plane, report = calibrate_from_walkers(simulated.measured, taller, known)
    assert plane.camera_height_m == pytest.approx(simulated.plane.camera_height_m, rel=0.025)
    assert report.mean_ratio == pytest.approx(1 / 1.25, rel=0.05)


def _marks(simulated: Scene, points_m: list[tuple[float, float]]) -> tuple[float, ...]:
    """Return the pixels of points (right, up) in metres, as near as they are in the picture."""
    truth, lens = simulated.plane, simulated.measured.intrinsics
    assert lens is not None
    right_m, up_m = np.array(points_m).T
    pose = (truth.camera_height_m, truth.tilt_rad, truth.roll_rad)
    for ahead_m in np.arange(3.0, 60.0, 0.5):
        _, point = project_person(right_m, np.full(2, ahead_m), up_m, *pose)
        points_px = point * lens.fx_px + [lens.cx_px, lens.cy_px]
        if ((points_px > 20) & (points_px < [lens.width_px - 20, lens.height_px - 20])).all():
            return tuple(points_px.ravel().tolist())
    raise AssertionError("no place where both are in view")


@pytest.mark.parametrize(
    "known",
    [
        KnownLengths(heights=(KnownHeight(999, 1.8),)),
        KnownLengths(heights=(KnownHeight(0, 18.0),)),
        KnownLengths(lengths=(KnownLength((10.0, 10.0, 90.0, 10.0), -1.0),)),
        KnownLengths(lengths=(KnownLength((10.0, 10.0, 10.0, 10.0), 1.0),)),
        KnownLengths(lengths=(KnownLength((10.0, 10.0, 90.0, 10.0), np.inf),)),
        KnownLengths(lengths=(KnownLength((10.0, 10.0, 1e9, 10.0), 2.0),)),
        KnownLengths(lengths=(KnownLength((90.0, 10.0, 90.0, 60.0), 2.0, upright=True),)),
    ],
)
def test_what_cannot_be_known_is_refused(known: KnownLengths) -> None:
    with pytest.raises(UsageError):
        calibrate_from_walkers(scene(np.random.default_rng(8), 8).measured, ADULT, known)


def test_more_people_make_it_surer_down_to_what_the_population_leaves_open() -> None:
    simulated = scene(np.random.default_rng(6), 40, bad_share=0.0)
    few = simulated.measured.track_id < 8
    small, _ = calibrate_from_walkers(simulated.measured.take(few), ADULT)
    large, _ = calibrate_from_walkers(simulated.measured, ADULT)
    relative = [np.sqrt(p.covariance[0, 0]) / p.camera_height_m for p in (small, large)]
    assert relative[1] < relative[0]
    assert relative[1] > POPULATION_MEAN_STD_M / ADULT.mean_m * 0.99


def test_who_knows_the_mean_stature_of_the_place_gets_a_surer_scale() -> None:
    simulated = scene(np.random.default_rng(6), 40, bad_share=0.0)
    priors = (
        ADULT,
        replace(ADULT, mean_std_m=0.01),
        replace(ADULT, mean_std_m=np.nan, object_count=100),
    )
    anywhere, stated, sampled = (
        np.sqrt(plane.covariance[0, 0]) / plane.camera_height_m
        for plane, _ in (calibrate_from_walkers(simulated.measured, p) for p in priors)
    )
    assert stated < sampled * 1.05 < anywhere


def test_too_few_people_are_refused_with_a_reason() -> None:
    simulated = scene(np.random.default_rng(8), 12)
    rows = simulated.measured.track_id < MIN_PEOPLE - 1
    with pytest.raises(CalibrationUndetermined, match="are needed"):
        calibrate_from_walkers(simulated.measured.take(rows), ADULT)


@pytest.mark.parametrize("change", ["no intrinsics", "all cut", "all hidden", "no people"])
def test_what_cannot_be_used_is_not(change: str) -> None:
    measured = scene(np.random.default_rng(9), 8).measured
    count = len(measured)
    changed = {
        "no intrinsics": {"intrinsics": None},
        "all cut": {"truncated": np.ones((count, 4), bool)},
        "all hidden": {"occlusion": np.full(count, 0.5)},
        "no people": {"class_name": np.full(count, "car", dtype=object)},
    }[change]
    with pytest.raises(CalibrationUndetermined, match="0 people"):
        calibrate_from_walkers(replace(measured, **changed), ADULT)


def test_people_at_one_spot_do_not_fix_a_pose() -> None:
    """Everybody at one distance: many poses fit, so none is given."""
    simulated = scene(np.random.default_rng(10), 10, bad_share=0.0)
    m = simulated.measured
    tall = np.median(m.bbox_xyxy_px[:, 3] - m.bbox_xyxy_px[:, 1])
    box = np.tile([600.0, 400.0 - tall, 640.0, 400.0], (len(m), 1))
    box += np.random.default_rng(0).normal(0, 1, box.shape)
    with pytest.raises(CalibrationUndetermined, match="do not determine"):
        calibrate_from_walkers(replace(m, bbox_xyxy_px=box), ADULT)


def test_of_many_people_some_are_enough(monkeypatch: pytest.MonkeyPatch) -> None:
    """The pose from a part of the people, spread over time, is that of all within its interval."""
    measured = scene(np.random.default_rng(4), 30).measured
    everybody, report = calibrate_from_walkers(measured, ADULT)
    monkeypatch.setattr("pipeline.calibrate.walkers.sample.MAX_PEOPLE", 12)
    some, fewer = calibrate_from_walkers(measured, ADULT)
    assert fewer.people <= 12 < report.people
    std_m = np.sqrt(everybody.covariance[0, 0] + some.covariance[0, 0])
    assert abs(some.camera_height_m - everybody.camera_height_m) < 3 * std_m
