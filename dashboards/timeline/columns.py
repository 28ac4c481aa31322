"""The rows of one camera as columns, joined by position: what the timeline is drawn from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
import numpy.typing as npt
import pyarrow as pa
import pyarrow.compute as pc

from dashboards.style import NEUTRAL, Colours, slot_colours
from dashboards.timeline.layout import screen_scale
from dashboards.timeline.slots import slots
from pipeline.core.arrays import FloatArray, IntArray
from pipeline.estimate.methods import in_order

BoolArray = npt.NDArray[np.bool_]
# An object of which so much is covered counts as hidden where nothing better is known.
HIDDEN_SHARE = 0.25
BEST = "best"  # stands for a method where the best of an observation is by one or by another


@dataclass(frozen=True, slots=True)
class Estimates:
    """Estimates of each observation, (n,) each; NaN where there is none."""

    depth_m: FloatArray
    depth_std_m: FloatArray
    height_m: FloatArray
    height_std_m: FloatArray
    x_m: FloatArray
    y_m: FloatArray
    height_assumed: BoolArray

    @property
    def measured_height_m(self) -> FloatArray:
        """Height where it was measured, NaN where it was put in."""
        return np.where(self.height_assumed, np.nan, self.height_m)


@dataclass(frozen=True, slots=True)
class Frames:
    """The frames of a camera in the order of their index, (f,) each."""

    frame_index: IntArray
    capture_time_ns: IntArray
    log_time_ns: IntArray
    start_ns: int  # when the recording starts
    table: pa.Table  # the same rows with all their columns

    def __len__(self) -> int:
        return len(self.frame_index)

    def rate_hz(self) -> float:
        """Return the median frame rate; 0 where there are too few frames to tell."""
        steps_ns = np.diff(self.capture_time_ns)
        middle_ns = float(np.median(steps_ns)) if len(steps_ns) else 0.0
        return 1e9 / middle_ns if middle_ns > 0 else 0.0


@dataclass(frozen=True, slots=True)
class Observations:
    """The observations of a camera by frame and track, (n,) each."""

    observation_index: IntArray
    row: IntArray  # the frame, as a position in `Frames`
    track: IntArray  # the track, as a position in `Tracks`
    bbox_xyxy_px: FloatArray  # (n, 4)
    hidden: BoolArray  # whether its head or its feet cannot be seen

    def __len__(self) -> int:
        return len(self.row)

    def starts(self, frame_count: int) -> IntArray:
        """Return where the observations of each frame begin, and the end: (f + 1,)."""
        return np.searchsorted(self.row, np.arange(frame_count + 1))


@dataclass(frozen=True, slots=True)
class Tracks:
    """The tracks of a camera that have observations, (t,) each."""

    track_id: IntArray
    observation_count: IntArray
    first_row: IntArray  # frames, as positions in `Frames`
    last_row: IntArray
    slot: IntArray  # the lane and the line in plots that it shares with others; -1: none was free
    colour: Colours  # (t, 3), that of its slot


@dataclass(frozen=True, slots=True)
class Truth:
    """Ground truth of a camera by frame, (g,) each."""

    row: IntArray
    object_id: npt.NDArray[np.object_]
    depth_m: FloatArray
    height_m: FloatArray
    width_m: FloatArray
    x_m: FloatArray
    y_m: FloatArray
    bbox_xyxy_px: FloatArray  # (g, 4)


@dataclass(frozen=True, slots=True)
class CameraRows:
    """All rows of one camera."""

    name: str  # on the timeline
    camera: Mapping[str, Any]  # its row of the table `cameras`
    scale: float  # pixels of the picture on the timeline a pixel of the stored one
    screen_scale: float  # pixels of the screen a pixel of the stored one, as the layout has it
    alone: int | None  # the number of a track that has the plots for itself
    frames: Frames
    observations: Observations
    tracks: Tracks
    truth: Truth
    matched: Truth | None  # truth of each observation, (n,); None where nothing was matched
    best: Estimates  # of each observation, the best that there is, (n,)
    best_method: npt.NDArray[np.object_]  # by which method, (n,); None where by none
    methods: tuple[str, ...]  # those that have a depth for any observation, best first

    @property
    def alone_track(self) -> int | None:
        """Return the track that has the plots for itself, by position."""
        at = np.flatnonzero(self.tracks.track_id == self.alone)
        return int(at[0]) if len(at) else None

    @property
    def drawn_by(self) -> str:
        """Return the method that all that is drawn is by; `best` where there are several."""
        used = {method for method in self.best_method.tolist() if method is not None}
        return used.pop() if len(used) == 1 else BEST

    @property
    def is_series_of_pictures(self) -> bool:
        """Return whether nothing is followed over frames, as in a set of photographs."""
        return len(self.tracks.track_id) > 1 and bool((self.tracks.observation_count == 1).all())


def camera_rows(
    camera: Mapping[str, Any],
    tables: Mapping[str, pa.Table],
    *,
    name: str | None = None,
    scale: float = 1.0,
    cameras: int = 1,
    alone: int | None = None,
) -> CameraRows:
    """Return the rows of a camera; observations of frames that are not there are left out.

    Args:
        camera: a row of the table `cameras`.
        tables: the tables of the recording by name.
        name: what it is called on the timeline, if not as in the recording.
        scale: how much its pictures are shrunk there.
        cameras: how many cameras are shown beside each other.
        alone: a track that shares its slot with no other.
    """
    key = str(camera["camera"])
    start_ns = pc.min(tables["frames"]["capture_time_ns"]).as_py() or 0
    frames = _frames(_of_camera(tables["frames"], key), start_ns)
    observations, tracks = _observations(
        _of_camera(tables["observations"], key), tables.get("observation_quality"), frames, alone
    )
    best, best_method, methods = _best(tables["estimates"], observations.observation_index)
    return CameraRows(
        name=key if name is None else name,
        camera=camera,
        scale=scale,
        screen_scale=screen_scale(camera, cameras),
        alone=alone,
        frames=frames,
        observations=observations,
        tracks=tracks,
        truth=_truth(_of_camera(tables["ground_truth"], key), frames),
        matched=_matched(tables.get("matches"), observations, best, camera["tilt_rad"] or 0.0),
        best=best,
        best_method=best_method,
        methods=methods,
    )


def estimates_by(method: str, table: pa.Table, observation_index: IntArray) -> Estimates:
    """Return the estimates of one method for observations, (n,); NaN where it has none.

    Args:
        method: its name.
        table: rows of the table `estimates`.
        observation_index: (n,).
    """
    rows = table.filter(pc.equal(table["method"], method))
    position, found = _positions(observation_index, integers(rows, "observation_index"))
    return Estimates(
        **{
            field.name: (
                _taken(_booleans(rows, field.name), position, found, False)
                if field.name == "height_assumed"
                else _taken(floats(rows, field.name), position, found, np.nan)
            )
            for field in fields(Estimates)
        }
    )


def floats(table: pa.Table, name: str) -> FloatArray:
    """Return a column with NaN for null."""
    return np.asarray(table[name].to_numpy(), dtype=np.float64)


def integers(table: pa.Table, name: str) -> IntArray:
    """Return a column that has no nulls."""
    return np.asarray(table[name].to_numpy(), dtype=np.int64)


def _booleans(table: pa.Table, name: str) -> BoolArray:
    return np.asarray(pc.fill_null(table[name], False).to_numpy(), dtype=np.bool_)


def _of_camera(table: pa.Table, name: str) -> pa.Table:
    return table.filter(pc.equal(table["camera"], name))


def _frames(table: pa.Table, start_ns: int) -> Frames:
    table = table.sort_by("frame_index")
    return Frames(
        integers(table, "frame_index"),
        integers(table, "capture_time_ns"),
        integers(table, "log_time_ns"),
        start_ns,
        table,
    )


def _observations(
    table: pa.Table, quality: pa.Table | None, frames: Frames, alone: int | None
) -> tuple[Observations, Tracks]:
    row, found = _positions(integers(table, "frame_index"), frames.frame_index)
    track_id = integers(table, "track_id")
    order = np.lexsort((track_id, row))
    order = order[found[order]]
    row, track_id = row[order], track_id[order]
    ids, first, track, count = np.unique(
        track_id, return_index=True, return_inverse=True, return_counts=True
    )
    last = np.zeros(len(ids), dtype=np.int64)
    np.maximum.at(last, track, row)
    observations = Observations(
        observation_index=integers(table, "observation_index")[order],
        row=row,
        track=track,
        bbox_xyxy_px=_boxes(table)[order],
        hidden=_hidden(table, quality)[order],
    )
    single = len(ids) > 1 and bool((count == 1).all())
    slot = np.zeros(len(ids), dtype=np.int64) if single else slots(row[first], last, ids == alone)
    colour = np.where(slot[:, None] < 0, np.array(NEUTRAL), slot_colours(slot)).astype(np.uint8)
    return observations, Tracks(ids, count, row[first], last, slot, colour)


def _hidden(table: pa.Table, quality: pa.Table | None) -> BoolArray:
    """Return whose head or feet cannot be seen: cut off by the picture, or behind something."""
    sides = ("truncated_top", "truncated_bottom")
    hidden = np.logical_or(*(_booleans(table, side) for side in sides))
    if quality is None or not quality.num_rows:
        return hidden | (np.nan_to_num(floats(table, "occlusion")) >= HIDDEN_SHARE)
    index = integers(table, "observation_index")
    position, found = _positions(index, integers(quality, "observation_index"))
    for end in ("contact_visible", "head_visible"):
        visible = np.asarray(pc.fill_null(quality[end], True).to_numpy(), dtype=np.bool_)
        hidden |= ~_taken(visible, position, found, True)
    return hidden


def _best(
    table: pa.Table, observation_index: IntArray
) -> tuple[Estimates, npt.NDArray[np.object_], tuple[str, ...]]:
    """Return of each observation its best estimate, the method, and all methods that have any."""
    present = set(table["method"].unique().to_pylist())
    chosen = {f.name: np.full(len(observation_index), np.nan) for f in fields(Estimates)}
    chosen["height_assumed"] = np.zeros(len(observation_index), dtype=np.bool_)
    by: npt.NDArray[np.object_] = np.full(len(observation_index), None, dtype=object)
    used = []
    for method in in_order(present):
        estimates = estimates_by(method, table, observation_index)
        known = np.isfinite(estimates.depth_m)
        if known.any():
            used.append(method)
        mine = known & (by == None)  # noqa: E711  (by element)
        by[mine] = method
        for name, values in chosen.items():
            values[mine] = getattr(estimates, name)[mine]
    return Estimates(**chosen), by, tuple(used)


def _truth(table: pa.Table, frames: Frames) -> Truth:
    row, found = _positions(integers(table, "frame_index"), frames.frame_index)
    order = np.argsort(row, kind="stable")
    order = order[found[order]]
    values = {
        name: floats(table, name)[order]
        for name in ("depth_m", "height_m", "width_m", "x_m", "y_m")
    }
    object_id = np.asarray(table["object_id"].to_pylist(), dtype=object)[order]
    return Truth(row=row[order], object_id=object_id, bbox_xyxy_px=_boxes(table)[order], **values)


def _matched(
    table: pa.Table | None, observations: Observations, best: Estimates, tilt_rad: float
) -> Truth | None:
    """Return the truth of each observation, placed in the direction in which it was seen.

    On the ground, depth = y cos tilt + camera height sin tilt, and x grows with the depth.
    """
    if table is None or not table.num_rows or not len(observations):
        return None
    position, found = _positions(
        observations.observation_index, integers(table, "observation_index")
    )
    depth_m = _taken(floats(table, "true_depth_m"), position, found, np.nan)
    unknown = np.full(len(observations), np.nan)
    return Truth(
        row=observations.row,
        object_id=_taken(
            np.asarray(table["object_id"].to_pylist(), dtype=object), position, found, None
        ),
        depth_m=depth_m,
        height_m=_taken(floats(table, "true_height_m"), position, found, np.nan),
        width_m=unknown,
        x_m=best.x_m * depth_m / best.depth_m,
        y_m=best.y_m + (depth_m - best.depth_m) / np.cos(tilt_rad),
        bbox_xyxy_px=np.full((len(observations), 4), np.nan),
    )


def _boxes(table: pa.Table) -> FloatArray:
    edges = ("x_min_px", "y_min_px", "x_max_px", "y_max_px")
    return np.column_stack([floats(table, edge) for edge in edges])


def _positions(wanted: IntArray, keys: IntArray) -> tuple[IntArray, BoolArray]:
    """Return where each wanted key is among `keys`, and whether it is there at all."""
    if not len(keys):
        return np.zeros(len(wanted), dtype=np.int64), np.zeros(len(wanted), dtype=np.bool_)
    order = np.argsort(keys, kind="stable")
    position = order[np.minimum(np.searchsorted(keys, wanted, sorter=order), len(keys) - 1)]
    return position, keys[position] == wanted


def _taken(
    values: npt.NDArray[Any], position: IntArray, found: BoolArray, missing: float | bool | None
) -> npt.NDArray[Any]:
    filler = np.asarray(missing)
    if not len(values):
        return np.full(len(position), filler)
    return np.asarray(np.where(found, values[position], filler))
