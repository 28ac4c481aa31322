"""The Jacobian of the fit to walkers, beside differences of its residuals."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize._numdiff import approx_derivative

from pipeline.calibrate.walkers.model import (
    ABOVE,
    MEAN,
    PEOPLE,
    Sample,
    Scale,
    jacobian,
    residuals,
)
from pipeline.calibrate.walkers.pose_prior import PosePrior
from pipeline.calibrate.walkers.segments import Segments
from pipeline.calibrate.walkers.upright_edges import NO_UPRIGHTS, Uprights
from pipeline.core.records import GroundPlane

PEOPLE_SEEN, EACH = 5, 7


def _sample(random: np.random.Generator) -> Sample:
    count = PEOPLE_SEEN * EACH
    foot = np.column_stack([random.uniform(-0.6, 0.6, count), random.uniform(0.0, 0.4, count)])
    head = foot - np.column_stack(
        [random.uniform(-0.02, 0.02, count), random.uniform(0.1, 0.3, count)]
    )
    return Sample(
        foot,
        head,
        random.uniform(0.02, 0.2, count),
        random.normal(size=(count, 2)),
        random.uniform(0.002, 0.01, count),
        np.repeat(np.arange(PEOPLE_SEEN), EACH),
        random.uniform(0.2, 1.0, count),
        np.arange(PEOPLE_SEEN),
        np.tile(np.arange(EACH) / 2.0, PEOPLE_SEEN),
    )


def _scale(random: np.random.Generator, uprights: Uprights) -> Scale:
    return Scale(
        random.uniform(1.6, 1.8, PEOPLE_SEEN),
        random.uniform(0.05, 0.1, PEOPLE_SEEN),
        np.arange(PEOPLE_SEEN) > 0,
        0.03,
        Segments(
            np.array(
                [
                    [[-0.2, 0.1], [0.3, 0.15]],
                    [[0.1, 0.3], [0.12, 0.05]],
                    [[-0.1, 0.2], [-0.12, -0.05]],
                ]
            ),
            np.array([4.0, 9.0, 2.1]),
            np.array([0.02, 0.05, 0.01]),
            np.array([False, False, True]),
        ),
        uprights,
        0.15,
    )


def _posts(random: np.random.Generator) -> Uprights:
    middle = random.uniform(-0.5, 0.5, (6, 2))
    direction = np.column_stack([random.normal(0, 0.1, 6), random.uniform(0.1, 0.4, 6)])
    return Uprights(middle, direction, random.uniform(0.01, 0.03, 6), 0.15, 0.01)


@pytest.mark.parametrize("seed", range(4))
def test_the_jacobian_is_that_of_the_residuals(seed: int) -> None:
    random = np.random.default_rng(seed)
    sample = _sample(random)
    scale = _scale(random, _posts(random) if seed % 2 else NO_UPRIGHTS)
    if seed > 1:
        root = random.normal(0, 0.05, (3, 3))
        scale = replace(scale, pose=PosePrior.of(GroundPlane(3.8, 0.25, 0.0, root @ root.T)))
    heights_m = random.uniform(1.5, 1.9, PEOPLE_SEEN)
    x = np.array([np.log(4.0), 0.3, 0.05, 0.02, 0.01, 0.1, 0.03, *heights_m])
    assert len(x) == PEOPLE + PEOPLE_SEEN
    exact = jacobian(x, sample, scale).toarray()
    differences = approx_derivative(residuals, x, method="3-point", args=(sample, scale))
    assert exact.shape == differences.shape
    np.testing.assert_allclose(exact, differences, rtol=1e-6, atol=1e-6)


def test_what_cannot_be_on_the_ground_pulls_nowhere() -> None:
    random = np.random.default_rng(9)
    sample = _sample(random)
    sample.foot[0, 1], sample.head[0, 1] = -0.9, -1.0  # above the horizon
    scale = _scale(random, NO_UPRIGHTS)
    x = np.array([np.log(4.0), 0.3, 0.0, 0.0, 0.0, 0.0, 0.0, *scale.mean_m])
    slopes = jacobian(x, sample, scale).toarray()
    assert np.isfinite(slopes).all()
    assert not slopes[0].any()
    assert slopes[1].any()


def test_a_smaller_scene_fits_as_well_but_for_its_mean_stature() -> None:
    random = np.random.default_rng(3)
    sample = _sample(random)
    scale = _scale(random, NO_UPRIGHTS)
    alike = replace(
        scale,
        of_population=np.ones(PEOPLE_SEEN, dtype=bool),
        segments=Segments.of((), None),
    )
    x = np.array([np.log(4.0), 0.3, 0.05, 0.02, 0.01, 0.1, 0.03, *random.uniform(1.5, 1.9, 5)])
    smaller = x.copy()
    smaller[[ABOVE, MEAN]] -= 0.1
    smaller[PEOPLE:] *= np.exp(-0.1)
    changed = ~np.isclose(residuals(smaller, sample, alike), residuals(x, sample, alike))
    mean = len(sample.track) + PEOPLE_SEEN + [unknown for unknown, _ in alike.few].index(MEAN)
    assert np.flatnonzero(changed).tolist() == [mean]
