"""Boxes of pictures of another lens, zoom or size, as the lens that most pictures have would see them.

A camera that stands still and zooms, or stores pictures of another size, keeps its place and direction:
a ray through a pixel of one lens is a pixel of the other (Hartley and Zisserman, Multiple View Geometry,
section 8.4: the map between zooms about the same centre is K K'^-1). So one lens serves all that follows.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import pyarrow as pa

from pipeline.core.arrays import FloatArray
from pipeline.core.camera_row import CameraRow
from pipeline.core.lens import ASPECT_TOLERANCE
from pipeline.core.records import Intrinsics
from pipeline.estimate.boxes.ends import camera_of

# Columns of a frame's lens, as they are joined to its observations.
NUMBERS = ("fx_px", "fy_px", "cx_px", "cy_px")
LENS_COLUMNS = (*NUMBERS, "distortion_model", "distortion", "intrinsics_source")
SIZE_COLUMNS = ("width_px", "height_px")
JOINED = {name: f"frame_{name}" for name in (*SIZE_COLUMNS, *LENS_COLUMNS)}


@dataclass(frozen=True, slots=True)
class FrameLens:
    """The lens of a frame, and where it comes from."""

    intrinsics: Intrinsics
    source: str | None


@dataclass(frozen=True, slots=True)
class ToUsual:
    """Rows whose lens is known, and the map of their pixels to the usual lens.

    `lenses` are those of the rows, by `number`; rows of number -1 are scaled by `scale` alone.
    """

    kept: npt.NDArray[np.bool_]  # (m,) of all rows; the others below are of those kept
    scale: FloatArray  # (n, 4) for x, y, x, y
    number: npt.NDArray[np.intp]  # (n,)
    lenses: tuple[Intrinsics, ...]
    usual: FrameLens | None

    def boxes(self, boxes_px: FloatArray) -> FloatArray:
        """Return boxes, (n, 4), in pixels of the usual lens."""
        moved = np.where(self.scale == 1.0, boxes_px, (boxes_px + 0.5) * self.scale - 0.5)
        for number, lens in enumerate(self.lenses):
            rows = self.number == number
            if self.usual is not None:
                moved[rows] = _through(boxes_px[rows], lens, self.usual.intrinsics)
        return np.asarray(moved)


def usual_of(frames: pa.Table) -> FrameLens | None:
    """Return the lens that most frames have, None where no frame's is known.

    Args:
        frames: rows of the table `frames` of one camera.
    """
    known = frames.filter(pa.compute.is_valid(frames["fx_px"]))
    keys = [*SIZE_COLUMNS, *NUMBERS]
    numbered = known.select(keys).append_column("row", pa.array(np.arange(known.num_rows)))
    counted = numbered.group_by(keys).aggregate([("row", "count"), ("row", "min")])
    order = [("row_count", "descending"), ("row_min", "ascending")]
    return first_lens(known.take(counted.sort_by(order)["row_min"]))


def first_lens(frames: pa.Table) -> FrameLens | None:
    """Return the lens of the first row of `frames`, None where there is none or it is unknown."""
    if not frames.num_rows or not frames["fx_px"][0].is_valid:
        return None
    return lens_at(frames, 0)


def lens_at(frames: pa.Table, row: int) -> FrameLens:
    """Return the lens of a row of the table `frames`; it must be known."""
    values = {name: frames[name][row].as_py() for name in (*SIZE_COLUMNS, *LENS_COLUMNS)}
    width_px, height_px = (int(values[name] or 0) for name in SIZE_COLUMNS)
    fx_px, fy_px, cx_px, cy_px = (float(values[name]) for name in NUMBERS)
    bends = tuple(values["distortion"] or ())
    model = values["distortion_model"] or ""
    lens = Intrinsics(width_px, height_px, fx_px, fy_px, cx_px, cy_px, model, bends)
    return FrameLens(lens, values["intrinsics_source"])


def to_usual(table: pa.Table, camera: CameraRow, usual: FrameLens | None) -> ToUsual:
    """Return the map of observations' pixels to the lens that most pictures have.

    Rows in pictures of another shape (cut, turned) whose lens is not known are left out.

    Args:
        table: observations joined with their frames, whose columns are named as in `JOINED`.
        camera: the camera's row; its size is that of the usual pictures.
        usual: the lens of most frames, by `usual_of`.
    """
    rows = table.num_rows
    if "frame_width_px" not in table.column_names or not (camera.width_px and camera.height_px):
        return _unchanged(rows, usual)
    size_px = np.array([camera.width_px, camera.height_px], dtype=np.float64)
    sizes = np.stack([_numbers(table, f"frame_{n}") for n in SIZE_COLUMNS], axis=1)
    scale = np.nan_to_num(size_px / sizes, nan=1.0)
    kept = np.abs(scale[:, 0] / scale[:, 1] - 1) <= ASPECT_TOLERANCE
    number = np.full(rows, -1, dtype=np.intp)
    lenses: tuple[Intrinsics, ...] = ()
    if usual is not None and "frame_fx_px" in table.column_names:
        number, lenses = _other_lenses(table, usual)
        focal_px = np.array([[k.fx_px, k.fy_px] for k in lenses]).reshape(-1, 2)
        own = number >= 0
        scale[own] = (usual.intrinsics.fx_px, usual.intrinsics.fy_px) / focal_px[number[own]]
        kept |= own
    return ToUsual(kept, np.tile(scale, 2)[kept], number[kept], lenses, usual)


def _unchanged(rows: int, usual: FrameLens | None) -> ToUsual:
    every = np.ones(rows, dtype=np.bool_)
    return ToUsual(every, np.ones((rows, 4)), np.full(rows, -1, dtype=np.intp), (), usual)


def _other_lenses(
    table: pa.Table, usual: FrameLens
) -> tuple[npt.NDArray[np.intp], tuple[Intrinsics, ...]]:
    """Return the number of each row's lens, -1 where it is the usual one or unknown, and the lenses.

    Lenses of another source are of the same camera, stated less well: they are no other zoom.
    """
    stated = np.stack([_numbers(table, f"frame_{n}") for n in NUMBERS], axis=1)
    same = (stated == [getattr(usual.intrinsics, name) for name in NUMBERS]).all(axis=1)
    number = np.full(len(stated), -1, dtype=np.intp)
    other = np.flatnonzero(~same & np.isfinite(stated).all(axis=1))
    if len(other) and usual.source is not None:
        sources = table["frame_intrinsics_source"].take(pa.array(other))
        alike = pa.compute.equal(sources, usual.source).fill_null(False)
        other = other[np.asarray(alike)]
    if not len(other):
        return number, ()
    _, first, inverse = np.unique(stated[other], axis=0, return_index=True, return_inverse=True)
    number[other] = inverse.reshape(-1)
    return number, tuple(_joined_lens(table, row) for row in other[first].tolist())


def _joined_lens(table: pa.Table, row: int) -> Intrinsics:
    frames = table.slice(row, 1).select(list(JOINED.values())).rename_columns(list(JOINED))
    return lens_at(frames, 0).intrinsics


def _through(boxes_px: FloatArray, lens: Intrinsics, usual: Intrinsics) -> FloatArray:
    """Return boxes as the usual lens sees what they show: the middles of their sides are mapped."""
    x, y = (boxes_px[:, 0] + boxes_px[:, 2]) / 2, (boxes_px[:, 1] + boxes_px[:, 3]) / 2
    sides = [(boxes_px[:, 0], y), (x, boxes_px[:, 1]), (boxes_px[:, 2], y), (x, boxes_px[:, 3])]
    points = np.stack([np.stack(side, axis=-1) for side in sides], axis=1)
    rays = camera_of(lens).normalize(points)
    seen = camera_of(usual).project(np.concatenate([rays, np.ones((*rays.shape[:2], 1))], axis=2))
    return np.column_stack([seen[:, 0, 0], seen[:, 1, 1], seen[:, 2, 0], seen[:, 3, 1]])


def _numbers(table: pa.Table, name: str) -> FloatArray:
    return np.asarray(table[name].to_numpy(), dtype=np.float64)
