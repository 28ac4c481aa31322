"""Depth by blur on random shots: a small part of `python -m bench.defocus`."""

from itertools import pairwise

import numpy as np
import pytest

from bench.blur_estimators import ESTIMATORS, peak_slope
from bench.defocus import Z95, row_of, scores
from pipeline.optics.defocus import edge_spread

SHOTS = 18


@pytest.fixture(scope="module")
def rows():
    return [row_of(seed) for seed in range(500, 500 + SHOTS)]


@pytest.mark.slow
def test_depths_whose_interval_is_narrow_are_within_five_per_cent(rows):
    off, z, narrow = scores(rows, "defocus")
    assert narrow.sum() >= SHOTS // 3
    assert np.median(np.abs(off[narrow])) < 0.05
    assert (np.abs(z[narrow]) < Z95).mean() > 0.8  # of a dozen; the bench has hundreds


@pytest.mark.slow
def test_the_estimator_that_is_used_is_the_best_of_those_compared(rows):
    true = np.array([r.true_sigma_px for r in rows])
    off = []
    for name in ESTIMATORS:
        found = np.array([r.sigma_px[name] for r in rows])
        known = np.isfinite(found) & (true > 1)
        off.append(np.median(np.abs(found[known] / true[known] - 1)))
    assert off[0] == min(off)
    assert off[0] < 0.02


@pytest.mark.slow
def test_fused_is_no_worse_than_its_best_member(rows):
    both = [r for r in rows if np.isfinite(r.depth["defocus"][0])]
    rms = [np.sqrt(np.mean(scores(both, m)[0] ** 2)) for m in ("fused", "defocus", "size")]
    assert rms[0] < 1.05 * min(rms[1:])


@pytest.mark.parametrize(("radius", "floor"), [(0.5, 0.6), (3.0, 0.6), (12.0, 1.5)])
def test_the_closed_form_of_the_slope_is_that_of_the_edge_spread(radius, floor):
    total = np.hypot(radius / 2, floor)
    share = (radius / 2 / total) ** 2
    rise = edge_spread(0.02, share) - edge_spread(-0.02, share)
    assert peak_slope(radius, floor) == pytest.approx(rise / (0.04 * total), rel=0.01)


def test_a_wider_disc_has_a_flatter_edge():
    slopes = [float(peak_slope(r, 0.6)) for r in (0.1, 1.0, 3.0, 10.0)]
    assert all(a > b for a, b in pairwise(slopes))
    assert peak_slope(30.0, 0.1) == pytest.approx(2 / (np.pi * 30.0), rel=1e-3)
