"""Straight edges of a place that are vertical, and the tilt and roll that they tell.

A vertical edge is seen along the line through the vanishing point of the vertical: with gravity
g = (sin r cos t, cos r cos t, sin t) in the camera's axes, at a point (x, y) of the picture along

    (g_x - x g_z, g_y - y g_z)

Most edges of a place are not vertical. So roll and tilt are looked for at which far more edges agree with
that direction than by chance: the likelihood of a mixture of edges that are vertical, but for a small
lean, and of edges of any direction. Edges are used if enough things agree and no other roll does as well.

A lens whose distortion is not known bends lines: by k, x (1 + k (x^2 + y^2)) turns a vertical line at
(x, y) by 2 k x y. That is an unknown, with what is usual for a deviation.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.core.arrays import FloatArray
from pipeline.core.records import Intrinsics
from pipeline.estimate.boxes.ends import camera_of

END_STD_PX = 0.5  # of an edge's ends, across
# Posts, door frames and walls are upright to half a degree, old ones and trees to one or two.
LEAN_STD_RAD = np.deg2rad(0.7)
WINDOW_RAD = np.deg2rad(12.0)  # about the vertical of a camera without roll
ROLLS_RAD = np.deg2rad(np.arange(-10.0, 10.05, 0.25))
# Of lenses of 4-12 mm on a small sensor k is -0.05 to -0.3; a calibration leaves little of it.
BEND_STD, CALIBRATED_BEND_STD = 0.15, 0.02
BENDS = np.linspace(-2, 2, 9)  # deviations that are tried
SHARES = (0.15, 0.3, 0.5, 0.7, 0.9)  # of the edges that are vertical
SAME = 0.03  # of the picture's width: edges so near are of one thing
# Used only if the vertical edges are so much likelier than chance, are of so many things, and no roll
# far from the best is nearly as good; natural logarithms. Thousands of rolls, tilts and bends are tried,
# of which perhaps a hundred are different: chance alone gives 4 to 5.
MIN_EVIDENCE, MIN_THINGS, MIN_LEAD = 7.0, 3.0, 4.0
APART_RAD = np.deg2rad(2.5)


@dataclass(frozen=True, slots=True)
class Uprights:
    """Edges taken for vertical, (n,) each; points and directions are normalised."""

    middle: FloatArray  # (n, 2)
    direction: FloatArray  # (n, 2)
    std_rad: FloatArray  # of the direction, edges of one thing counting as one
    bend_std: float
    roll_rad: float  # at which they agree best

    def __len__(self) -> int:
        return len(self.std_rad)

    def off(self, tilt_rad: float, roll_rad: float, bend: float) -> FloatArray:
        """Return how far each is from vertical, in its standard deviations, (n,)."""
        turn = _turn(self.middle, self.direction, tilt_rad, roll_rad) + bend * _bent(self.middle)
        return np.asarray(turn / self.std_rad)

    def off_jacobian(self, tilt_rad: float, roll_rad: float) -> FloatArray:
        """Return the derivatives of `off` by tilt, roll and bend, (n, 3)."""
        cos, sin = np.cos(tilt_rad), np.sin(tilt_rad)
        up = np.array([np.sin(roll_rad), np.cos(roll_rad)])
        down = up * cos - self.middle * sin
        by_tilt = -up * sin - self.middle * cos
        by_roll = np.array([up[1], -up[0]]) * cos
        squared = (down**2).sum(axis=1) * (self.direction**2).sum(axis=1)
        # Of arctan(cross / dot): (dot d cross - cross d dot) / (cross^2 + dot^2).
        cross, dot = _cross_and_dot(down, self.direction)
        slopes = [_bent(self.middle)]
        for by in (by_roll, by_tilt):
            by_cross, by_dot = _cross_and_dot(np.broadcast_to(by, down.shape), self.direction)
            slopes.insert(0, (dot * by_cross - cross * by_dot) / squared)
        return np.asarray(np.stack(slopes, axis=1) / self.std_rad[:, None])


NO_UPRIGHTS = Uprights(np.empty((0, 2)), np.empty((0, 2)), np.empty(0), BEND_STD, 0.0)


def bend_std_of(intrinsics: Intrinsics | None) -> float:
    """Return how far the distortion of a lens may be off what is known of it, by k."""
    calibrated = intrinsics is not None and intrinsics.distortion_model
    return CALIBRATED_BEND_STD if calibrated else BEND_STD


def find_uprights(
    lines_px: FloatArray, intrinsics: Intrinsics, tilt_rad: float, tilt_std_rad: float
) -> Uprights:
    """Return the edges that are vertical, none where that cannot be told.

    Args:
        lines_px: ends of straight edges, x0 y0 x1 y1, (n, 4).
        intrinsics: of the camera.
        tilt_rad: about which it is looked for; known to a few degrees.
        tilt_std_rad: its standard deviation.
    """
    camera = camera_of(intrinsics)
    first, last = camera.normalize(lines_px[:, :2]), camera.normalize(lines_px[:, 2:])
    middle, direction = (first + last) / 2, last - first
    near = np.abs(_turn(middle, direction, tilt_rad, 0.0)) < WINDOW_RAD
    middle, direction, ends_px = middle[near], direction[near], lines_px[near]
    if len(middle) < MIN_THINGS:
        return NO_UPRIGHTS
    long_px = np.hypot(*(ends_px[:, 2:] - ends_px[:, :2]).T)
    std = np.hypot(np.sqrt(2) * END_STD_PX / long_px, LEAN_STD_RAD)
    at_px = (ends_px[:, 0] + ends_px[:, 2]) / 2
    beside = np.abs(at_px[:, None] - at_px) < SAME * intrinsics.width_px
    weight = 1.0 / beside.sum(axis=1)
    bend_std = bend_std_of(intrinsics)
    tilts = tilt_rad + np.linspace(-2, 2, 9) * tilt_std_rad
    likelihood = np.full((len(ROLLS_RAD), len(tilts), len(BENDS)), -np.inf)
    clutter = 1.0 / (2 * WINDOW_RAD)
    for j, tilt in enumerate(tilts):
        turn = np.stack([_turn(middle, direction, tilt, roll) for roll in ROLLS_RAD])
        for k, bend in enumerate(BENDS):
            z = (turn + bend * bend_std * _bent(middle)) / std
            upright = np.exp(-0.5 * z**2) / (np.sqrt(2 * np.pi) * std)
            for share in SHARES:
                log = np.log(share * upright / clutter + 1 - share) @ weight - bend**2 / 2
                likelihood[:, j, k] = np.maximum(likelihood[:, j, k], log)
    by_roll = likelihood.max(axis=(1, 2))
    best = int(np.argmax(by_roll))
    roll = float(ROLLS_RAD[best])
    rival = by_roll[np.abs(ROLLS_RAD - roll) > APART_RAD].max()
    _, at_tilt, at_bend = np.unravel_index(int(np.argmax(likelihood)), likelihood.shape)
    bend = float(BENDS[at_bend] * bend_std)
    z = (_turn(middle, direction, float(tilts[at_tilt]), roll) + bend * _bent(middle)) / std
    fits = np.abs(z) < 2.5
    things = float(weight[fits].sum())
    if by_roll[best] < MIN_EVIDENCE or things < MIN_THINGS or by_roll[best] - rival < MIN_LEAD:
        return NO_UPRIGHTS
    alike = beside[np.ix_(fits, fits)].sum(axis=1)
    return Uprights(middle[fits], direction[fits], std[fits] * np.sqrt(alike), bend_std, roll)


def _turn(
    middle: FloatArray, direction: FloatArray, tilt_rad: float, roll_rad: float
) -> FloatArray:
    """Return the angle of each edge from the vertical where it is, (n,), within a quarter turn."""
    cos = np.cos(tilt_rad)
    down = np.array([np.sin(roll_rad) * cos, np.cos(roll_rad) * cos]) - middle * np.sin(tilt_rad)
    cross, dot = _cross_and_dot(down, direction)
    return np.asarray(np.arctan(cross / np.where(np.abs(dot) > 1e-12, dot, 1e-12)))


def _cross_and_dot(one: FloatArray, other: FloatArray) -> tuple[FloatArray, FloatArray]:
    cross = one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0]
    return cross, (one * other).sum(axis=1)


def _bent(middle: FloatArray) -> FloatArray:
    return np.asarray(2 * middle[:, 0] * middle[:, 1])
