"""Truth of a file in the database: frames as the recording numbers them, rows in and out."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import pyarrow as pa

from pipeline.core.arrays import FloatArray
from pipeline.core.errors import UsageError, Where
from pipeline.core.records import Diagnostic, GroundPlane, Intrinsics, Severity
from pipeline.optics.distortion import undistort
from pipeline.optics.ground_plane import foot_depth_m, ground_position_m, remove_roll
from pipeline.store.database import Store
from pipeline.store.matches import add_matches
from pipeline.truth.judge import judge_tracking
from pipeline.truth.rows import TruthFile, TruthRow

_SIDES = ("x_min_px", "y_min_px", "x_max_px", "y_max_px")
_SIZES = ("depth_m", "range_m", "height_m", "width_m", "x_m", "y_m")
# Depth, position to the right and ahead, (n, 3), of feet in pixels, (n, 2).
Surveyed = Callable[[FloatArray], FloatArray]
_TABLES = ("ground_truth", "labelled_frames", "ignore_regions")
# A time of a table belongs to the nearest frame, if that is no farther away than half of the usual
# interval of 0.2 s of slow recordings.
NEAREST_S = 0.1


@dataclass(slots=True)
class AddedTruth:
    """Truth as it went into the database."""

    recording_id: str
    camera: str
    objects: int = 0
    boxes: int = 0
    frames: int = 0
    ignored: int = 0
    outside: int = 0  # rows of frames that the recording does not have
    notes: list[Diagnostic] = field(default_factory=list)


def add_truth(
    store: Store,
    recording_id: str,
    camera: str,
    path: Path,
    truth: TruthFile,
    first_frame: int | None = None,
    surveyed: Surveyed | None = None,
) -> AddedTruth:
    """Replace the truth of a camera that came from files; call inside a transaction.

    Args:
        store: the database.
        recording_id: a recording in it.
        camera: a camera of it.
        path: the file; its name is stored.
        truth: its content.
        first_frame: the number that the file gives to the recording's first frame; None: as is usual.
        surveyed: gives depth, position to the right and ahead, (n, 3), of feet in pixels, (n, 2).

    Raises:
        UsageError: nothing of it belongs to a frame of the recording.
    """
    added = AddedTruth(recording_id, camera)
    first = truth.first_frame if first_frame is None else first_frame
    frames = _Frames.of(store, recording_id, camera, first)
    labelled = sorted({f for f in map(frames.index, truth.frames) if f is not None})
    objects = _placed(truth.objects, frames, labelled, added)
    ignored = _regions(truth.ignored, frames)
    labelled = sorted({*labelled, *(o.frame for o in objects if o.frame is not None)})
    if not objects and not ignored and not labelled:
        raise UsageError(
            "none of it is of a frame of the recording",
            where=Where(path),
            remedy="--first-frame N says which number the recording's first frame has in it",
        )
    for table in _TABLES:
        store.connection.execute(
            f"DELETE FROM {table} WHERE recording_id = ? AND camera = ? AND file_name IS NOT NULL",  # noqa: S608
            [recording_id, camera],
        )
    if surveyed is not None:
        objects = _surveyed(objects, surveyed)
    key = {"recording_id": recording_id, "camera": camera, "file_name": path.name}
    _insert(store, "ground_truth", [key | _object_row(o) for o in objects])
    _insert(store, "labelled_frames", [key | {"frame_index": f} for f in labelled])
    _insert(store, "ignore_regions", [key | row for row in ignored])
    store.connection.execute("DELETE FROM matches WHERE recording_id = ?", [recording_id])
    add_matches(store, recording_id)
    judge_tracking(store, recording_id)
    added.objects, added.ignored = len({o.object_id for o in objects}), len(ignored)
    added.boxes, added.frames = sum(o.has_box for o in objects), len(labelled)
    added.notes = _notes(truth, added, path)
    return added


@dataclass(frozen=True, slots=True)
class _Frames:
    """Frames of one camera, and how a file numbers them."""

    first: int
    known: frozenset[int]
    index_by_time: tuple[FloatArray, FloatArray]  # times since the first, and frame numbers

    @classmethod
    def of(cls, store: Store, recording_id: str, camera: str, first: int) -> _Frames:
        rows = store.connection.sql(
            "SELECT frame_index, capture_time_ns FROM frames "
            "WHERE recording_id = $recording AND camera = $camera ORDER BY capture_time_ns",
            params={"recording": recording_id, "camera": camera},
        ).to_arrow_table()
        index, time_ns = (rows[n].to_numpy() for n in ("frame_index", "capture_time_ns"))
        since_s = (time_ns - time_ns.min(initial=np.iinfo(np.int64).max)) / 1e9
        return cls(first, frozenset(index.tolist()), (since_s, index))

    def index(self, number: int) -> int | None:
        """Return the recording's number of a frame; None if it has no such frame."""
        frame = number - self.first
        return frame if frame in self.known else None

    def at(self, time_s: float) -> int | None:
        """Return the frame nearest to a time; None if none is near."""
        times, index = self.index_by_time
        if not len(times):
            return None
        nearest = int(np.abs(times - time_s).argmin())
        return int(index[nearest]) if abs(times[nearest] - time_s) <= NEAREST_S else None


