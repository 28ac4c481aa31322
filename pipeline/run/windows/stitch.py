"""Windows of one recording put together again: the tables that pass 1 would have left of the whole.

Each window saw what came shortly before its cut; so did the window before it, and that one counts.
Frames that both saw tell how the numbers of frames continue, boxes that both saw tell which track
continues which: of the pairs of boxes that are each other's best, the pair of tracks that had most of
them. An object that the recording itself names is one track throughout.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from pipeline.core.arrays import FloatArray
from pipeline.core.config import TrackConfig
from pipeline.core.records import Severity
from pipeline.core.tables import (
    BACKGROUND_LINES,
    CAMERAS,
    GROUND_TRUTH,
    PARTS,
    TRACKS,
)
from pipeline.run.windows.notes import stitched_notes
from pipeline.run.windows.split import Window
from pipeline.store.parquet_parts import PartWriter
from pipeline.store.recordings import RecordingRow

# Boxes of one object in one frame, found twice, share nearly all of their area.
SAME_BOX = 0.5
_SIDES = ["x_min_px", "y_min_px", "x_max_px", "y_max_px"]
_FRAME = ["camera", "frame_index"]
_TRACK = ["camera", "track_id"]
_LENS = ["width_px", "height_px", "fx_px", "fy_px"]


@dataclass(slots=True)
class _Before:
    """State after the windows so far, for the next one."""

    frames: pd.DataFrame  # those that the next window saw too
    observations: pd.DataFrame  # theirs
    frame_counts: dict[str, int] = field(default_factory=dict)
    track_counts: dict[str, int] = field(default_factory=dict)
    named: dict[tuple[str, str], int] = field(default_factory=dict)  # (camera, object) -> track
    observation_count: int = 0


def stitch(
    folders: Sequence[Path], windows: Sequence[Window], target: Path, config: TrackConfig
) -> None:
    """Write the tables of pass 1 of a recording from those of its windows, one after another.

    Args:
        folders: the parts of each window.
        windows: the windows, in order.
        target: a folder for the parts of the whole.
        config: which tracks are noise.
    """
    before = _Before(pd.DataFrame(columns=_FRAME), pd.DataFrame())
    seen: list[pd.DataFrame] = []
    following = [*windows[1:], None]
    with PartWriter(target) as parts:
        cameras = _cameras(folders)
        parts.write("cameras", cameras)
        parts.write("diagnostics", stitched_notes(folders, windows, cameras))
        parts.write("background_lines", _background_lines(folders))
        for folder, window, after in zip(folders, windows, following, strict=True):
            frames, observations = _read(folder, "frames"), _read(folder, "observations")
            _number_frames(frames, observations, before)
            _number_tracks(observations, before)
            counts = frames["log_time_ns"].between(window.from_ns, window.to_ns, inclusive="left")
            mine = frames[counts]
            kept = _of_frames(observations, mine).reset_index(drop=True)
            kept["observation_index"] = before.observation_count + np.arange(len(kept))
            parts.write("frames", _table("frames", mine))
            parts.write("observations", _table("observations", kept))
            for truth in _truth(folder, frames, mine):
                parts.write("ground_truth", truth)
            seen.append(_sightings(kept, mine))
            _move_on(before, mine, kept, after)
        parts.write("tracks", _tracks(pd.concat(seen), config))


def _read(folder: Path, table: str) -> pd.DataFrame:
    rows = pq.read_table(folder / f"{table}.parquet").to_pandas(types_mapper=pd.ArrowDtype)
    if table == "frames":  # as this window counts them
        rows["window_index"] = rows["frame_index"]
    return rows


def _table(name: str, rows: pd.DataFrame) -> pa.Table:
    schema = PARTS[name]
    for column in schema.names:
        if column not in rows:
            rows = rows.assign(**{column: None})
    return pa.Table.from_pandas(rows[schema.names], schema=schema, preserve_index=False)


def _number_frames(frames: pd.DataFrame, observations: pd.DataFrame, before: _Before) -> None:
    """Let the numbers of frames continue those of the windows before."""
    offsets: dict[str, int] = {}
    for camera, mine in frames.groupby("camera"):
        known = before.frames[before.frames["camera"] == camera]
        both = (
            mine.drop_duplicates("log_time_ns", keep=False).merge(
                known.drop_duplicates("log_time_ns", keep=False), on="log_time_ns"
            )
            if len(known)
            else known
        )
        if len(both):
            offset = int(both["frame_index_y"].iloc[0] - both["frame_index_x"].iloc[0])
        else:
            offset = before.frame_counts.get(str(camera), 0) - int(mine["frame_index"].min())
        offsets[str(camera)] = offset
    for rows in (frames, observations):
        shift = rows["camera"].map(offsets).astype("int64") if len(rows) else 0
        rows["frame_index"] = rows["frame_index"] + shift


def _number_tracks(observations: pd.DataFrame, before: _Before) -> None:
    """Give the tracks of a window the numbers of those that they continue, or new ones."""
    numbers = _continued(before.observations, observations)
    objects = observations.dropna(subset=["object_id"]).drop_duplicates([*_TRACK, "object_id"])
    for camera, track, name in objects[[*_TRACK, "object_id"]].itertuples(index=False):
        if (camera, name) in before.named:
            numbers[camera, track] = before.named[camera, name]
    keys = observations[_TRACK].drop_duplicates()
    for camera, track in keys.itertuples(index=False):
        if (camera, track) not in numbers:
            number = before.track_counts.get(camera, 0)
            numbers[camera, track] = number
            before.track_counts[camera] = number + 1
    for camera, track, name in objects[[*_TRACK, "object_id"]].itertuples(index=False):
        before.named[camera, name] = numbers[camera, track]
    pairs = zip(observations["camera"], observations["track_id"], strict=True)
    observations["track_id"] = np.array([numbers[p] for p in pairs], dtype=np.int64)


def _continued(known: pd.DataFrame, found: pd.DataFrame) -> dict[tuple[str, int], int]:
    """Return which earlier track each track continues: the one that it shares most boxes with."""
    if not len(known) or not len(found):
        return {}
    columns = [*_FRAME, "track_id", *_SIDES]
    pairs = found[columns].merge(known[columns], on=_FRAME, suffixes=("", "_known"))
    pairs["overlap"] = _overlap(
        pairs[_SIDES].to_numpy(dtype=np.float64),
        pairs[[f"{s}_known" for s in _SIDES]].to_numpy(dtype=np.float64),
    )
    best = pairs["overlap"] >= SAME_BOX
    for side in ("track_id", "track_id_known"):
        best &= pairs["overlap"] == pairs.groupby([*_FRAME, side])["overlap"].transform("max")
    counts = pairs[best].groupby(["camera", "track_id", "track_id_known"]).size()
    result: dict[tuple[str, int], int] = {}
    taken: set[tuple[str, int]] = set()
    ordered = counts.sort_values(ascending=False, kind="stable")
    for camera, track, earlier in ordered.index:
        if (camera, track) not in result and (camera, earlier) not in taken:
            result[camera, track] = int(earlier)
            taken.add((camera, earlier))
    return result


def _overlap(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return intersection over union of boxes (n, 4), row by row."""
    inside = np.minimum(a[:, 2:], b[:, 2:]) - np.maximum(a[:, :2], b[:, :2])
    shared = np.maximum(inside, 0.0).prod(axis=1)
    sizes = (a[:, 2:] - a[:, :2]).prod(axis=1) + (b[:, 2:] - b[:, :2]).prod(axis=1)
    return np.asarray(shared / np.maximum(sizes - shared, 1e-12))


