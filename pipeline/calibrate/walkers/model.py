"""Residuals of the fit of a pose to walkers, and their derivatives by the unknowns.

The residuals: the rows of the heads beside those that feet, heights and pose give; statures beside
what is expected of them; what is known of the lens, the place and its lengths. Statures are compared
by their logarithms: by their differences a smaller scene would fit better for nothing else than being
small, the more so the more people there are. The Jacobian is analytic and sparse: a head depends on the
pose and on one person. With P the row of a head, c and s the cosine and sine of the tilt,

    P = (Z y_f - T c) / D,   D = Z - T s
    dP/dZ = T (c - y_f s) / D^2,   dP/dT = -Z (c - y_f s) / D^2,   dP/dt = T (s + P c) / D

T being how tall the outline of a body seems, in metres (`optics.silhouette.per_stature`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.sparse import csr_matrix

from pipeline.calibrate.walkers.pose_prior import PosePrior
from pipeline.calibrate.walkers.segments import IMPOSSIBLE, Segments
from pipeline.calibrate.walkers.upright_edges import Uprights
from pipeline.core.arrays import FloatArray
from pipeline.optics.ground_plane import (
    depth_jacobian,
    foot_depth_m,
    remove_roll,
)
from pipeline.optics.silhouette import (
    REACH_COMMON_STD,
    per_stature,
    per_stature_jacobian,
)

# Cameras are put up upright; nothing else holds roll in a narrow view.
ROLL_STD_RAD = np.deg2rad(5.0)
# Shadows fall to one side, grass and the blur of small pictures are far away: boxes differ over the
# picture, and without allowance for that roll and tilt would seem sure. From side to side, by which those
# of the motion detector on 24 cameras differ by 0.4 % a standard deviation, that is an unknown where
# upright edges can tell it from roll; all else is considered in the covariance (`walkers_covariance`).
SIDE_STD = 0.005
# The unknowns: log camera height, tilt, roll, log of the mean of the people here over the population's,
# what all reaches have in common, how a lens bends upright edges (`calibrate.upright`), what boxes have
# in common on one side of the picture, and the height of each person.
ABOVE, TILT, ROLL, MEAN, REACH, BEND, SIDE, PEOPLE = range(8)
POSE = slice(ABOVE, MEAN)
_OF_A_HEAD = (ABOVE, TILT, ROLL, REACH, SIDE)  # beside the person's height


@dataclass(frozen=True, slots=True)
class Sample:
    """The observations that are used, by track number 0..p-1; points are normalised, roll and all."""

    foot: FloatArray  # (n, 2) the lower end of the silhouette
    head: FloatArray  # (n, 2) its upper end
    reach: FloatArray  # (n,) how far the lower end is before the axis, of the stature
    trends: FloatArray  # (n, 2) how far right, in standard deviations, and the log of how tall
    sigma: FloatArray  # (n,) of the head's row, normalised
    track: npt.NDArray[np.intp]  # (n,)
    weight: FloatArray  # (n,) the share of an independent observation that a row is
    track_id: npt.NDArray[np.int64]  # (p,) by the recording's count
    time_s: FloatArray  # (n,) of capture

    @property
    def people(self) -> int:
        """Number of them."""
        return len(self.track_id)


@dataclass(frozen=True, slots=True)
class Scale:
    """Knowledge beside the tracks: statures as they are expected, lengths, upright edges."""

    mean_m: FloatArray  # (p,)
    std_m: FloatArray  # (p,)
    of_population: npt.NDArray[np.bool_]  # (p,) whether the mean is the population's
    mean_std: float  # relative, of the mean of the people here about the population's
    segments: Segments
    uprights: Uprights
    bend_std: float  # of the lens's distortion, by k of `calibrate.upright`
    pose: PosePrior | None = None  # where somebody gave it, unsure

    @property
    def side_std(self) -> float:
        """Deviation of boxes from side to side; fixed where no edge tells it from roll."""
        return SIDE_STD if len(self.uprights) else SIDE_STD / 100

    @property
    def few(self) -> tuple[tuple[int, float], ...]:
        """Unknowns that are expected to be zero, and their standard deviations."""
        return (
            (ROLL, ROLL_STD_RAD),
            (MEAN, self.mean_std),
            (REACH, REACH_COMMON_STD),
            (BEND, self.uprights.bend_std),
            (SIDE, self.side_std),
        )


def predict(x: FloatArray, sample: Sample) -> FloatArray:
    """Return the rows at which the heads should be, without roll."""
    camera_height_m, tilt, roll, heights_m = np.exp(x[ABOVE]), x[TILT], x[ROLL], x[PEOPLE:]
    y_f = remove_roll(sample.foot, roll)[:, 1]
    y_h = remove_roll(sample.head, roll)[:, 1]
    z_m = foot_depth_m(camera_height_m, tilt, y_f)
    tall_m = heights_m[sample.track] * per_stature(y_h, tilt, sample.reach + x[REACH])
    tall_m = tall_m * (1.0 + sample.trends[:, 0] * x[SIDE])
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray((z_m * y_f - tall_m * np.cos(tilt)) / (z_m - tall_m * np.sin(tilt)))


def residuals(x: FloatArray, sample: Sample, scale: Scale) -> FloatArray:
    """Return how far everything is off, in standard deviations."""
    y_h = remove_roll(sample.head, x[ROLL])[:, 1]
    error = (y_h - predict(x, sample)) / sample.sigma
    # Feet above the horizon have no place on the ground.
    error = np.where(np.isfinite(error), error, IMPOSSIBLE) * np.sqrt(sample.weight)
    mean = np.log(scale.mean_m) + np.where(scale.of_population, x[MEAN], 0.0)
    people = (np.log(x[PEOPLE:]) - mean) * scale.mean_m / scale.std_m
    few = [x[unknown] / std for unknown, std in scale.few]
    edges = scale.uprights.off(x[TILT], x[ROLL], x[BEND])
    lengths = scale.segments.off(np.exp(x[ABOVE]), x[TILT], x[ROLL])
    given = np.empty(0) if scale.pose is None else scale.pose.off(x[POSE])
    return np.concatenate([error, people, few, lengths, edges, given])


def jacobian(x: FloatArray, sample: Sample, scale: Scale) -> csr_matrix:
    """Return how the residuals change with the unknowns, (residuals, unknowns)."""
    heads, people = len(sample.track), sample.people
    of_person = PEOPLE + np.arange(people)
    values, columns, counts = [head_slopes(x, sample)], [], [np.full(heads, len(_OF_A_HEAD) + 1)]
    shared = np.broadcast_to(_OF_A_HEAD, (heads, len(_OF_A_HEAD)))
    columns.append(np.column_stack([shared, PEOPLE + sample.track]))
    by_people = np.column_stack([-scale.of_population.astype(np.float64), 1.0 / x[PEOPLE:]])
    values.append(by_people * (scale.mean_m / scale.std_m)[:, None])
    columns.append(np.column_stack([np.full(people, MEAN), of_person]))
    counts.append(np.full(people, 2))
    values.append(np.array([1.0 / std for _, std in scale.few]))
    columns.append(np.array([unknown for unknown, _ in scale.few]))
    counts.append(np.ones(len(scale.few), dtype=int))
    lengths = scale.segments.off_jacobian(np.exp(x[ABOVE]), x[TILT], x[ROLL])
    values.append(lengths)
    columns.append(np.broadcast_to((ABOVE, TILT, ROLL), lengths.shape))
    counts.append(np.full(len(lengths), 3))
    edges = scale.uprights.off_jacobian(x[TILT], x[ROLL])
    values.append(edges)
    columns.append(np.broadcast_to((TILT, ROLL, BEND), edges.shape))
    counts.append(np.full(len(edges), 3))
    if scale.pose is not None:
        values.append(scale.pose.whitening)
        columns.append(np.broadcast_to((ABOVE, TILT, ROLL), (3, 3)))
        counts.append(np.full(3, 3))
    ends = np.concatenate([[0], np.cumsum(np.concatenate(counts))])
    return csr_matrix(
        (np.concatenate([v.ravel() for v in values]), _flat(columns), ends),
        shape=(len(ends) - 1, PEOPLE + people),
    )


def _flat(parts: list[npt.NDArray[np.intp]]) -> npt.NDArray[np.intp]:
    return np.concatenate([part.ravel() for part in parts])


def head_slopes(x: FloatArray, sample: Sample) -> FloatArray:
    """Return the derivatives of the heads' residuals by `_OF_A_HEAD` and the person's height."""
    above_m, tilt, roll = np.exp(x[ABOVE]), x[TILT], x[ROLL]
    cos, sin = np.cos(tilt), np.sin(tilt)
    foot, head = remove_roll(sample.foot, roll), remove_roll(sample.head, roll)
    (x_f, y_f), (x_h, y_h) = foot.T, head.T
    reach = sample.reach + x[REACH]
    z_m = foot_depth_m(above_m, tilt, y_f)
    by_above, z_by_tilt, z_by_roll, _ = depth_jacobian(above_m, tilt, x_f, y_f)
    height_m = x[PEOPLE:][sample.track]
    sided = 1.0 + sample.trends[:, 0] * x[SIDE]
    seeming = per_stature(y_h, tilt, reach) * sided
    tall_m = height_m * seeming
    per_y, per_tilt, per_reach = (
        height_m * sided * slope for slope in per_stature_jacobian(y_h, tilt, reach)
    )
    with np.errstate(invalid="ignore", divide="ignore"):
        below = z_m - tall_m * sin
        row = (z_m * y_f - tall_m * cos) / below
        ahead = (cos - y_f * sin) / below**2
        by_depth, by_tall = tall_m * ahead, -z_m * ahead
        slopes = [
            by_depth * by_above * above_m,
            by_depth * z_by_tilt + by_tall * per_tilt + tall_m * (sin + row * cos) / below,
            by_depth * z_by_roll + by_tall * per_y * x_h + z_m / below * x_f - x_h,
            by_tall * per_reach,
            by_tall * height_m * seeming / sided * sample.trends[:, 0],
            by_tall * seeming,
        ]
        scaled = -np.stack(slopes, axis=1) * (np.sqrt(sample.weight) / sample.sigma)[:, None]
        possible = np.isfinite(row)
    return np.where(possible[:, None], scaled, 0.0)