def _placed(
    objects: list[TruthRow], frames: _Frames, labelled: list[int], added: AddedTruth
) -> list[TruthRow]:
    """Return the objects by the recording's frames; those of no frame in all that have the object."""
    placed: list[TruthRow] = []
    always: list[TruthRow] = []
    for row in objects:
        if row.frame is None and math.isnan(row.time_s):
            always.append(row)
            continue
        index = frames.at(row.time_s) if row.frame is None else frames.index(row.frame)
        if index is None:
            added.outside += 1
        else:
            placed.append(replace(row, frame=index))
    if not always:
        return placed
    known = {row.object_id for row in placed}
    constant = {row.object_id: row for row in always}
    merged = [_completed(row, constant.get(row.object_id)) for row in placed]
    alone = [row for row in always if row.object_id not in known]
    everywhere = labelled or sorted(frames.known)
    return merged + [replace(row, frame=f) for row in alone for f in everywhere]


def _completed(row: TruthRow, constant: TruthRow | None) -> TruthRow:
    """Return a row with what is known of its object in every frame."""
    if constant is None:
        return row
    missing = {n: getattr(constant, n) for n in _SIZES if math.isnan(getattr(row, n))}
    return replace(row, **missing)


def _regions(ignored: list[TruthRow], frames: _Frames) -> list[dict[str, object]]:
    rows: list[dict[str, object]] = []
    last = max(frames.known, default=0)
    for region in ignored:
        if not region.has_box:
            continue
        index = None if region.frame is None else frames.index(region.frame)
        if region.frame is not None and index is None:
            continue
        span = (0, last) if index is None else (index, index)
        row: dict[str, object] = {"first_frame_index": span[0], "last_frame_index": span[1]}
        row.update(zip(_SIDES, region.bbox_xyxy_px, strict=True))
        rows.append(row)
    return rows


def _surveyed(objects: list[TruthRow], surveyed: Surveyed) -> list[TruthRow]:
    """Return the objects with depth and position by a surveyed pose, if the file gives none."""
    boxes = np.array([o.bbox_xyxy_px for o in objects]).reshape(-1, 4)
    places = surveyed(np.stack([(boxes[:, 0] + boxes[:, 2]) / 2, boxes[:, 3]], axis=1))
    result = []
    for row, (depth_m, x_m, y_m) in zip(objects, places.tolist(), strict=True):
        if row.has_box and math.isnan(row.depth_m) and depth_m > 0:
            row = replace(row, depth_m=depth_m, x_m=x_m, y_m=y_m)
        result.append(row)
    return result


def places_by_survey(plane: GroundPlane, lens: Intrinsics) -> Surveyed:
    """Return a function that gives depth and ground position of feet (`optics.ground_plane`)."""

    def places(feet_px: FloatArray) -> FloatArray:
        bent = (feet_px - [lens.cx_px, lens.cy_px]) / [lens.fx_px, lens.fy_px]
        xy = remove_roll(undistort(bent, lens.distortion_model, lens.distortion), plane.roll_rad)
        depth_m = foot_depth_m(plane.camera_height_m, plane.tilt_rad, xy[:, 1])
        position = ground_position_m(depth_m, xy[:, 0], xy[:, 1], plane.tilt_rad)
        return np.column_stack([depth_m, *position])

    return places


def _object_row(row: TruthRow) -> dict[str, object]:
    found: dict[str, object] = {
        "frame_index": row.frame,
        "object_id": row.object_id,
        "class_name": row.class_name,
    }
    found.update((n, _known(getattr(row, n))) for n in _SIZES)
    found.update((n, _known(v)) for n, v in zip(_SIDES, row.bbox_xyxy_px, strict=True))
    return found


def _known(value: float) -> float | None:
    return None if math.isnan(value) else value


def _insert(store: Store, table: str, rows: list[dict[str, object]]) -> None:
    if rows:
        with store.incoming("incoming", pa.Table.from_pylist(rows)):
            store.connection.execute(f"INSERT INTO {table} BY NAME FROM incoming")


def _notes(truth: TruthFile, added: AddedTruth, path: Path) -> list[Diagnostic]:
    notes = [
        Diagnostic(Severity.INFO, "truth_assumed", f"{path.name}: {text}", camera=added.camera)
        for text in truth.doubts
    ]
    if truth.refused:
        text = f"{path.name}: {len(truth.refused)} rows were left out; {truth.refused[0]}"
        notes.append(Diagnostic(Severity.WARNING, "truth_refused", text, camera=added.camera))
    if added.outside:
        text = f"{path.name}: {added.outside} rows are of frames that the recording does not have"
        notes.append(Diagnostic(Severity.WARNING, "truth_outside", text, camera=added.camera))
    return notes
