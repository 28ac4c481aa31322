"""Correction from the outline of an upright person to the vertical axis of the body.

The lower end of a silhouette is not below the middle of the body: it is the nearer foot's nearer end,
in front of it by a share of the stature, the reach. Its upper end is not the crown: seen from above, the
outline of a head is its far side, as that of a ball, higher than the crown by as much as the ray is
steep. With ray angles phi below the horizon, stature H, reach k and crown radius r (shares of H):

    the ground point of the lower end is k H nearer than the axis
    the upper ray passes r H (1 / cos phi - 1) above the crown

so that, H_b being the height of the upper ray above the ground point of the lower end,

    H = H_b / (1 + k tan phi + r (1 / cos phi - 1))

All of it is in shares of the stature, so the scale of the scene need not be known.
"""

from __future__ import annotations

import numpy as np

from pipeline.optics.arrays import ArrayLike, Floats, floats, positive, quiet

# Reach by the direction of walking, s the sine of the angle towards the camera, and by the ray:
# k = ACROSS + TOWARDS s + (ALONG + SWING tan phi) s^2. Of who walks across the picture half a shoe's
# breadth and half the step's width count (0.028 + 0.02 of the stature; Drillis and Contini 1966,
# Whittle); of who comes, the toes of the foreleg; of who goes, the heel of the hindleg; and a foot that
# swings above the ground is beyond it by its height over tan phi, so it counts the more the steeper the
# ray. The means over a stride are those of the limbs of `recordings/walkers_body.py` (13 simulated
# cameras, 13000 outlines).
ACROSS, TOWARDS, ALONG, SWING = 0.036, 0.064, 0.105, 0.08
REACH_STD = 0.045  # from frame to frame: the stride, same source
UNKNOWN_REACH_STD = 0.07  # where it is not known which way somebody walks
# What all frames of a track, and all tracks of a camera, have in common: gaits, shoes, clothes. The
# former is from the same source (the latter 0.007 there, and everybody wears the same shoes).
REACH_TRACK_STD, REACH_COMMON_STD = 0.02, 0.01
MAX_STEEP = 1.2  # as far as it was looked at
# A head is 0.13 of the stature high and half of it above the eyes is about half a ball.
CROWN_RADIUS = 0.05


@quiet
def mean_reach(steep: ArrayLike, towards: ArrayLike = 0.0, squared: ArrayLike = 0.5) -> Floats:
    """Return the mean reach at tan phi, from the means of s and s^2; by default over all directions."""
    along = ALONG + SWING * np.clip(np.nan_to_num(floats(steep)), 0.0, MAX_STEEP)
    return np.asarray(ACROSS + TOWARDS * floats(towards) + along * floats(squared))


@quiet
def steepness(y: ArrayLike, tilt_rad: ArrayLike) -> tuple[Floats, Floats]:
    """Return tan and 1 / cos of the angle below the horizon of a row of the picture."""
    ahead = positive(np.cos(tilt_rad) - floats(y) * np.sin(tilt_rad))
    tan = (floats(y) * np.cos(tilt_rad) + np.sin(tilt_rad)) / ahead
    return np.asarray(tan), np.asarray(np.sqrt(1.0 + tan**2))


@quiet
def per_stature(y_high: ArrayLike, tilt_rad: ArrayLike, reach: ArrayLike) -> Floats:
    """Return H_b / H: how much taller a silhouette seems than the person is."""
    tan, secant = steepness(y_high, tilt_rad)
    return np.asarray(positive(1.0 + floats(reach) * tan + CROWN_RADIUS * (secant - 1.0)))


@quiet
def per_stature_jacobian(
    y_high: ArrayLike, tilt_rad: ArrayLike, reach: ArrayLike
) -> tuple[Floats, Floats, Floats]:
    """Return the derivatives of `per_stature` by row, tilt and reach.

    The angle below the horizon is the tilt plus arctan y.
    """
    tan, secant = steepness(y_high, tilt_rad)
    by_angle = floats(reach) * secant**2 + CROWN_RADIUS * secant * tan
    return np.asarray(by_angle / (1.0 + floats(y_high) ** 2)), np.asarray(by_angle), tan


@quiet
def axis_rows(
    y_low: ArrayLike, y_high: ArrayLike, tilt_rad: ArrayLike, reach: ArrayLike
) -> tuple[Floats, Floats]:
    """Return the rows, y_foot and y_head, of where the axis meets the ground and of the crown.

    Args:
        y_low: normalised row of the silhouette's lower end, without roll.
        y_high: that of its upper end.
        tilt_rad: of the camera.
        reach: share of the stature.
    """
    cos, sin = np.cos(tilt_rad), np.sin(tilt_rad)
    low, high = floats(y_low), floats(y_high)
    # H over the depth of the lower end.
    share = (low - high) / positive(cos - high * sin) / per_stature(high, tilt_rad, reach)
    farther = 1.0 + floats(reach) * cos * share
    y_foot = ((low * cos + sin) / farther - sin) / cos
    y_head = (farther * y_foot - share * cos) / positive(farther - share * sin)
    return np.asarray(y_foot), np.asarray(y_head)


@quiet
def silhouette_rows(
    y_foot: ArrayLike, y_head: ArrayLike, tilt_rad: ArrayLike, reach: ArrayLike
) -> tuple[Floats, Floats]:
    """Return the rows, y_low and y_high, of the silhouette of a person: the inverse of `axis_rows`.

    The upper ray is found by iteration, as how far it passes above the crown depends on its angle.
    """
    cos, sin = np.cos(tilt_rad), np.sin(tilt_rad)
    foot, head = floats(y_foot), floats(y_head)
    # H over the depth of the axis.
    share = (foot - head) / positive(cos - head * sin)
    high = head
    for _ in range(6):
        _, secant = steepness(high, tilt_rad)
        top = share * (1.0 + CROWN_RADIUS * (secant - 1.0))
        high = (foot - top * cos) / positive(1.0 - top * sin)
    nearer = positive(1.0 - floats(reach) * cos * share)
    low = ((foot * cos + sin) / nearer - sin) / cos
    return np.asarray(low), np.asarray(high)
