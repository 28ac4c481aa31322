"""Choice of the observations that a pose is learned from: whole, unhidden people, spread over time."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pandas as pd

from pipeline.calibrate.walkers.known_lengths import GAIT_STD, USUAL_M, KnownLengths
from pipeline.calibrate.walkers.model import Sample
from pipeline.core.arrays import FloatArray
from pipeline.core.config import SizePrior
from pipeline.core.records import GroundPlane
from pipeline.estimate.boxes.error_correlation import CORRELATION_S, independent_share
from pipeline.estimate.boxes.geometry import Geometry
from pipeline.estimate.boxes.quality import assess
from pipeline.estimate.boxes.reach import reach_of
from pipeline.estimate.fusion.smoother import smooth_tracks
from pipeline.estimate.types import Measured
from pipeline.optics.ground_plane import add_roll
from pipeline.optics.silhouette import UNKNOWN_REACH_STD, mean_reach, steepness

# A track tells something only if the person came nearer or went away: their height in the picture
# must change, or others must be seen at other distances (checked by the standard errors).
MIN_OBSERVATIONS = 8
ROWS_AT_ONCE = 20_000  # observations, from which those are chosen
MAX_PER_TRACK = 40  # more of a track's frames say the same thing again
# Chance leaves the mean stature of so many uncertain by 0.09 / sqrt(150) m = 7 mm, a seventh of
# `POPULATION_MEAN_STD_M`; a day has tens of thousands, and the fit's time grows faster than their number.
MAX_PEOPLE = 150
USUAL_TILT_RAD = np.deg2rad(20.0)  # before there is one

_NOBODY = np.empty(0, dtype=np.int64)


def chosen_tracks(
    measured: Measured, prior: SizePrior, known: KnownLengths
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
    """Return how far right each observation is, in standard deviations, and how near, (n, 2).

    How near by the logarithm of how tall it is in the picture.
    """
    right, near = foot[:, 0], np.log(np.maximum(tall, 1e-6))
    right = (right - right.mean()) / max(float(right.std()), 1e-6)
    return np.column_stack([right, near - near.mean()])


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
    geometry = Geometry.of(measured)
    if plane is None:
        reach = np.full(count, mean_reach(np.tan(USUAL_TILT_RAD)))
        reach_std = np.full(count, UNKNOWN_REACH_STD)
        return geometry.foot, geometry.head, reach, reach_std, USUAL_TILT_RAD
    posed = replace(measured, ground_plane=plane)
    leaning = Geometry.of(posed)
    roll = plane.roll_rad
    foot, head = add_roll(leaning.foot, roll), add_roll(leaning.head, roll)
    return foot, head, *reach_of(posed, plane), plane.tilt_rad


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
