"""Heights that few people have are doubtful, by an amount that makes their intervals correct."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.core.config import ADULT, Config
from pipeline.core.records import GroundPlane
from pipeline.estimate.boxes.geometry import Geometry
from pipeline.estimate.boxes.scatter import Scatter
from pipeline.estimate.fusion.fused import beside_track
from pipeline.estimate.fusion.one_person import BAD_STD_M, doubtful_m, with_doubt
from pipeline.estimate.methods import ground
from tests.estimate.scenes import measured, people

PLANE = GroundPlane(6.0, 0.25, 0.0, np.zeros((3, 3)))


def test_intervals_of_a_mixture_of_good_and_bad_tracks_hold_the_truth() -> None:
    """By simulation: statures of Student's t, one height in eight off by 0.3 m."""
    random = np.random.default_rng(1)
    n, bad_share, std_m = 40_000, 0.12, 0.03
    true_m = ADULT.std_m * random.standard_t(4, n)
    bad = random.uniform(size=n) < bad_share
    error_m = random.normal(0, np.where(bad, np.hypot(BAD_STD_M, std_m), std_m))
    off_m = true_m + error_m
    doubt_m = doubtful_m(off_m, np.full(n, std_m), ADULT.std_m, np.full(n, bad_share))
    held = np.abs(error_m) < 1.96 * np.hypot(std_m, doubt_m)
    assert (np.abs(error_m) < 1.96 * std_m).mean() < 0.90
    assert held.mean() == pytest.approx(0.95, abs=0.015)
    # and not by making all of them wide
    usual = np.abs(off_m) < ADULT.std_m / 2
    assert np.median(doubt_m[usual]) < np.median(doubt_m[np.abs(off_m) > 3 * ADULT.std_m]) / 4


def test_where_nothing_can_be_bad_nothing_is_in_doubt() -> None:
    off_m = np.linspace(-1, 1, 9)
    doubt_m = doubtful_m(off_m, np.full(9, 0.03), ADULT.std_m, np.zeros(9))
    np.testing.assert_allclose(doubt_m, 0.0, atol=2e-3)


def walk(tall_m: float, class_name: str = "person") -> tuple:
    n = 60
    box = people(np.linspace(-2, 2, n), np.linspace(12, 20, n), np.full(n, tall_m), PLANE)
    box[:, 0] -= 12
    box[:, 2] += 12
    m = measured(
        box,
        ground_plane=PLANE,
        capture_time_ns=np.arange(n) * 100_000_000,
        std_xyxy_px=np.full((n, 4), 1.0),
        class_name=np.full(n, class_name, dtype=object),
    )
    geometry = replace(Geometry.of(m), scatter=Scatter(np.full(n, 2.0), np.full(n, 0.5)))
    seen = ground.estimate(geometry, Config())
    made = with_doubt(geometry, seen, beside_track(geometry, seen), [ADULT])
    return made, made.height_std_m / seen.height_std_m, made.depth_std_m / seen.depth_std_m


def test_half_a_person_is_wide_in_height_and_depth_and_nothing_else_changes() -> None:
    half, taller, farther = walk(1.0)
    assert (taller > 3).all()
    assert (farther > 3).all()
    assert (half.height_doubt_m > 0.1).all()
    np.testing.assert_allclose(half.height_m, 1.0, atol=0.01)
    _, taller, farther = walk(ADULT.walking_mean_m)
    assert (taller < 1.3).all()
    assert (farther < 1.3).all()


def test_what_has_no_prior_is_as_tall_as_it_is() -> None:
    van, taller, _ = walk(2.6, "van")
    np.testing.assert_allclose(taller, 1.0)
    np.testing.assert_allclose(van.height_doubt_m, 0.0)
