"""Tracks of a recording refined, once all of it is measured: from the parts of pass 1 to the same again.

Cameras whose boxes the recording or a region of interest gives are left as they are.
"""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from pipeline.core.arrays import FloatArray, IntArray
from pipeline.core.config import TrackConfig
from pipeline.core.tables import OBSERVED
from pipeline.detect import AS_GIVEN
from pipeline.measure.appearance import unpacked
from pipeline.store.parquet_parts import PartWriter, read_part
from pipeline.track.refine import Refiner
from pipeline.track.rows import BoxRows
from pipeline.track.verdict import TrackSums, tracks_table

SIDES = ("x_min", "y_min", "x_max", "y_max")
_CUT = tuple(f"truncated_{side}" for side in ("left", "top", "right", "bottom"))
_RAW = tuple(f"raw_{side}_px" for side in SIDES)
_BLUR = ("blur_sigma_px", "blur_std_px", "blur_edge_count")
# Nothing of a box that was filled in was measured.
_UNMEASURED = ("score", "occlusion", "luminance", "confirmed", *_BLUR, *_RAW)


def refine_tracks(parts: Path, config: TrackConfig) -> None:
    """Rewrite the parts `observations` and `tracks` of a recording with its tracks refined.

    Raises:
        StoreError: a part is missing, or cannot be written.
    """
    if not config.offline:
        return
    tracks = list(read_part(parts, "tracks"))
    if not tracks:
        return
    folder = parts / "refined"
    with PartWriter(folder) as writer:
        cameras = _rewrite(parts, pa.concat_tables(tracks), writer)
        for one in cameras.values():
            writer.write("tracks", one.tracks_table(config))
    for table in ("observations", "tracks"):
        (folder / f"{table}.parquet").replace(parts / f"{table}.parquet")
    shutil.rmtree(folder, ignore_errors=True)


def _rewrite(parts: Path, tracks: pa.Table, writer: PartWriter) -> dict[str, _Camera]:
    """Write the observations of all cameras refined; return what is known of their tracks."""
    times_ns = _frame_times_ns(parts)
    cameras: dict[str, _Camera] = {}
    count = 0
    for rows in read_part(parts, "observations"):
        for name in pc.unique(rows["camera"]).to_pylist():
            mine = rows.filter(pc.equal(rows["camera"], name))
            if name not in cameras:
                its_tracks = tracks.filter(pc.equal(tracks["camera"], name))
                cameras[name] = _Camera(name, times_ns[name], its_tracks, mine)
            count = _write(writer, cameras[name].add(mine), count)
    for one in cameras.values():
        count = _write(writer, one.rest(), count)
    return cameras


def _write(writer: PartWriter, rows: pa.Table | None, count: int) -> int:
    """Write rows with numbers that go on from `count`; return the next."""
    if rows is None or not rows.num_rows:
        return count
    index = pa.array(np.arange(count, count + rows.num_rows), pa.int32())
    writer.write("observations", rows.set_column(0, OBSERVED.field(0), index))
    return count + rows.num_rows


def _frame_times_ns(parts: Path) -> dict[str, IntArray]:
    """Return the times of the frames of each camera by their number; they never fall."""
    found: dict[str, list[tuple[IntArray, IntArray]]] = {}
    for rows in read_part(parts, "frames"):
        for camera in pc.unique(rows["camera"]).to_pylist():
            mine = rows.filter(pc.equal(rows["camera"], camera))
            columns = (mine["frame_index"].to_numpy(), mine["capture_time_ns"].to_numpy())
            found.setdefault(camera, []).append(columns)
    times: dict[str, IntArray] = {}
    for camera, parts_of in found.items():
        frame, time_ns = (np.concatenate(c) for c in zip(*parts_of, strict=True))
        at = np.full(int(frame.max()) + 1, time_ns.min(), dtype=np.int64)
        at[frame] = time_ns
        times[camera] = np.maximum.accumulate(at)
    return times