def _of_frames(rows: pd.DataFrame, frames: pd.DataFrame) -> pd.DataFrame:
    """Return the rows of the frames that are there."""
    if not len(rows) or not len(frames):
        return rows.iloc[:0]
    keys = pd.MultiIndex.from_frame(frames[_FRAME])
    return rows[pd.MultiIndex.from_frame(rows[_FRAME]).isin(keys)]


def _truth(folder: Path, frames: pd.DataFrame, mine: pd.DataFrame) -> Iterator[pa.Table]:
    """Yield the truth of the frames that count, with their numbers."""
    rows = _read(folder, "ground_truth")
    if not len(rows):
        return
    numbers = frames[["camera", "window_index", "frame_index"]]
    rows = rows.rename(columns={"frame_index": "window_index"}).merge(
        numbers, on=["camera", "window_index"]
    )
    yield pa.Table.from_pandas(
        _of_frames(rows, mine)[GROUND_TRUTH.names], schema=GROUND_TRUTH, preserve_index=False
    )


def _sightings(observations: pd.DataFrame, frames: pd.DataFrame) -> pd.DataFrame:
    """Return count, first and last frame and time of each track and class."""
    rows = observations[[*_FRAME, "track_id", "class_name", "object_id"]].merge(
        frames[[*_FRAME, "capture_time_ns"]], on=_FRAME
    )
    grouped = rows.groupby([*_TRACK, "class_name"], dropna=False, sort=False)
    return grouped.agg(
        object_id=("object_id", "first"),
        first_frame_index=("frame_index", "min"),
        last_frame_index=("frame_index", "max"),
        first_time_ns=("capture_time_ns", "min"),
        last_time_ns=("capture_time_ns", "max"),
        observation_count=("frame_index", "size"),
    ).reset_index()


