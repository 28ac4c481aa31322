"""The height of a track: one number and its interval from all its frames, by each method."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
import pandas as pd
import pyarrow as pa

from pipeline.core.arrays import FloatArray
from pipeline.core.calibration import Dimension
from pipeline.core.config import KnownPerson, SizePrior
from pipeline.core.robust import MAD_TO_STD, MEDIAN_EFFICIENCY, noise_part
from pipeline.core.tables import TRACK_HEIGHTS
from pipeline.estimate.boxes.error_correlation import independent_share
from pipeline.estimate.gait import WALKER
from pipeline.estimate.height_parts import height_parts, slopes_of_tracks, unknown_parts
from pipeline.estimate.types import Estimated, Measured

# A height this many standard deviations from its class's mean is not that of one such object: of ten
# thousand adults about five are so tall or so small.
RULED_OUT = 3.5
HALF_WIDTH = 1.959963984540054  # of a 95 % interval, in standard deviations


def track_heights(
    measured: Measured,
    estimated: Estimated,
    method: str,
    priors: Sequence[SizePrior] = (),
    slopes: FloatArray | None = None,
    known: Sequence[KnownPerson] = (),
) -> pa.Table:
    """Return the median height of each track and its standard deviation, and its depths.

    The noise of frames averages out over as many frames as are independent: n (1 - c) / (1 + c)
    with c the correlation of neighbouring frames (AR(1)). What all frames share, an error of the
    calibration or an assumed height, does not average out. A height that the prior of the object's
    class rules out is marked: the interval speaks of one object, and that is not one.

    Of a walking person the frames' heights are already those when standing (`gait.as_standing`).

    Args:
        measured: the observations.
        estimated: what a method made of them.
        method: its name.
        priors: of the classes that are known.
        slopes: of heights by the ground over what their camera shares, (n, 10), where that is known.
        known: people whose height is known beside; theirs is that, and no measurement.
    """
    frame = pd.DataFrame(
        {
            "track_id": measured.track_id,
            "time_ns": measured.capture_time_ns,
            "depth_m": estimated.depth_m,
            "height_m": estimated.height_m,
            "common_m": np.where(
                np.isfinite(estimated.height_m), estimated.height_common_std_m, np.nan
            ),
            "doubt_m": estimated.height_doubt_m,
            "std_m": estimated.height_std_m,
            "assumed": estimated.height_assumed,
            "class_name": measured.class_name,
            "share": np.where(measured.class_name == WALKER, independent_share(measured), 1.0),
        }
    )
    frame = frame[np.isfinite(frame["depth_m"])].sort_values(["track_id", "time_ns"])
    if frame.empty:
        return TRACK_HEIGHTS.empty_table()
    # A height that was put in counts only where a track has no other.
    some = ~frame["assumed"].groupby(frame["track_id"]).transform("all")
    frame["height_m"] = frame["height_m"].where(~(frame["assumed"] & some))
    tracks = frame.groupby("track_id", sort=True)
    frame["deviation_m"] = frame["height_m"] - tracks["height_m"].transform("median")
    tracks = frame.groupby("track_id", sort=True)
    frame["before_m"] = tracks["deviation_m"].shift(1)
    count = tracks["height_m"].count().to_numpy(dtype=np.float64)
    frame["distance_m"] = frame["deviation_m"].abs()
    spread_m = MAD_TO_STD * tracks["distance_m"].median().to_numpy()
    typical_std_m = tracks["std_m"].median().to_numpy()
    common_m = tracks["common_m"].median().to_numpy()
    noise_m = _noise_of_median(spread_m, typical_std_m, common_m, _independent(frame, count), count)
    depth = tracks["depth_m"].agg(["min", "median", "max", "count"])
    height_m = tracks["height_m"].median().to_numpy()
    height_std_m = np.where(count > 0, np.hypot(noise_m, common_m), np.nan)
    assumed = tracks["assumed"].all().to_numpy()
    names = _commonest(frame)
    # That it may be no one person is what is asked here.
    doubt_m = tracks["doubt_m"].median().to_numpy()
    tracks_in_order = depth.index.to_numpy()
    for person in known:
        mine = (tracks_in_order == person.track_id) & (count > 0)
        height_m, height_std_m, doubt_m = (
            np.where(mine, told, found)
            for told, found in (
                (person.height_m, height_m),
                (person.std_m, height_std_m),
                (0.0, doubt_m),
            )
        )
    sure_std_m = noise_part(height_std_m, doubt_m)
    plausible = _plausible(height_m, sure_std_m, names, priors)
    columns: dict[str, object] = {
        "camera": [measured.camera] * len(depth),
        "track_id": depth.index.to_numpy(),
        "method": [method] * len(depth),
        "height_m": height_m,
        "height_std_m": height_std_m,
        "height_assumed": assumed,
        "height_plausible": [None if a else p for a, p in zip(assumed, plausible, strict=True)],
        "depth_min_m": depth["min"].to_numpy(),
        "depth_median_m": depth["median"].to_numpy(),
        "depth_max_m": depth["max"].to_numpy(),
        "observation_count": depth["count"].to_numpy(),
        "height_low_m": np.maximum(height_m - HALF_WIDTH * height_std_m, 0.0),
        "height_high_m": height_m + HALF_WIDTH * height_std_m,
    }
    joint = measured.ground_plane.joint if measured.ground_plane is not None else None
    if joint is None or slopes is None:
        columns |= unknown_parts(len(depth))
    else:
        seen = np.isfinite(estimated.height_m) & ~estimated.height_assumed
        of_tracks = slopes_of_tracks(
            measured.track_id, np.where(seen[:, None], slopes, np.nan), tracks_in_order
        )
        # Of a known height the error is its own, of whoever told it.
        told = np.isin(tracks_in_order, [person.track_id for person in known])
        of_tracks = np.where(told[:, None], 0.0, of_tracks)
        columns |= height_parts(joint, of_tracks, height_m, height_std_m, doubt_m)
    arrays = [pa.array(columns[f.name], type=f.type, from_pandas=True) for f in TRACK_HEIGHTS]
    return pa.Table.from_arrays(arrays, schema=TRACK_HEIGHTS)


def _plausible(
    height_m: FloatArray,
    height_std_m: FloatArray,
    names: npt.NDArray[np.object_],
    priors: Sequence[SizePrior],
) -> list[bool | None]:
    """Return whether each height can be that of one object of its class; None where unknown."""
    known = {p.object_class: p for p in priors if p.dimension is Dimension.HEIGHT}
    result: list[bool | None] = []
    for height, std, name in zip(height_m, height_std_m, names, strict=True):
        prior = known.get(str(name))
        if prior is None or not np.isfinite(height):
            result.append(None)
        else:
            result.append(
                bool(abs(height - prior.mean_m) <= RULED_OUT * np.hypot(std, prior.any_std_m))
            )
    return result


def _commonest(frame: pd.DataFrame) -> npt.NDArray[np.object_]:
    """Return the class of most of each track's observations; of equals the first by name."""
    counts = frame.groupby(["track_id", "class_name"]).size().rename("count").reset_index()
    counts = counts.sort_values(["track_id", "count", "class_name"], ascending=[True, False, True])
    names = counts.drop_duplicates("track_id")["class_name"]
    return np.asarray(names.to_numpy(dtype=np.object_))


