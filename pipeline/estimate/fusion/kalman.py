"""Kalman filters of many tracks side by side, forward and then backward (Rauch, Tung and Striebel 1965).

The motion is a nearly constant velocity, driven by white acceleration (Bar-Shalom 2001, 6.2.2). Rows come
in an order by step, so that what is done in a step is done to one piece of memory. Two filters say the
same: where no noise couples the two coordinates, each is a filter of two numbers, written out; else both
are one of four, in small matrices.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from pipeline.core.arrays import FloatArray, IntArray

# A walker sets off, stops or turns within about a second: a change of speed of 0.7 m/s in one second,
# as a random walk of the velocity.
ACCELERATION_DENSITY = 0.5  # m^2/s^3
SPEED_STD_M_S = 1.5  # of somebody of whom nothing is known yet
FAR_M = 1e3  # nothing is known of where they are
LEAST_S = 1e-6  # between two observations


class Posterior(NamedTuple):
    """Posterior of each row by all of its track."""

    position_m: FloatArray  # (n, 2)
    velocity_m_s: FloatArray  # (n, 2)
    covariance: FloatArray  # (n, 2, 2) of the position
    velocity_variance: FloatArray  # (n,) of either component, their mean


@dataclass(frozen=True, slots=True)
class Steps:
    """An order of rows: the first of each track, then the second of those that have one, and so on."""

    rows: IntArray  # (n,) where each is in the order by tracks
    edges: list[int]  # where each step begins, and the last one ends
    elapsed_s: FloatArray  # (n,) from the row before it in its track; of a first one, any

    @classmethod
    def of(cls, lengths: IntArray, time_s: FloatArray) -> Steps:
        """Order tracks whose rows follow one another, the longest track first."""
        step = np.arange(lengths.max())
        count = len(lengths) - np.searchsorted(lengths[::-1], step, side="right")
        edges = np.concatenate([[0], np.cumsum(count)])
        begins = np.concatenate([[0], np.cumsum(lengths)[:-1]])
        track = np.arange(edges[-1]) - np.repeat(edges[:-1], count)
        rows = begins[track] + np.repeat(step, count)
        elapsed_s = np.maximum(np.diff(time_s, prepend=0.0), LEAST_S)
        return cls(rows, edges.tolist(), elapsed_s[rows])

    def each_coordinate(self) -> Steps:
        """Return the order of both coordinates of each row, one after the other."""
        edges = [2 * edge for edge in self.edges]
        return Steps(np.repeat(self.rows, 2), edges, np.repeat(self.elapsed_s, 2))

    @property
    def start(self) -> slice:
        """The first step."""
        return slice(0, self.edges[1])

    @property
    def later(self) -> slice:
        """All others."""
        return slice(self.edges[1], None)

    def each(self) -> Iterator[tuple[slice, slice]]:
        """Yield the others one by one, and where their tracks were a step before."""
        for before, now, end in zip(self.edges, self.edges[1:], self.edges[2:], strict=False):
            yield slice(now, end), slice(before, before + end - now)

    @property
    def earlier(self) -> IntArray:
        """Rows of the tracks of `later` one step before, (n,)."""
        return self._followed(np.arange(self.edges[-1]))

    def _followed(self, rows: IntArray) -> IntArray:
        return np.concatenate([rows[before] for _, before in self.each()] or [rows[:0]])


def smoothed(
    steps: Steps, seen: FloatArray, noise: FloatArray, *, covariances: bool = True
) -> Posterior:
    """Return what is known by all of each track, in the order of the steps.

    Args:
        steps: which rows follow which.
        seen: positions, (n, 2).
        noise: their covariances, (n, 2, 2).
        covariances: whether those of the posterior are wanted; what is given if not, is none.
    """
    if noise[:, 0, 1].any() or noise[:, 1, 0].any():
        return _coupled(steps, seen, noise, covariances=covariances)
    variance = np.diagonal(noise, axis1=1, axis2=2).reshape(-1)
    x, v, p, w = _one_by_one(
        steps.each_coordinate(), seen.reshape(-1), variance, covariances=covariances
    )
    covariance = p.reshape(-1, 2)[:, :, None] * np.eye(2)
    return Posterior(x.reshape(-1, 2), v.reshape(-1, 2), covariance, w.reshape(-1, 2).mean(axis=1))


def _one_by_one(
    steps: Steps, seen: FloatArray, r: FloatArray, *, covariances: bool
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return position, velocity and their variances of rows of one coordinate, (n,) each.

    The covariance is [[p, b], [b, w]]; `_1` is what was foreseen of a row before it was seen.
    """
    t_all = steps.elapsed_s
    by_p, by_b, by_w = (ACCELERATION_DENSITY * t_all**k / k for k in (3, 2, 1))
    x, v, p, b, w, x_1, v_1, p_1, b_1, w_1 = np.empty((10, len(seen)))
    start = steps.start
    x_1[start], v_1[start], b_1[start] = seen[start], 0.0, 0.0
    p_1[start], w_1[start] = FAR_M**2, SPEED_STD_M_S**2

    def correct(now: slice) -> None:
        gain = 1.0 / (p_1[now] + r[now])
        faster = b_1[now] * gain
        gain *= p_1[now]
        off = seen[now] - x_1[now]
        np.add(x_1[now], gain * off, out=x[now])
        np.add(v_1[now], faster * off, out=v[now])
        # 1 / (1/p + 1/r) = r p / (p + r): right also where the noise is tiny beside what was known.
        np.multiply(r[now], gain, out=p[now])
        np.multiply(r[now], faster, out=b[now])
        np.subtract(w_1[now], b_1[now] * faster, out=w[now])

    correct(start)
    for now, before in steps.each():
        t, b_before = t_all[now], b[before]
        v_1[now] = v[before]
        np.add(x[before], t * v[before], out=x_1[now])
        moved = t * w[before]
        moved += b_before
        np.add(moved, by_b[now], out=b_1[now])
        moved += b_before
        moved *= t
        moved += p[before]
        np.add(moved, by_p[now], out=p_1[now])
        np.add(w[before], by_w[now], out=w_1[now])
        correct(now)

    # What a row takes back from the next one of its track, for all at once: P F' P_1^-1.
    later, mine = steps.later, steps.earlier
    t, p_2, b_2, w_2 = t_all[later], p_1[later], b_1[later], w_1[later]
    slope = b_2 / p_2
    inverse_w = 1.0 / (w_2 - b_2 * slope)
    inverse_b = -slope * inverse_w
    inverse_p = 1.0 / p_2 - slope * inverse_b
    (xx, xv, vx, vv) = np.empty((4, len(seen)))
    for both, by_x, by_v in ((p[mine], xx, xv), (b[mine], vx, vv)):
        slower = b[mine] if by_x is xx else w[mine]
        moved = both + t * slower
        by_x[later] = moved * inverse_p + slower * inverse_b
        by_v[later] = moved * inverse_b + slower * inverse_w
    for now, before in reversed(list(steps.each())):
        dx, dv = x[now] - x_1[now], v[now] - v_1[now]
        x[before] += xx[now] * dx + xv[now] * dv
        v[before] += vx[now] * dx + vv[now] * dv
        if covariances:
            a, c, e, g = xx[now], xv[now], vx[now], vv[now]
            dp, db, dw = p[now] - p_1[now], b[now] - b_1[now], w[now] - w_1[now]
            up, down = a * dp + c * db, a * db + c * dw
            p[before] += up * a + down * c
            b[before] += up * e + down * g
            w[before] += e * (e * dp + 2 * g * db) + g * g * dw
    return x, v, p, w