class _Camera:
    """One camera's rows on their way through the refiner."""

    def __init__(self, name: str, time_ns: IntArray, tracks: pa.Table, first: pa.Table) -> None:
        self.name = name
        self._tracks = tracks
        self._detector = first["detector"][0].as_py()
        named = tracks["object_id"].null_count < tracks.num_rows
        self._as_given = self._detector in AS_GIVEN or named
        self._lasting = tracks["track_id"].to_numpy()
        self._time_ns = time_ns
        self._time_s: FloatArray = (time_ns - time_ns.min()) / 1e9
        self._refiner = Refiner(self._time_s)
        self._rows = OBSERVED.empty_table()  # as they came, from the first that is still needed
        self._begin = 0
        self._sums = TrackSums()

    def add(self, rows: pa.Table) -> pa.Table | None:
        """Take rows as they were measured; return those that are decided, None if there are none.

        Observations of tracks that did not last are noise of the detector, and are left out.
        """
        rows = rows.filter(pa.array(np.isin(rows["track_id"].to_numpy(), self._lasting)))
        if self._as_given or not rows.num_rows:
            return rows
        self._refiner.add(self._columns(rows))
        self._rows = pa.concat_tables([self._rows, rows])
        return self._taken(self._refiner.ready())

    def rest(self) -> pa.Table | None:
        """Return the rows that were not decided before the end."""
        return None if self._as_given else self._taken(self._refiner.ready(last=True))

    def tracks_table(self, config: TrackConfig) -> pa.Table:
        """Return the rows of the table `tracks`."""
        if self._as_given:
            return self._tracks
        return tracks_table(self.name, self._sums, config, judged=self._detector == "motion")

    def _columns(self, rows: pa.Table) -> BoxRows:
        frame = rows["frame_index"].to_numpy().astype(np.int64)
        begin = self._begin + self._rows.num_rows
        cut = [rows[name].to_numpy() for name in _CUT]
        return BoxRows(
            number=np.arange(begin, begin + rows.num_rows),
            frame=frame,
            time_s=self._time_s[frame],
            track=rows["track_id"].to_numpy().astype(np.int64),
            bbox_xyxy_px=np.stack([rows[f"{s}_px"].to_numpy() for s in SIDES], axis=1),
            std_px=np.stack([rows[f"{s}_std_px"].to_numpy() for s in SIDES], axis=1),
            measured=np.ones(rows.num_rows, dtype=np.bool_),
            whole=~np.any(cut, axis=0),
            person=pc.equal(rows["class_name"], "person").to_numpy(),
            colour=unpacked(rows["colours"]),
        )

    def _taken(self, refined: BoxRows | None) -> pa.Table | None:
        """Return the table's rows as they were refined, and forget those not needed any more."""
        if refined is None:
            return None
        table = self._with_refined(self._rows.take(pa.array(refined.number - self._begin)), refined)
        oldest = self._refiner.oldest
        gone = self._rows.num_rows if oldest is None else oldest - self._begin
        self._rows, self._begin = self._rows.slice(gone), self._begin + gone
        return table

    def _with_refined(self, table: pa.Table, refined: BoxRows) -> pa.Table:
        confirmed = table["confirmed"].cast(pa.float64()).to_numpy()
        # A part of something at the picture's edge (an arm) does not tell that it stands there whole.
        confirmed = np.where(refined.measured & refined.whole, confirmed, np.nan)
        self._sums.add(
            refined.track,
            refined.frame,
            self._time_ns[refined.frame],
            refined.bbox_xyxy_px,
            table["class_name"].to_pylist(),
            refined.measured,
            confirmed,
        )
        new: dict[str, object] = {
            "track_id": refined.track,
            "frame_index": refined.frame,
            "measured": refined.measured,
        }
        for side, name in enumerate(SIDES):
            new[f"{name}_px"] = refined.bbox_xyxy_px[:, side]
            new[f"{name}_std_px"] = refined.std_px[:, side]
        unmeasured = pa.array(~refined.measured)
        for name in _UNMEASURED:
            new[name] = pc.if_else(unmeasured, None, table[name])
        new["blur_reason"] = pc.if_else(unmeasured, "not_measured", table["blur_reason"])
        for name, values in new.items():
            at = OBSERVED.get_field_index(name)
            column = values if isinstance(values, pa.ChunkedArray) else pa.array(values)
            table = table.set_column(at, OBSERVED.field(at), column.cast(OBSERVED.field(at).type))
        return table