def _tracks(seen: pd.DataFrame, config: TrackConfig) -> pa.Table:
    """Return the tracks that lasted, as `Tracker.tracks` judges them."""
    classes = seen.groupby([*_TRACK, "class_name"], dropna=False, sort=False)
    votes = classes["observation_count"].sum().reset_index()
    votes = votes.sort_values("observation_count", ascending=False, kind="stable")
    names = votes.drop_duplicates(_TRACK)[[*_TRACK, "class_name"]]
    tracks = seen.groupby(_TRACK).agg(
        object_id=("object_id", "first"),
        first_frame_index=("first_frame_index", "min"),
        last_frame_index=("last_frame_index", "max"),
        first_time_ns=("first_time_ns", "min"),
        last_time_ns=("last_time_ns", "max"),
        observation_count=("observation_count", "sum"),
    )
    tracks = tracks.reset_index().merge(names, on=_TRACK)
    span_s = (tracks["last_time_ns"] - tracks["first_time_ns"]) / 1e9
    kept = [
        named or not config.noisy(count, seconds)
        for named, count, seconds in zip(
            tracks["object_id"].notna(), tracks["observation_count"], span_s, strict=True
        )
    ]
    return (
        _table("tracks", tracks[np.array(kept, dtype=np.bool_)])
        if len(tracks)
        else (TRACKS.empty_table())
    )


def _cameras(folders: Sequence[Path]) -> pa.Table:
    """Return the cameras, each with the lens of most windows, as the first of these has it."""
    rows = pd.concat([_read(folder, "cameras") for folder in folders], ignore_index=True)
    votes = rows.groupby(["camera", *_LENS], dropna=False, sort=False)["camera"].transform("size")
    # Any lens is better than none: a window without lens data tells nothing of it.
    rows = rows.assign(lensless=rows["fx_px"].isna(), votes=-votes.astype("int64"))
    best = rows.sort_values(["lensless", "votes"], kind="stable").drop_duplicates("camera")
    return pa.Table.from_pandas(
        best.sort_index()[CAMERAS.names], schema=CAMERAS, preserve_index=False
    )


def _background_lines(folders: Sequence[Path]) -> pa.Table:
    """Return the straight edges of each camera, as the first window has them that saw any.

    A fixed background has the same edges in all windows: several times over, they would seem to be
    more evidence than they are. There are none where the lens differs between windows, as in a
    recording that is whole.
    """
    found: dict[str, pa.Table] = {}
    lenses: dict[str, set[tuple[object, ...]]] = {}
    for folder in folders:
        for row in pq.read_table(
            folder / "cameras.parquet", columns=["camera", *_LENS]
        ).to_pylist():
            lens = tuple(row[name] for name in _LENS)
            lenses.setdefault(row["camera"], set()).update([] if row["fx_px"] is None else [lens])
        edges = pq.read_table(folder / "background_lines.parquet")
        for camera in pc.unique(edges["camera"]).to_pylist():
            found.setdefault(camera, edges.filter(pc.equal(edges["camera"], camera)))
    fixed = [edges for camera, edges in found.items() if len(lenses.get(camera, ())) <= 1]
    return pa.concat_tables([BACKGROUND_LINES.empty_table(), *fixed])


def summed_row(rows: Sequence[RecordingRow], parts: Path, path: Path) -> RecordingRow:
    """Return the row of the whole recording; frames of overlaps are counted once.

    Args:
        rows: those of the windows.
        parts: folder of the stitched tables.
        path: the recording.
    """
    frames = pq.read_table(parts / "frames.parquet", columns=["log_time_ns", "decoded"])
    span = pc.min_max(frames["log_time_ns"])
    severities = pq.read_table(parts / "diagnostics.parquet")["severity"].to_pylist()
    return replace(
        rows[0],
        path=path,
        start_time_ns=span["min"].as_py(),
        end_time_ns=span["max"].as_py(),
        frame_count=frames.num_rows,
        frames_lost=frames.num_rows - pc.sum(frames["decoded"]).as_py() if len(frames) else 0,
        damaged=str(Severity.ERROR) in severities,
    )


def refused_pictures(row: RecordingRow, parts: Path) -> bool:
    """Return whether messages of pictures could not be read in a window, which leave no frames.

    Overlaps would count them twice, so a recording that has any is measured whole.
    """
    decoded = pq.read_table(parts / "frames.parquet", columns=["decoded"])["decoded"]
    return row.frames_lost > len(decoded) - (pc.sum(decoded).as_py() or 0)


def _move_on(
    before: _Before, frames: pd.DataFrame, observations: pd.DataFrame, after: Window | None
) -> None:
    """Bring `before` up to date for the next window."""
    before.observation_count += len(observations)
    for camera, last in frames.groupby("camera")["frame_index"].max().items():
        before.frame_counts[str(camera)] = int(last) + 1
    if after is not None:
        shared = frames[frames["log_time_ns"] >= after.read_from_ns]
        before.frames = shared[[*_FRAME, "log_time_ns"]]
        before.observations = _of_frames(observations, shared)
