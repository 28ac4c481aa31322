"""A height that is known of a person, brought into a pose afterwards."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bench.walkers import scene
from pipeline.calibrate.walkers.known_lengths import KnownHeight
from pipeline.calibrate.walkers.known_people import _after, conditioned
from pipeline.calibrate.walkers.pose import fit_walkers
from pipeline.core.config import ADULT


def test_the_factor_after_an_observation_is_that_of_the_conditioned_normal() -> None:
    random = np.random.default_rng(1)
    factor, slope = random.normal(size=(10, 6)), random.normal(size=10)
    covariance = factor @ factor.T
    variance = float(slope @ covariance @ slope) + 0.3
    gain = covariance @ slope / variance
    found = _after(factor, slope, variance)
    np.testing.assert_allclose(found @ found.T, covariance - np.outer(gain, covariance @ slope))


def test_a_known_height_brings_scale_and_narrows_it() -> None:
    simulated = scene(np.random.default_rng(11), 20, bad_share=0.0)
    prior = replace(ADULT, mean_m=1.1 * ADULT.mean_m)  # everybody taken for a tenth too tall
    fitted = fit_walkers(simulated.measured, prior)
    before, _ = fitted.result()
    track = int(fitted.sample.track_id[3])
    person = KnownHeight(track, float(simulated.true_height_m[track]))
    after = conditioned(before, simulated.measured, person)
    true_m = simulated.plane.camera_height_m
    assert abs(after.camera_height_m / true_m - 1) < abs(before.camera_height_m / true_m - 1) / 2
    assert after.covariance[0, 0] < before.covariance[0, 0]
    assert after.joint is not None
    assert before.joint is not None
    assert after.joint.covariance[0, 0] == pytest.approx(
        after.covariance[0, 0] / after.camera_height_m**2
    )
