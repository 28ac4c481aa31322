"""The crowd before a simulated camera: people of some country, which no prior is told of.

The country is drawn from all of the world, each alike; the share of men, what people wear on their feet
and on their heads, and how many are children differ from crowd to crowd.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.core.stature import MEAN_CM

WITHIN_SEX_M = 0.066
CHILD_M = (1.05, 1.45)
MEN_SHARES = (4.0, 3.0)  # of a beta distribution: from a fifth to nine in ten
WORN_M, WORN_STD_M = 0.035, 0.015  # soles, heels and hair together


@dataclass(frozen=True, slots=True)
class Crowd:
    """The statures of those who pass a camera, shod."""

    men_m: float
    women_m: float
    men_share: float
    sexes: np.random.Generator  # of its own, so that paths do not depend on the country

    @classmethod
    def drawn(cls, random: np.random.Generator) -> Crowd:
        """Draw a crowd."""
        (own,) = random.spawn(1)
        codes = sorted(MEAN_CM)
        men_cm, women_cm = MEAN_CM[codes[own.integers(len(codes))]]
        worn_m = max(random.normal(WORN_M, WORN_STD_M), 0.0)
        men_share = own.beta(*MEN_SHARES)
        return cls(men_cm / 100 + worn_m, women_cm / 100 + worn_m, men_share, own)

    def stature_m(self, random: np.random.Generator) -> float:
        """Draw the stature of a grown person."""
        man = self.sexes.uniform() < self.men_share
        return float(random.normal(self.men_m if man else self.women_m, WITHIN_SEX_M))
