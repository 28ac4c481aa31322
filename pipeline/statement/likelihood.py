"""Weight of a measured height for or against a stated stature.

Aitken and Taroni, Statistics and the Evaluation of Evidence for Forensic Scientists, section 10.4: for
a measurement x with the deviation s of a person who is said to be c tall (deviation u), against anybody
of a population (mean m, deviation p), both normal,

    V = N(x; c, s^2 + u^2) / N(x; m, s^2 + p^2)

It says how much more probable the measurement is under the one than under the other. It is no
probability that they are one person: many people are of one stature.
"""

from __future__ import annotations

from dataclasses import dataclass
from statistics import NormalDist

# Statures are stated to a centimetre or two; they differ by 1 to 2 cm over a day.
STATED_STD_M = 0.015


@dataclass(frozen=True, slots=True)
class Weight:
    """Agreement of a measurement with a stated stature."""

    stated_m: float
    deviations: float  # of the measurement from the claim, in standard deviations
    farther: float  # probability that a measurement of such a person is at least as far off
    ratio: float  # V above
    words: str


def weight_of(
    height_m: float,
    std_m: float,
    stated_m: float,
    population: tuple[float, float],
    stated_std_m: float = STATED_STD_M,
) -> Weight:
    """Return the weight of a measured height for a stated stature, as the module says.

    Args:
        height_m: measured.
        std_m: its standard deviation.
        stated_m: the stature that is claimed.
        population: mean and deviation of the statures of anybody who could have been there.
        stated_std_m: deviation of the claim.
    """
    spread = (std_m**2 + stated_std_m**2) ** 0.5
    deviations = (height_m - stated_m) / spread
    anybody = NormalDist(population[0], (std_m**2 + population[1] ** 2) ** 0.5)
    ratio = NormalDist(stated_m, spread).pdf(height_m) / max(anybody.pdf(height_m), 1e-300)
    farther = 2 * NormalDist().cdf(-abs(deviations))
    return Weight(stated_m, deviations, farther, ratio, words_for(ratio))


def words_for(ratio: float) -> str:
    """Return a likelihood ratio in words: the bands of the ENFSI Guideline for Evaluative Reporting."""
    if ratio < 1:
        return f"{_band(1 / max(ratio, 1e-300))} support for another person"
    return f"{_band(ratio)} support for a person of this stature"


def _band(ratio: float) -> str:
    bands = ((2, "no"), (10, "weak"), (100, "moderate"), (1000, "moderately strong"))
    return next((word for limit, word in bands if ratio < limit), "strong or more")
