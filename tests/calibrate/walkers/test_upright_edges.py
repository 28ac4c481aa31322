"""Vertical edges among others, projected from a place whose camera is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bench.walkers import scene
from pipeline.calibrate.walkers.pose import calibrate_from_walkers
from pipeline.calibrate.walkers.upright_edges import NO_UPRIGHTS, find_uprights
from pipeline.core.arrays import FloatArray
from pipeline.core.config import ADULT
from pipeline.core.records import GroundPlane, Intrinsics
from pipeline.estimate.boxes.ends import camera_of
from pipeline.optics.ground_plane import (
    foot_depth_m,
    ground_position_m,
    project_person,
    remove_roll,
)

LENS = Intrinsics(1280, 720, 1300.0, 1300.0, 639.5, 359.5)


def posts(
    plane: GroundPlane, count: int, lens: Intrinsics = LENS, lean_deg: float = 0.3, seed: int = 0
) -> FloatArray:
    """Return the edges of posts of 1-4 m that stand about, leaning by little, inside the picture."""
    random, found = np.random.default_rng(seed), []
    for _ in range(4000):
        if len(found) == count:
            break
        pixel = random.uniform([0.0, 0.3 * lens.height_px], [lens.width_px, lens.height_px])
        x, y = remove_roll(camera_of(lens).normalize(pixel), plane.roll_rad)
        depth_m = foot_depth_m(plane.camera_height_m, plane.tilt_rad, y)
        if not depth_m < 60:
            continue
        x_m, y_m = ground_position_m(depth_m, x, y, plane.tilt_rad)
        tall_m = random.uniform(1, 4)
        top_m = x_m + tall_m * np.tan(np.deg2rad(random.normal(0, lean_deg)))
        pose = (plane.camera_height_m, plane.tilt_rad, plane.roll_rad)
        low = project_person(x_m, y_m, tall_m, *pose)[0]
        high = project_person(top_m, y_m, tall_m, *pose)[1]
        ends = camera_of(lens).project(np.column_stack([[low, high], np.ones(2)]))
        inside = (ends > 0).all() and (ends < [lens.width_px, lens.height_px]).all()
        if inside and np.ptp(ends[:, 1]) > 30:
            found.append((ends + random.normal(0, 0.3, (2, 2))).ravel())
    return np.array(found)


def clutter(count: int, seed: int = 1) -> FloatArray:
    """Return edges of any place and direction."""
    random = np.random.default_rng(seed)
    middle = random.uniform([50, 50], [1230, 670], (count, 2))
    angle, long = random.uniform(0, np.pi, count), random.uniform(20, 60, count)
    half = np.stack([np.cos(angle), np.sin(angle)], axis=1) * long[:, None] / 2
    return np.hstack([middle - half, middle + half])


@pytest.mark.parametrize("roll_deg", [-6.0, 0.0, 3.0])
@pytest.mark.parametrize("tilt_deg", [8.0, 30.0])
def test_the_roll_is_found_among_edges_of_any_direction(roll_deg: float, tilt_deg: float) -> None:
    plane = GroundPlane(5.0, np.deg2rad(tilt_deg), np.deg2rad(roll_deg))
    edges = np.vstack([posts(plane, 12), clutter(60)])
    found = find_uprights(edges, LENS, plane.tilt_rad + np.deg2rad(1), np.deg2rad(1.5))
    assert len(found) >= 10
    assert np.rad2deg(found.roll_rad) == pytest.approx(roll_deg, abs=0.8)
    assert np.std(found.off(plane.tilt_rad, plane.roll_rad, 0.0)) < 1.5


def test_edges_of_any_direction_are_refused() -> None:
    refused = [
        find_uprights(clutter(80, seed), LENS, 0.3, 0.03) is NO_UPRIGHTS for seed in range(40)
    ]
    assert sum(refused) >= 38


def test_one_post_is_refused_however_sharp() -> None:
    plane = GroundPlane(5.0, 0.3, 0.02)
    post = posts(plane, 1)
    many = np.vstack([post + np.array([d, 0, d, 0]) for d in (0, 2, 4, 6, 8)])
    assert find_uprights(many, LENS, 0.3, 0.03) is NO_UPRIGHTS


def test_no_edges_are_none() -> None:
    assert find_uprights(np.empty((0, 4)), LENS, 0.3, 0.03) is NO_UPRIGHTS


def test_two_directions_that_are_as_good_are_refused() -> None:
    """A fence that leans beside a house: which of the two is upright cannot be told."""
    edges = [posts(GroundPlane(5.0, 0.3, np.deg2rad(r)), 8, seed=9) for r in (-5.0, 5.0)]
    assert find_uprights(np.vstack(edges), LENS, 0.3, 0.03) is NO_UPRIGHTS


def test_a_bent_picture_costs_certainty_of_the_tilt_and_not_its_truth() -> None:
    """Edges seen through a barrel that nothing tells of: the bend is found with the pose."""
    plane = GroundPlane(5.0, 0.35, np.deg2rad(3.0))
    lens = replace(LENS, distortion_model="plumb_bob", distortion=(-0.15, 0.0, 0.0, 0.0, 0.0))
    edges = posts(plane, 25, lens)
    found = find_uprights(edges, LENS, plane.tilt_rad, np.deg2rad(1.5))
    assert len(found) >= 15
    assert np.rad2deg(found.roll_rad) == pytest.approx(3.0, abs=1.0)


def test_upright_edges_make_the_roll_of_walkers_surer_and_truer() -> None:
    errors, stds = [], []
    for seed in range(30, 38):
        simulated = scene(np.random.default_rng(seed), 15, bad_share=0.0)
        if simulated.plane.tilt_rad > 0.45:
            continue  # a steep view shows little of a post
        edges = posts(simulated.plane, 12, simulated.measured.intrinsics or LENS)
        # shadows to the right: boxes are too tall there, by 3 in a hundred
        measured, box = simulated.measured, simulated.measured.bbox_xyxy_px.copy()
        right = (box[:, 0] + box[:, 2]) / LENS.width_px - 1
        box[:, 1] -= 0.03 * right * (box[:, 3] - box[:, 1])
        measured = replace(measured, bbox_xyxy_px=box)
        for lines_px in (None, edges):
            plane, report = calibrate_from_walkers(measured, ADULT, lines_px=lines_px)
            errors.append(abs(plane.roll_rad - simulated.plane.roll_rad))
            stds.append(np.sqrt(plane.covariance[2, 2]))
            assert (report.uprights >= 8) == (lines_px is not None)
    assert np.mean(errors[1::2]) < np.mean(errors[::2])
    assert np.mean(stds[1::2]) < np.mean(stds[::2])
    assert np.mean(np.array(errors[1::2]) < 2.5 * np.array(stds[1::2])) >= 0.8
