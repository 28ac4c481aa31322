"""Aperture sweeps: where the aperture changes while objects stand still, blur tells its own floor.

Of one object the variance of blur is floor + u^2 (a v / 2p)^2, a straight line over the last factor. All
objects of a camera share the floor, each has its own u^2: weighted least squares of both together.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd

from pipeline.core.arrays import FloatArray, IntArray
from pipeline.estimate.types import Measured, SweepFloor

# An object stands still while its box moves and grows by no more than this share of its size: twice
# the error of a box of fifty pixels, and 3 % of the depth.
STILL = 0.03
# The f-numbers of a sweep are two stops apart at least, a factor of four in the line's abscissa.
LEAST_RATIO = 1.9
# What is believed beforehand steadies a sweep that hardly tells the floor, and gives way to one that
# does: cameras that are softer than the default allows are why one sweeps.
PRIOR_WIDENED = 4.0
# The floor is the same in all parts of a picture, at all apertures and in all light only about so well.
LEAST_STD_PX = 0.02
# A point this far off the line is not on it, in standard deviations.
OUTLIER = 4.0
ROUNDS = 3


@dataclass(frozen=True, slots=True)
class Sweeps:
    """Fit of all sweeps: the floor, and u^2 of the observations that belong to one (NaN elsewhere)."""

    floor_px2: float
    floor_px2_std: float
    u2: FloatArray
    u2_std: FloatArray
    count: int
    rounds: tuple[SweepFloor, ...]

    @property
    def floor_px_std(self) -> float:
        """Standard deviation of the floor as a width."""
        return self.floor_px2_std / (2 * float(np.sqrt(max(self.floor_px2, 1e-6))))


def solve(
    m: Measured,
    variance: FloatArray,
    std: FloatArray,
    per_dioptre2: FloatArray,
    floor: tuple[FloatArray, FloatArray],
    rounds: tuple[SweepFloor, ...] | None = None,
) -> Sweeps | None:
    """Return the floor and the objects' u^2 by all sweeps of a camera; None where there is none.

    Args:
        m: the observations.
        variance: of their blur, diffraction taken off, px^2.
        std: its standard deviation.
        per_dioptre2: (a v / 2p)^2, px^2.
        floor: what is believed of the floor, px^2, and how surely; a poor sweep does not overrule it.
        rounds: what the sweeps of the whole camera said, where these are some of them.
    """
    group = _sweeps(m, np.isfinite(variance) & (std > 0))
    rows = np.flatnonzero(group >= 0)
    if not len(rows):
        nothing = np.full(len(m), np.nan)
        return (
            Sweeps(rounds[-1].px2, _unsure(rounds[-1]), nothing, nothing, 0, rounds)
            if rounds
            else None
        )
    g = group[rows]
    x, y = per_dioptre2[rows], variance[rows]
    weight = 1.0 / std[rows] ** 2
    prior, prior_std = (float(np.nanmedian(f[rows])) for f in floor)
    prior_std *= PRIOR_WIDENED
    said: list[SweepFloor] = []
    for number in range(ROUNDS):
        known = rounds[number] if rounds else None
        found, slope, slope_std, by_floor, off = _line(g, x, y, weight, prior, prior_std, known)
        weight = np.where(np.abs(off) > OUTLIER, 0.0, weight)
        said.append(found)
    found_std = _unsure(found)
    u2, u2_std = np.full(len(m), np.nan), np.full(len(m), np.nan)
    u2[rows] = slope[g]
    u2_std[rows] = np.hypot(slope_std[g], by_floor[g] * found_std)
    return Sweeps(found.px2, found_std, u2, u2_std, int(g.max()) + 1, tuple(said))


def _unsure(floor: SweepFloor) -> float:
    """Return the standard deviation of a floor, px^2."""
    return float(np.hypot(floor.px2_std, 2 * np.sqrt(max(floor.px2, 0.0)) * LEAST_STD_PX))


def _line(
    g: IntArray,
    x: FloatArray,
    y: FloatArray,
    weight: FloatArray,
    prior: float,
    prior_std: float,
    known: SweepFloor | None,
) -> tuple[SweepFloor, FloatArray, FloatArray, FloatArray, FloatArray]:
    """Fit y = floor + slope_g x; return floor, slopes, their deviations, and residuals over theirs.

    The slopes are eliminated from the normal equations. Where points scatter more than they should,
    deviations grow with it (the scale factor of the Particle Data Group).
    """
    n = int(g.max()) + 1

    def total(values: FloatArray) -> FloatArray:
        return np.asarray(np.bincount(g, values, minlength=n), dtype=np.float64)

    w, wx, wy = total(weight), total(weight * x), total(weight * y)
    wxx, wxy = np.maximum(total(weight * x * x), 1e-30), total(weight * x * y)
    certain = np.maximum(w - wx**2 / wxx, 0.0).sum()
    by_sweep = (wy - wxy * wx / wxx).sum()
    floor = (by_sweep + prior / prior_std**2) / (certain + 1 / prior_std**2)
    floor = float(floor) if known is None else known.px2
    slope = (wxy - wx * floor) / wxx
    off = (y - floor - slope[g] * x) * np.sqrt(weight)
    found = known
    if found is None:
        free = max((weight > 0).sum() - n - 1, 1)
        scale = max(float(np.sqrt((off**2).sum() / free)), 1.0)
        floor_std = 1.0 / np.sqrt(certain / scale**2 + 1 / prior_std**2)
        found = SweepFloor(floor, float(floor_std), scale)
    return found, slope, found.scale / np.sqrt(wxx), wx / wxx, off / found.scale


def _sweeps(m: Measured, usable: np.ndarray) -> IntArray:
    """Return the number of the sweep that each observation belongs to, -1 for none, (n,)."""
    frame = pd.DataFrame(m.bbox_xyxy_px, columns=["x0", "y0", "x1", "y1"])
    frame["track"], frame["time"] = m.track_id, m.capture_time_ns
    frame["s"], frame["f"], frame["n"] = m.focus_distance_m, m.focal_length_mm, m.f_number
    frame["usable"] = usable
    frame = frame.sort_values(["track", "time"])
    sides = frame[["x0", "y0", "x1", "y1"]]
    tall = pd.concat([frame["y1"] - frame["y0"], frame["x1"] - frame["x0"]], axis=1).max(axis=1)
    slack = STILL * tall.to_numpy(dtype=np.float64)
    moved = sides.diff().abs().max(axis=1).to_numpy() > slack
    settings = frame[["track", "s", "f"]]
    changed = settings.ne(settings.shift()).any(axis=1).to_numpy()
    run = pd.Series(np.cumsum(moved | changed), index=frame.index)
    # Slow motion is no standing still: an object that drifts away from where its run began.
    drift = (sides - sides.groupby(run).transform("first")).abs().max(axis=1).to_numpy()
    run = run.where(drift <= slack, -1)
    used = frame["usable"] & (run >= 0)
    apertures = frame["n"].where(used).groupby(run)
    ratio = apertures.transform("max") / apertures.transform("min")
    run = run.where(used & (ratio >= LEAST_RATIO), -1)
    codes = pd.Series(pd.factorize(run.where(run >= 0))[0], index=frame.index)
    return codes.reindex(np.arange(len(m))).to_numpy(dtype=np.int64)
