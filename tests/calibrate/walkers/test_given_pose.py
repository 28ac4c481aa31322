"""A given pose and the people under it: what is unsure becomes surer, what is exact stays."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from bench.walkers import Scene, scene
from pipeline.calibrate.walkers.given_pose import narrowed_by_people
from pipeline.calibrate.walkers.pose_prior import LEAST_STD, PosePrior
from pipeline.core.arrays import FloatArray
from pipeline.core.config import ADULT, CameraConfig
from pipeline.core.records import GroundPlane

STD = np.array([0.2, np.deg2rad(1.0), np.deg2rad(0.5)])
CAMERA = CameraConfig("simulated")


def pose(plane: GroundPlane) -> FloatArray:
    return np.array([plane.camera_height_m, plane.tilt_rad, plane.roll_rad])


def moved(plane: GroundPlane, by: FloatArray, std: FloatArray = STD) -> GroundPlane:
    height_m, tilt, roll = pose(plane) + by
    return GroundPlane(height_m, tilt, roll, np.diag(std**2))


@pytest.fixture(scope="module")
def scenes() -> list[Scene]:
    random = np.random.default_rng(91)
    return [scene(random, 12, bad_share=0.0) for _ in range(8)]


def test_the_squares_of_its_residuals_are_the_exponent_of_the_normal_density() -> None:
    root = np.random.default_rng(1).normal(size=(3, 3)) * 0.1
    plane = GroundPlane(4.0, 0.3, 0.02, root @ root.T)
    to_log = np.diag([1 / 4.0, 1.0, 1.0])
    covariance = to_log @ plane.covariance @ to_log + np.diag(LEAST_STD**2)
    normal = multivariate_normal([np.log(4.0), 0.3, 0.02], covariance)
    at = np.array([np.log(4.2), 0.35, 0.0])
    squares = float((PosePrior.of(plane).off(at) ** 2).sum())
    assert squares == pytest.approx(2 * (normal.logpdf(normal.mean) - normal.logpdf(at)))


def test_people_bring_a_given_pose_nearer_to_the_truth_and_say_how_near(
    scenes: list[Scene],
) -> None:
    random, before, after, z = np.random.default_rng(3), [], [], []
    for simulated in scenes:
        off = random.normal(size=3) * STD
        found, told = narrowed_by_people(
            moved(simulated.plane, off), simulated.measured, CAMERA, ADULT
        )
        assert told is not None
        assert told.code == "given_pose_narrowed"
        assert found.source == "given"
        std = np.sqrt(np.diag(found.covariance))
        # In no direction is it less sure than before.
        assert np.linalg.eigvalsh((np.diag(STD**2) - found.covariance) / np.outer(STD, STD))[0] > 0
        before.append(off / STD)
        after.append((pose(found) - pose(simulated.plane)) / STD)
        z.append((pose(found) - pose(simulated.plane)) / std)
    tilt_before, tilt_after = np.abs(before)[:, 1], np.abs(after)[:, 1]
    assert np.median(tilt_after) < 0.8 * np.median(tilt_before)
    assert np.sqrt(np.mean(np.square(z))) < 1.5


def test_what_is_exact_or_was_found_from_people_stays(scenes: list[Scene]) -> None:
    simulated = scenes[0]
    exact = replace(simulated.plane, covariance=np.zeros((3, 3)))
    assert narrowed_by_people(exact, simulated.measured, CAMERA, ADULT) == (exact, None)
    unsure = moved(simulated.plane, STD)
    found_before = replace(CAMERA, pose_correlation=(0.5, 0.0, 0.0))
    assert narrowed_by_people(unsure, simulated.measured, found_before, ADULT) == (unsure, None)
    few = simulated.measured.take(simulated.measured.track_id < 2)
    assert narrowed_by_people(unsure, few, CAMERA, ADULT) == (unsure, None)


def test_a_pose_that_people_contradict_is_told_and_kept(scenes: list[Scene]) -> None:
    simulated = scenes[0]
    wrong = moved(simulated.plane, np.array([0.0, np.deg2rad(4.0), 0.0]), STD / 4)
    kept, told = narrowed_by_people(wrong, simulated.measured, CAMERA, ADULT)
    assert kept is wrong
    assert told is not None
    assert told.code == "given_pose_contradicted"
