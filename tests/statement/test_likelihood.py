"""Weight of a measured height for a stated stature, against closed forms."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import norm

from pipeline.statement.likelihood import STATED_STD_M, weight_of, words_for

POPULATION = (1.74, 0.093)


@given(
    height_m=st.floats(1.4, 2.1),
    std_m=st.floats(0.005, 0.15),
    stated_m=st.floats(1.4, 2.1),
)
def test_it_is_the_ratio_of_two_normal_densities(
    height_m: float, std_m: float, stated_m: float
) -> None:
    weight = weight_of(height_m, std_m, stated_m, POPULATION)
    spread = math.hypot(std_m, STATED_STD_M)
    expected = norm.logpdf(height_m, stated_m, spread) - norm.logpdf(
        height_m, POPULATION[0], math.hypot(std_m, POPULATION[1])
    )
    assert math.log(max(weight.ratio, 1e-300)) == pytest.approx(max(expected, -690.7755), abs=1e-4)
    assert weight.farther == pytest.approx(2 * norm.sf(abs(height_m - stated_m) / spread))


def test_a_height_that_excludes_nobody_says_nothing() -> None:
    assert weight_of(1.74, 5.0, 1.9, POPULATION).ratio == pytest.approx(1.0, rel=0.01)


def test_an_exact_height_supports_a_rare_stature_more_than_a_usual_one() -> None:
    rare = weight_of(2.0, 0.01, 2.0, POPULATION).ratio
    usual = weight_of(1.74, 0.01, 1.74, POPULATION).ratio
    assert rare > 10 * usual > 10


@pytest.mark.parametrize(
    ("ratio", "words"),
    [
        (1.5, "no support for a person of this stature"),
        (5, "weak support for a person of this stature"),
        (50, "moderate support for a person of this stature"),
        (0.05, "moderate support for another person"),
        (0.0, "strong or more support for another person"),
    ],
)
def test_words_go_with_the_ratio(ratio: float, words: str) -> None:
    assert words_for(ratio) == words