def _coupled(steps: Steps, seen: FloatArray, noise: FloatArray, *, covariances: bool) -> Posterior:
    """Return what is known of both coordinates; the state is [x, y, vx, vy]."""
    move, driven = _motion(steps.elapsed_s)
    moved = _turned(move).copy()
    count, places = len(seen), seen[:, :, None]
    x, x_1 = np.zeros((2, count, 4, 1))
    p, p_1 = np.zeros((2, count, 4, 4))
    x_1[steps.start, :2] = places[steps.start]
    p_1[steps.start] = np.diag([FAR_M**2, FAR_M**2, SPEED_STD_M_S**2, SPEED_STD_M_S**2])

    def correct(now: slice) -> None:
        foreseen, r = p_1[now], noise[now]
        gain = _inverse(foreseen[:, :2, :2] + r) @ foreseen[:, :2]  # turned
        np.add(x_1[now], _turned(gain) @ (places[now] - x_1[now, :2]), out=x[now])
        # (P^-1 + R^-1)^-1 = R (P + R)^-1 P: right also where the noise is tiny beside what was known.
        left = p[now]
        np.matmul(r, gain, out=left[:, :2])
        left[:, 2:, :2] = _turned(left[:, :2, 2:])
        np.subtract(foreseen[:, 2:, 2:], foreseen[:, 2:, :2] @ gain[:, :, 2:], out=left[:, 2:, 2:])

    correct(steps.start)
    for now, before in steps.each():
        np.matmul(move[now], x[before], out=x_1[now])
        np.add(move[now] @ p[before] @ moved[now], driven[now], out=p_1[now])
        correct(now)

    # What a row takes back from the next one of its track, for all at once.
    gain = np.empty_like(p)
    gain[steps.later] = p[steps.earlier] @ moved[steps.later] @ _inverse_by_blocks(p_1[steps.later])
    for now, before in reversed(list(steps.each())):
        x[before] += gain[now] @ (x[now] - x_1[now])
        if covariances:
            p[before] += gain[now] @ (p[now] - p_1[now]) @ _turned(gain[now])
    return Posterior(x[:, :2, 0], x[:, 2:, 0], p[:, :2, :2], (p[:, 2, 2] + p[:, 3, 3]) / 2)