def _correlation(frame: pd.DataFrame) -> FloatArray:
    """Return the correlation of neighbouring frames' deviations, a track, 0 to 0.99."""
    products = pd.DataFrame(
        {
            "track_id": frame["track_id"],
            "cross": frame["deviation_m"] * frame["before_m"],
            "square": frame["deviation_m"] ** 2,
        }
    )
    means = products.groupby("track_id", sort=True)[["cross", "square"]].mean()
    with np.errstate(invalid="ignore", divide="ignore"):
        correlation = (means["cross"] / means["square"]).to_numpy()
    return np.asarray(np.clip(np.nan_to_num(correlation), 0.0, 0.99))


def _independent(frame: pd.DataFrame, count: FloatArray) -> FloatArray:
    """Return how many independent observations each track is, at least one.

    Of people the slow part of a detector's errors, which hardly shows from frame to frame, leaves
    fewer (`boxes.error_correlation.CORRELATION_S`).
    """
    correlation = _correlation(frame)
    several = count * (1 - correlation) / (1 + correlation)
    known = frame["share"].where(frame["height_m"].notna())
    slow = known.groupby(frame["track_id"], sort=True).sum().to_numpy()
    return np.asarray(np.maximum(np.minimum(several, slow), 1.0))


def _noise_of_median(
    spread_m: FloatArray,
    typical_std_m: FloatArray,
    common_m: FloatArray,
    independent: FloatArray,
    count: FloatArray,
) -> FloatArray:
    """Return the standard deviation of a track's median height by its frames' noise.

    The spread that the frames show is trusted once there are enough of them; with few, the stated
    deviation of one frame is the floor.
    """
    stated_m = noise_part(typical_std_m, common_m)
    per_frame_m = np.where(count >= 10, spread_m, np.fmax(spread_m, stated_m))
    efficiency = np.where(count > 1, MEDIAN_EFFICIENCY, 1.0)
    return np.asarray(per_frame_m * np.sqrt(efficiency / independent))
