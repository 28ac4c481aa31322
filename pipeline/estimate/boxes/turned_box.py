"""Boxes around flat things that are turned: forward, and back to the true size.

A thing of width w and height h faces the camera. It is turned out of the plane of the picture by a slant
s about its horizontal axis, which foreshortens its height to h cos s (the thing being small beside its
distance), and then in the plane of the picture by a turn t. The upright box around it is W wide, H high:

    rectangle    W = w cos t + h cos s sin t               H = w sin t + h cos s cos t
    ellipse      W^2 = (w cos t)^2 + (h cos s sin t)^2     H^2 = (w sin t)^2 + (h cos s cos t)^2

(projections of a rectangle's corners, and the support function of an ellipse). A turn in the plane makes
the box of a wide thing higher than the thing; a slant makes it lower. Both equations are linear, in w and
h or in their squares, and are solved for h.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.special import ndtri

from pipeline.optics.arrays import Floats

# The turn is taken at the middles of so many parts of equal chance, and the slant likewise.
PARTS = 64


class Share(NamedTuple):
    """A true size as a share of the box's: mean and standard deviation, (n,) each."""

    mean: Floats
    std: Floats


def box_around(
    width: Floats, height: Floats, turn_rad: float, slant_rad: float, *, rounded: bool
) -> tuple[Floats, Floats]:
    """Return width and height, (n,) each, of the upright boxes around turned things."""
    cos, sin = abs(np.cos(turn_rad)), abs(np.sin(turn_rad))
    seen = height * np.cos(slant_rad)
    if rounded:
        return np.hypot(width * cos, seen * sin), np.hypot(width * sin, seen * cos)
    return width * cos + seen * sin, width * sin + seen * cos


def height_share(wide_to_tall: Floats, turn_std_rad: float, slant_std_rad: float) -> Share:
    """Return the true height of a thing as a share of its box's height.

    Turn and slant are unknown: normal, about none, with these standard deviations. Every second thing is
    taken to be a rectangle and the others an ellipse. Turns at which the box could be of no such thing
    (one of its sides would be negative) are left out, the rest keep their chances.

    Args:
        wide_to_tall: width of the box over its height, (n,); NaN where it is unknown, and only the
            slant counts then.
        turn_std_rad: deviation of the turn in the plane of the picture.
        slant_std_rad: deviation of the slant out of it.
    """
    ratio = np.nan_to_num(np.asarray(wide_to_tall, dtype=np.float64))[:, None]
    turn = np.minimum(_half_normal(turn_std_rad), np.radians(44.0))[None, :]
    cos, sin, cos2 = np.cos(turn), np.sin(turn), np.cos(2 * turn)
    straight = (cos - ratio * sin) / cos2
    straight = np.where((straight > 0) & (ratio * cos >= sin), straight, np.nan)
    square = (cos**2 - (ratio * sin) ** 2) / cos2
    round_ = np.where((square > 0) & (ratio * cos >= sin), square, np.nan) ** 0.5
    # A box of unknown width says nothing of a turn.
    unknown = ratio <= 0
    shares = np.where(unknown, 1.0, np.hstack([straight, round_]))
    shares[np.isnan(shares).all(axis=1)] = 1.0
    mean, second = np.nanmean(shares, axis=1), np.nanmean(shares**2, axis=1)
    by_slant = 1.0 / np.cos(np.minimum(_half_normal(slant_std_rad), np.radians(80.0)))
    mean, second = mean * by_slant.mean(), second * (by_slant**2).mean()
    return Share(mean, np.sqrt(np.maximum(second - mean**2, 0.0)))


def _half_normal(std: float) -> Floats:
    """Return quantiles of |x| at the middles of parts of equal chance, x normal with this deviation."""
    return np.asarray(std * ndtri(0.5 + (np.arange(PARTS) + 0.5) / (2 * PARTS)))