def _motion(t: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return transition and process noise over each time, (n, 4, 4) each."""
    move = np.broadcast_to(np.eye(4), (len(t), 4, 4)).copy()
    move[:, 0, 2] = move[:, 1, 3] = t
    driven = np.zeros((len(t), 4, 4))
    for place, speed in ((0, 2), (1, 3)):
        driven[:, place, place] = t**3 / 3
        driven[:, place, speed] = driven[:, speed, place] = t**2 / 2
        driven[:, speed, speed] = t
    return move, driven * ACCELERATION_DENSITY


def _turned(matrices: FloatArray) -> FloatArray:
    return matrices.swapaxes(1, 2)


def _inverse(m: FloatArray) -> FloatArray:
    """Return the inverses of matrices, (n, 2, 2)."""
    flat = m.reshape(-1, 4)
    determinant = flat[:, 0] * flat[:, 3] - flat[:, 1] * flat[:, 2]
    adjugate = flat.take([3, 1, 2, 0], axis=1)
    adjugate *= _SIGNS
    adjugate /= determinant[:, None]
    return adjugate.reshape(-1, 2, 2)


_SIGNS = np.array([1.0, -1.0, -1.0, 1.0])


def _inverse_by_blocks(m: FloatArray) -> FloatArray:
    """Return the inverses of covariances of positions and velocities, (n, 4, 4), by their blocks."""
    result = np.empty_like(m)
    both = m[:, :2, 2:]
    position = _inverse(m[:, :2, :2])
    slope = position @ both
    velocity = _inverse(m[:, 2:, 2:] - _turned(both) @ slope)  # Schur's complement
    cross = -slope @ velocity
    result[:, :2, :2] = position - cross @ _turned(slope)
    result[:, :2, 2:], result[:, 2:, :2] = cross, _turned(cross)
    result[:, 2:, 2:] = velocity
    return result
