"""The Kalman filter of all tracks at once, as rows of one array with a column for each track.

The state is foot point, height and width in pixels, with the velocity of the foot point. Nothing in the
model couples the four: x, y, height and width keep a filter each, whose update is a division, not the
inverse of a matrix. x and y see the same noise at the same times, so they share their covariance.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from pipeline.core.arrays import FloatArray, IntArray

# Lengths in the filter are relative to the object's own height, so that near and far people, and
# large and small pictures, are treated alike.
# A walker passes 0.8 body heights a second (1.4 m/s), a runner twice that.
SPEED_STD = 1.0  # body heights a second, of a new track
ACCELERATION_STD = (
    0.6  # body heights a second squared: 1 m/s2, setting off or stopping within 1.5 s
)
# The height in the picture changes only as the person comes nearer; the width also with every stride.
HEIGHT_CHANGE_STD = 0.08  # of the height, in a second
WIDTH_CHANGE_STD = 0.3
FOOT_STD = 0.05  # body heights: how well a box's foot point and sides repeat
SIZE_STD = 0.08

# Rows: foot x, foot y, height, width; velocity of x and y; then variances (covariance with the
# velocity, variance of the velocity) of x or y, of height, of width.
_X, _Y, _H, _W, _VX, _VY, _PP, _PV, _VV, _HH, _WW = range(11)
_VARIANCE = np.array([_PP, _PP, _HH, _WW])  # of each of the first four rows
_NOISE = np.array([FOOT_STD, FOOT_STD, SIZE_STD, SIZE_STD])[:, None] ** 2
_CHANGE = np.array([HEIGHT_CHANGE_STD, WIDTH_CHANGE_STD])[:, None] ** 2


class Filters:
    """State and covariance of every track that is followed."""

    def __init__(self) -> None:
        self._rows = np.empty((11, 0))

    def __len__(self) -> int:
        return self._rows.shape[1]

    @property
    def state(self) -> FloatArray:
        """Foot x, foot y, height, width, velocity of x, of y: (tracks, 6)."""
        return self._rows[:6].T

    def predict(self, elapsed_s: float) -> None:
        """Move on in time: white noise of acceleration (Bar-Shalom 2001, 6.3.2), of sizes."""
        rows, t = self._rows, elapsed_s
        rows[:2] += t * rows[4:6]
        square = rows[_H] * rows[_H]
        jerk = ACCELERATION_STD**2 * square
        rows[_PP] += t * (2 * rows[_PV] + t * rows[_VV]) + (t**4 / 4) * jerk
        rows[_PV] += t * rows[_VV] + (t**3 / 2) * jerk
        rows[_VV] += t**2 * jerk
        rows[_HH:] += (_CHANGE * t) * square

    def distance(self, tracks: IntArray, measured: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return squared Mahalanobis distances and how unsure the tracks are.

        Args:
            tracks: which, (t,).
            measured: foot x, foot y, height and width of boxes, (4, b).

        Returns:
            Distances (t, b), and the determinant of each innovation's covariance over that of the
            measurement, (t,).
        """
        rows = self._rows[:, tracks]
        noise = _NOISE * (rows[_H] * rows[_H])
        spread = rows[_VARIANCE] + noise  # (4, t)
        off = measured[:, None, :] - rows[:4, :, None]  # (4, t, b)
        return (off * off / spread[:, :, None]).sum(axis=0), (spread / noise).prod(axis=0)

    def correct(self, tracks: IntArray, measured: FloatArray) -> None:
        """Take one box each into account: tracks (t,), measured (4, t)."""
        rows = self._rows[:, tracks]
        spread = rows[_VARIANCE] + _NOISE * (rows[_H] * rows[_H])
        gain = rows[_VARIANCE] / spread
        speed_gain = rows[_PV] / spread[0]
        off = measured - rows[:4]
        rows[:4] += gain * off
        rows[4:6] += speed_gain * off[:2]
        rows[_VV] -= speed_gain * rows[_PV]
        rows[_PV] *= 1 - gain[0]
        rows[_PP] *= 1 - gain[0]
        rows[_HH:] *= 1 - gain[2:]
        np.maximum(rows[2:4], 1.0, out=rows[2:4])
        self._rows[:, tracks] = rows

    def begin(self, measured: FloatArray) -> None:
        """Add tracks that are where these boxes are, (4, n), of unknown velocity."""
        square = measured[2] * measured[2]
        zero = np.zeros_like(measured[:2])
        velocity = np.stack([zero[0], SPEED_STD**2 * square])
        new = [measured, zero, FOOT_STD**2 * square[None], velocity, SIZE_STD**2 * square[None]]
        self._rows = np.concatenate([self._rows, np.concatenate([*new, new[-1]])], axis=1)

    def keep(self, kept: npt.NDArray[np.bool_]) -> None:
        """Forget the other tracks."""
        self._rows = self._rows[:, kept]
