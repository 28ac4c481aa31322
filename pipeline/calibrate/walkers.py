"""The camera's height, tilt and roll from the people who walk before it.

Each person's height is the same all along the track, near and far: that fixes the tilt, the roll and
the ratio of every height to the camera's. The population's mean stature fixes the scale. Robust
nonlinear least squares over the rows of the heads, given the feet:

    y_h = (Z y_f - H' cos t) / (Z - H' sin t),   Z = h_c / (y_f cos t + sin t)

H' being how tall a body of the height H seems from there (`optics.silhouette.per_stature`),
with the pose (h_c, t, roll), one height H a person, and the ratio of the mean of the people here to the
population's as unknowns. Where somebody's height is known, or how far apart two points on the ground
are, that fixes the scale instead of the population.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
import pandas as pd
from scipy.optimize import OptimizeResult, least_squares

from pipeline.calibrate.upright import NO_UPRIGHTS, Uprights, find_uprights
from pipeline.calibrate.walkers_model import (
    ABOVE,
    PEOPLE,
    REACH,
    ROLL,
    TILT,
    TREND_STD,
    Sample,
    Scale,
    jacobian,
    predict,
    residuals,
)
from pipeline.config import SizePrior
from pipeline.errors import CalibrationUndetermined, UsageError
from pipeline.estimate.columns import Measured
from pipeline.estimate.gait import GAIT_DROP_M, GAIT_DROP_STD_M
from pipeline.estimate.geometry import Geometry, camera_of
from pipeline.estimate.reach import reach_of
from pipeline.estimate.repeats import BOX_COMMON_STD, CORRELATION_S, independent_share
from pipeline.estimate.smoother import smooth_tracks
from pipeline.optics.ground_plane import (
    add_roll,
    foot_depth_m,
    height_m,
    remove_roll,
)
from pipeline.optics.silhouette import (
    UNKNOWN_REACH_STD,
    mean_reach,
    per_stature,
    steepness,
)
from pipeline.quality import assess
from pipeline.records import FloatArray, GroundPlane

# Two people give a line of sight each for tilt and height; below four, one who stoops decides.
MIN_PEOPLE = 4
# A track tells something only if the person came nearer or went away: their height in the picture
# must change, or others must be seen at other distances (checked by the standard errors).
MIN_OBSERVATIONS = 8
ROWS_AT_ONCE = 20_000  # observations, from which those are chosen
MAX_PER_TRACK = 40  # more of a track's frames say the same thing again
# Chance leaves the mean stature of so many uncertain by 0.09 / sqrt(150) m = 7 mm, a seventh of
# `POPULATION_MEAN_STD_M`; a day has tens of thousands, and the fit's time grows faster than their number.
MAX_PEOPLE = 150
# A walker's head rises and falls by about 2 cm either side, and the box's foot is now one foot, now
# the other (Whittle, Gait Analysis: vertical excursion of the trunk 46 mm).
GAIT_STD = 0.02  # of the stature
# Where something here is known in metres it decides; the population still keeps a fit from running off.
FREE_MEAN_STD = 0.3  # relative
MIN_VARIANCE_RATIO = 0.5  # see covariance_of
# The result must be this well determined to be of use.
MAX_HEIGHT_ERROR = 0.15  # standard error of the camera's height, relative
MAX_TILT_ERROR_RAD = np.deg2rad(5.0)
# A track this many standard deviations of the population's stature from the median is not one grown
# person: of a hundred people one is lost, of groups and fragments most.
MAX_DEVIATION = 2.6
MAX_REJECTIONS = 4
UPRIGHT_TILT_STD_RAD = np.deg2rad(1.5)  # about the tilt found, upright edges are looked for
REFINEMENTS = 2  # which way people walk is known better with each pose; the second moves it little
USUAL_M = 1.7
USUAL_TILT_RAD = np.deg2rad(20.0)  # before there is one
TILTS_RAD = np.deg2rad([2.0, 8.0, 15.0, 25.0, 35.0, 50.0])


@dataclass(frozen=True, slots=True)
class KnownHeight:
    """The height of one person when standing, with shoes."""

    track_id: int
    height_m: float
    std_m: float = 0.01


@dataclass(frozen=True, slots=True)
class KnownDistance:
    """How far apart two points on the ground are, each given by its pixel."""

    points_px: FloatArray  # (2, 2)
    distance_m: float
    std_m: float = 0.0  # of the survey
    std_px: float = 1.0  # of the points, as somebody marks them


@dataclass(frozen=True, slots=True)
class Known:
    """What is known of a scene in metres; each overrides the stature of the population."""

    heights: tuple[KnownHeight, ...] = ()
    distances: tuple[KnownDistance, ...] = ()

    def __bool__(self) -> bool:
        return bool(self.heights or self.distances)


NOTHING_KNOWN = Known()


@dataclass(frozen=True, slots=True)
class WalkersReport:
    """How well the people determined the pose."""

    people: int
    observations: int
    residual_px: float  # robust spread of the heads about the fit
    depth_ratio: float  # farthest over nearest depth of an observation
    camera_height_std_m: float
    tilt_std_rad: float
    roll_std_rad: float
    uprights: int = 0  # edges of the place that were taken for vertical


def calibrate_from_walkers(
    measured: Measured,
    prior: SizePrior,
    known: Known = NOTHING_KNOWN,
    lines_px: FloatArray | None = None,
) -> tuple[GroundPlane, WalkersReport]:
    """Return the pose of the camera with its covariance, and how well it is determined.

    Args:
        measured: the observations of one camera; its intrinsics must be known.
        prior: stature of the population, mean and spread.
        known: what is known of this scene in metres.
        lines_px: straight edges of the place, x0 y0 x1 y1, (m, 4); those that are upright help.

    Raises:
        CalibrationUndetermined: too few people, or their tracks do not fix the pose.
        UsageError: what is known is of somebody who is not there, or makes no sense.
    """
    check_known(known, measured)
    measured, people = chosen_tracks(measured, prior, known)
    sample = sample_of(measured, prior, people)
    check_enough(sample)
    sample, best = _fit_alike(sample, prior, known, measured)
    uprights = NO_UPRIGHTS
    for _ in range(REFINEMENTS):
        chosen = set(sample.track_id.tolist())
        again = sample_of(measured, prior, people, plane_of(best))
        sample = only(again, np.array([i in chosen for i in again.track_id.tolist()]))
        uprights = uprights_at(lines_px, measured, best)
        sample, best = _fit_alike(sample, prior, known, measured, best, uprights)
    covariance = covariance_of(best, sample, uprights)
    plane = replace(plane_of(best), covariance=covariance, source="walkers")
    std = np.sqrt(np.diag(covariance))
    check_determined(plane)
    report = report_of(best, sample, measured, std, len(uprights))
    return plane, report


def check_enough(sample: Sample) -> None:
    """Refuse too few people."""
    if sample.people < MIN_PEOPLE:
        raise CalibrationUndetermined(
            f"{sample.people} people were followed well enough to find the camera's pose, "
            f"{MIN_PEOPLE} are needed",
            remedy="Give camera_height_m and tilt_deg in a camera file, or a longer recording",
        )


def check_determined(plane: GroundPlane) -> None:
    """Refuse a pose that is too unsure to be of use."""
    std = np.sqrt(np.diag(plane.covariance))
    above_m, tilt = plane.camera_height_m, plane.tilt_rad
    if std[0] > MAX_HEIGHT_ERROR * above_m or std[1] > MAX_TILT_ERROR_RAD or tilt < 0:
        raise CalibrationUndetermined(
            f"the tracks do not fix the camera's pose: height {above_m:.1f} ± {std[0]:.1f} m, "
            f"tilt {np.rad2deg(tilt):.1f} ± {np.rad2deg(std[1]):.1f} degrees",
            remedy="Give camera_height_m and tilt_deg in a camera file, or a longer recording",
        )


def _fit_alike(
    sample: Sample,
    prior: SizePrior,
    known: Known,
    measured: Measured,
    before: OptimizeResult | None = None,
    uprights: Uprights = NO_UPRIGHTS,
) -> tuple[Sample, OptimizeResult]:
    """Fit, leave out whom the fit shows not to be one grown person, and fit again."""
    scale = scale_of(sample, prior, known, measured, uprights)
    best = best_fit(sample, scale, before)
    for _ in range(MAX_REJECTIONS):
        # Somebody whose height is known may be as tall as they like.
        alike = are_alike(sample, best, prior) | ~scale.of_population
        if alike.all() or alike.sum() < MIN_PEOPLE:
            break
        sample = only(sample, alike)
        scale = scale_of(sample, prior, known, measured, uprights)
        best = best_fit(sample, scale, best)
    return sample, best


def scale_of(
    sample: Sample, prior: SizePrior, known: Known, measured: Measured, uprights: Uprights
) -> Scale:
    """Return what is known beside the tracks."""
    walking_m = prior.mean_m - GAIT_DROP_M
    mean_m, std_m = np.full((2, sample.people), [[walking_m], [prior.std_m]])
    of_population = np.ones(sample.people, dtype=np.bool_)
    for person in known.heights:
        mine = sample.track_id == person.track_id
        mean_m[mine], of_population[mine] = person.height_m - GAIT_DROP_M, False
        std_m[mine] = np.hypot(person.std_m, GAIT_DROP_STD_M)
    mean_std = FREE_MEAN_STD if known else prior.mean_uncertainty_m / prior.mean_m
    mean_std = float(np.hypot(mean_std, BOX_COMMON_STD))
    camera = camera_of(measured.intrinsics) if measured.intrinsics else None
    points = [
        camera.normalize(np.asarray(d.points_px, dtype=np.float64))
        for d in known.distances
        if camera is not None
    ]
    return Scale(
        mean_m,
        std_m,
        of_population,
        mean_std,
        np.array(points).reshape(-1, 2, 2),
        np.array([d.distance_m for d in known.distances]),
        np.array([_relative_std(d) for d in known.distances]),
        uprights,
    )


def _relative_std(known: KnownDistance) -> float:
    """Return the relative standard deviation of a distance: survey, and marks of two points."""
    apart_px = float(np.linalg.norm(np.diff(known.points_px, axis=0)))
    return float(np.hypot(known.std_m / known.distance_m, np.sqrt(2) * known.std_px / apart_px))


def uprights_at(lines_px: FloatArray | None, measured: Measured, fit: OptimizeResult) -> Uprights:
    """Return the edges of the place that are upright, looked for about the tilt that was found."""
    if lines_px is None or measured.intrinsics is None or not len(lines_px):
        return NO_UPRIGHTS
    return find_uprights(lines_px, measured.intrinsics, float(fit.x[1]), UPRIGHT_TILT_STD_RAD)


def plane_of(fit: OptimizeResult) -> GroundPlane:
    """Return the pose of a fit."""
    return GroundPlane(float(np.exp(fit.x[0])), float(fit.x[1]), float(fit.x[2]))


def check_known(known: Known, measured: Measured) -> None:
    """Refuse what is known if it makes no sense."""
    for person in known.heights:
        if not (measured.track_id == person.track_id).any():
            raise UsageError(f"there is no track {person.track_id} of camera {measured.camera!r}")
        if not (0.2 < person.height_m < 3.0 and person.std_m > 0):
            raise UsageError(f"nobody is {person.height_m} m tall")
    for distance in known.distances:
        if not (distance.distance_m > 0 and np.ptp(distance.points_px, axis=0).max() > 1):
            raise UsageError("a known distance needs two points that are apart, and its length")


def chosen_tracks(
    measured: Measured, prior: SizePrior, known: Known
) -> tuple[Measured, npt.NDArray[np.int64]]:
    """Return the tracks to learn from, spread over the recording, and what is in their frames."""
    ids, first, count = np.unique(
        measured.track_id[measured.class_name == prior.object_class],
        return_index=True,
        return_counts=True,
    )
    ids = ids[count >= MIN_OBSERVATIONS][np.argsort(first[count >= MIN_OBSERVATIONS])]
    if len(ids) <= MAX_PEOPLE:
        return measured, ids
    chosen = np.union1d(spread_people(ids), [person.track_id for person in known.heights])
    frames = np.unique(measured.frame_index[np.isin(measured.track_id, chosen)])
    return measured.take(np.isin(measured.frame_index, frames)), chosen.astype(np.int64)


def spread_people(ids: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
    """Return no more than `MAX_PEOPLE` tracks, spread over all, in their order."""
    if len(ids) <= MAX_PEOPLE:
        return ids
    return ids[np.unique(np.linspace(0, len(ids) - 1, MAX_PEOPLE).astype(int))]


def sample_of(
    measured: Measured,
    prior: SizePrior,
    people: npt.NDArray[np.int64],
    plane: GroundPlane | None = None,
) -> Sample:
    """Choose as `_sample_of` does, from some tracks after the others: memory is that of a few."""
    ids, count = np.unique(
        measured.track_id[np.isin(measured.track_id, people)], return_counts=True
    )
    turn = (np.cumsum(count) - 1) // ROWS_AT_ONCE
    if len(np.unique(turn)) < 2:
        return _sample_of(measured, prior, people, plane)
    parts = [
        _sample_of(measured.only(ids[turn == number]), prior, people, plane)
        for number in np.unique(turn)
    ]
    first = np.cumsum([0, *(part.people for part in parts)])
    foot, head, reach, sigma, weight, track_id, time_s = (
        np.concatenate([getattr(part, name) for part in parts])
        for name in ("foot", "head", "reach", "sigma", "weight", "track_id", "time_s")
    )
    track = np.concatenate([p.track + begin for p, begin in zip(parts, first, strict=False)])
    trends = _trends(foot, foot[:, 1] - head[:, 1]) if len(foot) else np.empty((0, 2))
    return Sample(foot, head, reach, trends, sigma, track, weight, track_id, time_s)


def _sample_of(
    measured: Measured,
    prior: SizePrior,
    people: npt.NDArray[np.int64],
    plane: GroundPlane | None,
) -> Sample:
    """Choose whole, unhidden people, spread over each track; a pose tells more of their outlines."""
    usable = (
        (measured.class_name == prior.object_class)
        & np.isin(measured.track_id, people)
        & ~measured.truncated.any(axis=1)
        & (measured.occlusion < 0.05)
        & assess(measured).ends_visible
    )
    empty = Sample(
        *(np.empty((0, 2)),) * 2,
        np.empty(0),
        np.empty((0, 2)),
        np.empty(0),
        np.empty(0, np.intp),
        np.empty(0),
        _NOBODY,
        np.empty(0),
    )
    if measured.intrinsics is None or not usable.any():
        return empty
    rows: list[npt.NDArray[np.intp]] = []
    tracks: list[npt.NDArray[np.intp]] = []
    weights: list[FloatArray] = []
    ids: list[int] = []
    use = np.flatnonzero(usable)
    use = use[np.argsort(measured.track_id[use], kind="stable")]
    kept_ids, starts = np.unique(measured.track_id[use], return_index=True)
    for track_id, mine in zip(kept_ids, np.split(use, starts[1:]), strict=True):
        if len(mine) < MIN_OBSERVATIONS:
            continue
        span_s = np.ptp(measured.capture_time_ns[mine]) / 1e9
        chosen = mine[np.unique(np.linspace(0, len(mine) - 1, MAX_PER_TRACK).astype(int))]
        independent = min(len(chosen), max(span_s / CORRELATION_S, 1.0))
        rows.append(chosen)
        tracks.append(np.full(len(chosen), len(tracks), dtype=np.intp))
        weights.append(np.full(len(chosen), independent / len(chosen)))
        ids.append(int(track_id))
    if not rows:
        return empty
    index = np.concatenate(rows)
    foot, head, reach, reach_std, tilt = _ends(measured, plane)
    foot = _smoothed(measured, foot, head, usable)
    foot, head, reach, reach_std = foot[index], head[index], reach[index], reach_std[index]
    std_px = np.hypot(measured.std_xyxy_px[index, 1], measured.std_xyxy_px[index, 3])
    tall = foot[:, 1] - head[:, 1]
    steep, _ = steepness(head[:, 1], tilt)
    own = np.hypot(GAIT_STD, reach_std * np.nan_to_num(steep))
    sigma = np.hypot(std_px / measured.intrinsics.fy_px, own * tall)
    return Sample(
        foot,
        head,
        reach,
        _trends(foot, tall),
        sigma,
        np.concatenate(tracks),
        np.concatenate(weights),
        np.array(ids),
        measured.capture_time_ns[index] / 1e9,
    )


def _trends(foot: FloatArray, tall: FloatArray) -> FloatArray:
    """Return how far right and how near each observation is, (n, 2), in standard deviations."""
    both = np.column_stack([foot[:, 0], np.log(np.maximum(tall, 1e-6))])
    return np.asarray((both - both.mean(axis=0)) / np.maximum(both.std(axis=0), 1e-6))


def _smoothed(
    measured: Measured, foot: FloatArray, head: FloatArray, usable: npt.NDArray[np.bool_]
) -> FloatArray:
    """Return the feet smoothed along the tracks, (n, 2).

    The fit takes them as exact. What is not makes who seems nearer seem taller as well, and so draws the
    tilt down (regression dilution); smoothing leaves less of it. Lengths are shares of the person here,
    as metres are not known yet.
    """
    tall = foot[:, 1] - head[:, 1]
    unit = pd.Series(tall).groupby(measured.track_id).transform("median").to_numpy() / USUAL_M
    lens = measured.intrinsics
    if lens is None:
        return foot
    std = np.hypot(measured.std_xyxy_px[:, 3] / lens.fy_px, GAIT_STD * np.abs(tall)) / unit
    covariance = (std**2 / independent_share(measured))[:, None, None] * np.eye(2)
    seen = np.where(usable[:, None], foot / unit[:, None], np.nan)
    time_s = (measured.capture_time_ns - measured.capture_time_ns.min()) / 1e9
    smoothed = smooth_tracks(measured.track_id, time_s, seen, covariance)
    rows = np.where(usable, smoothed.position_m[:, 1] * unit, foot[:, 1])
    return np.column_stack([foot[:, 0], np.where(np.isfinite(rows), rows, foot[:, 1])])


def _ends(
    measured: Measured, plane: GroundPlane | None
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, float]:
    """Return the ends of silhouettes as seen, with the roll, their reach and its spread, and a tilt.

    Which way somebody walks, and how they lean in the picture, is known once there is a pose.
    """
    count = len(measured)
    geometry = Geometry(measured)
    if plane is None:
        reach = np.full(count, mean_reach(np.tan(USUAL_TILT_RAD)))
        reach_std = np.full(count, UNKNOWN_REACH_STD)
        return geometry.foot, geometry.head, reach, reach_std, USUAL_TILT_RAD
    posed = replace(measured, ground_plane=plane)
    leaning = Geometry(posed)
    roll = plane.roll_rad
    foot, head = add_roll(leaning.foot, roll), add_roll(leaning.head, roll)
    return foot, head, *reach_of(posed, plane), plane.tilt_rad


_NOBODY = np.empty(0, dtype=np.int64)


def best_fit(sample: Sample, scale: Scale, before: OptimizeResult | None = None) -> OptimizeResult:
    """Return the fit from where one was before, or the better from the two most promising tilts."""
    if before is not None and before.x[1] > 0:
        return _fit(sample, scale, float(before.x[1]))
    starts = sorted(TILTS_RAD, key=lambda tilt: _start_cost(sample, scale, tilt))
    fits = [_fit(sample, scale, tilt) for tilt in starts[:2]]
    return min(fits, key=lambda fit: float(fit.cost))


def are_alike(sample: Sample, fit: OptimizeResult, prior: SizePrior) -> npt.NDArray[np.bool_]:
    """Return which tracks, (p,), may be of grown people, one a box: as tall as the others.

    Two people in one box are twice as tall, a bag or half a person half as tall; what a pose gives is
    compared with the median of all, so that the scale need not be right yet.
    """
    pose = fit.x.copy()
    y_f = remove_roll(sample.foot, pose[2])[:, 1]
    y_h = remove_roll(sample.head, pose[2])[:, 1]
    z_m = foot_depth_m(np.exp(pose[0]), pose[1], y_f)
    tall_m = height_m(z_m, y_f, y_h, pose[1])
    tall_m = tall_m / per_stature(y_h, pose[1], sample.reach + pose[REACH])
    typical_m = np.array([np.nanmedian(tall_m[sample.track == t]) for t in range(sample.people)])
    relative = typical_m / np.nanmedian(typical_m) - 1
    return np.abs(relative) < MAX_DEVIATION * prior.std_m / prior.mean_m


def only(sample: Sample, kept: npt.NDArray[np.bool_]) -> Sample:
    """Return the observations of the tracks that are kept, numbered anew."""
    rows = kept[sample.track]
    number = np.cumsum(kept) - 1
    return Sample(
        sample.foot[rows],
        sample.head[rows],
        sample.reach[rows],
        sample.trends[rows],
        sample.sigma[rows],
        number[sample.track[rows]],
        sample.weight[rows],
        sample.track_id[kept],
        sample.time_s[rows],
    )


def _start(sample: Sample, scale: Scale, tilt: float) -> FloatArray:
    """Return unknowns to start from at a tilt: everybody is as tall as is expected of them."""
    above_m = _height_for(sample, scale, tilt)
    return np.concatenate(
        [[np.log(above_m), tilt, scale.uprights.roll_rad, *np.zeros(PEOPLE - 3)], scale.mean_m]
    )


def _start_cost(sample: Sample, scale: Scale, tilt: float) -> float:
    """Return how badly a start fits, each residual counting no more than a bad one."""
    off = residuals(_start(sample, scale, tilt), sample, scale)
    return float(np.minimum(np.abs(off), 5.0).sum())


def _fit(sample: Sample, scale: Scale, tilt: float) -> OptimizeResult:
    start = _start(sample, scale, tilt)
    low = [np.log(0.3), np.deg2rad(-10), -0.35, -1.0, -0.3, -1.0, -0.1, *(0.4 * scale.mean_m)]
    high = [np.log(200.0), np.deg2rad(89), 0.35, 1.0, 0.3, 1.0, 0.1, *(1.6 * scale.mean_m)]
    return least_squares(
        residuals,
        start,
        jac=jacobian,
        args=(sample, scale),
        loss="soft_l1",
        f_scale=1.5,
        bounds=(low, high),
        x_scale="jac",
        max_nfev=200,
    )


def _height_for(sample: Sample, scale: Scale, tilt: float) -> float:
    """Return the camera height that gives people their expected stature at a tilt, in the median."""
    y_f, y_h = sample.foot[:, 1], sample.head[:, 1]
    unit_m = height_m(foot_depth_m(1.0, tilt, y_f), y_f, y_h, tilt)
    unit_m = unit_m / per_stature(y_h, tilt, sample.reach)
    typical = np.nanmedian(unit_m) if np.isfinite(unit_m).any() else np.nan
    return float(np.clip(np.median(scale.mean_m) / typical, 0.5, 100.0)) if typical > 0 else 5.0


def covariance_of(
    fit: OptimizeResult,
    sample: Sample,
    uprights: Uprights,
    wanted: Sequence[int] = (ABOVE, TILT, ROLL),
) -> FloatArray:
    """Return the covariance of (camera height, tilt, roll), or of the unknowns `wanted` from the first.

    From the Jacobian at the solution; the spread of the heads is taken from their residuals, while
    that of statures and distances stays as it is known. Residuals do not show what a track's boxes
    have in common, so they may not say less than half of the stated variance (with this bound the
    intervals of `python -m bench.walkers` hold what they should).
    """
    jacobian = fit.jac.toarray() if hasattr(fit.jac, "toarray") else np.asarray(fit.jac)
    rows = len(sample.track)
    freedom = max(sample.weight.sum() - PEOPLE - sample.people, 1.0)
    excess = float((np.minimum(np.abs(fit.fun[:rows]), 3) ** 2).sum() / freedom)
    loose = max(excess, MIN_VARIANCE_RATIO)
    jacobian[:rows] /= np.sqrt(loose)
    inverse = np.linalg.pinv(jacobian.T @ jacobian, rcond=1e-12)
    # Boxes that are too tall near by, or on one side, by a share: what that does to the fit (consider
    # analysis, as in Tapley, Schutz and Born, Statistical Orbit Determination, section 6.5).
    tall = sample.foot[:, 1] - sample.head[:, 1]
    per_share = tall / sample.sigma * np.sqrt(sample.weight / loose)
    considered = sample.trends if not len(uprights) else sample.trends[:, 1:]
    moved = inverse @ (jacobian[:rows].T @ (considered * per_share[:, None])) * TREND_STD
    covariance = (inverse + moved @ moved.T)[np.ix_(wanted, wanted)]
    to_metres = np.diag([float(np.exp(fit.x[0])), *np.ones(len(wanted) - 1)])
    return np.asarray(to_metres @ covariance @ to_metres)


def report_of(
    fit: OptimizeResult, sample: Sample, measured: Measured, std: FloatArray, uprights: int
) -> WalkersReport:
    """Return how well a fit is determined; `std` is of camera height, tilt and roll."""
    error = remove_roll(sample.head, fit.x[2])[:, 1] - predict(fit.x, sample)
    focal_px = measured.intrinsics.fy_px if measured.intrinsics else np.nan
    y_f = remove_roll(sample.foot, fit.x[2])[:, 1]
    depth_m = foot_depth_m(np.exp(fit.x[0]), fit.x[1], y_f)
    return WalkersReport(
        people=sample.people,
        observations=len(sample.track),
        residual_px=float(1.4826 * np.nanmedian(np.abs(error)) * focal_px),
        depth_ratio=float(np.nanmax(depth_m) / np.nanmin(depth_m)),
        camera_height_std_m=float(std[0]),
        tilt_std_rad=float(std[1]),
        roll_std_rad=float(std[2]),
        uprights=uprights,
    )
