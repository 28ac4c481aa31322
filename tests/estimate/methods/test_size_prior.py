"""Depths by size and by all methods are no worse than the plain size prior, at any range."""

from __future__ import annotations

import numpy as np
import pytest

from bench.size_prior import BY_ALL, BY_SIZE, FEW, PLAIN, compared, mean_by_range

CHANCE = 1.1  # of the errors of a few cameras at one range


@pytest.mark.parametrize(("people", "methods"), [(FEW, (BY_SIZE,)), (15, (BY_SIZE, BY_ALL))])
def test_no_method_is_worse_than_the_plain_prior_at_any_range(
    people: int, methods: tuple[str, ...]
) -> None:
    found = compared(8, people)
    assert len(found) >= 5
    plain = mean_by_range(found, PLAIN)
    for method in methods:
        error = mean_by_range(found, method)
        assert np.isfinite(error).sum() >= 3
        assert (error[np.isfinite(error)] < CHANCE * plain[np.isfinite(error)]).all()
        held = np.mean([np.nanmean(d.inside[method]) for d in found])
        assert held > 0.7  # of eight cameras, whose people are of eight countries
