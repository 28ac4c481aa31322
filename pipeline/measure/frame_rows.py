"""Rows of the tables `frames` and `ground_truth`: facts about frames, without their pixels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields

import numpy as np
import pyarrow as pa

from pipeline.core.exposure import FIELDS
from pipeline.core.lens import Lens
from pipeline.core.records import Frame
from pipeline.core.tables import FRAMES, GROUND_TRUTH
from pipeline.measure.lens_stretches import LensStretch
from pipeline.measure.observations import Seen
from pipeline.optics.exposure import exposure_value_100, scene_luminance_cd_m2
from pipeline.store.parquet_parts import as_table

Row = dict[str, object]

_STORED = tuple(row.name for row in FIELDS.values() if row.stored)
_OF_LENS = frozenset(f.name for f in fields(Lens))


def frame_row(seen: Seen, lens: Lens, stretch: LensStretch | None = None) -> Row:
    """Return a frame's row by column, but for what its exposure says of the light.

    Args:
        seen: the frame, its picture and boxes.
        lens: its lens by exposure and camera file.
        stretch: its lens in pixels; None if it has no picture.
    """
    frame, picture = seen.frame, seen.picture
    return (
        {
            "camera": frame.camera,
            "frame_index": frame.frame_index,
            "log_time_ns": frame.log_time_ns,
            "capture_time_ns": frame.capture_time_ns,
            "image_format": frame.image_format,
            "image_bytes": len(frame.image),
            "width_px": picture.width_px if picture else None,
            "height_px": picture.height_px if picture else None,
            "decoded": picture is not None,
            "exposure_pairing": str(frame.exposure_pairing),
            "exposure_offset_ns": frame.exposure_offset_ns,
            "luminance": picture.luminance if picture else None,
            "clipped_fraction": picture.clipped_fraction if picture else None,
        }
        | _exposure_columns(frame, lens)
        | _lens_columns(stretch)
    )


def _exposure_columns(frame: Frame, lens: Lens) -> Row:
    """Return the stored exposure fields: of the lens as it is used, the others as recorded."""
    return {name: getattr(lens if name in _OF_LENS else frame.exposure, name) for name in _STORED}


def _lens_columns(stretch: LensStretch | None) -> Row:
    k = stretch.intrinsics if stretch is not None else None
    names = ("fx_px", "fy_px", "cx_px", "cy_px", "distortion_model", "distortion")
    row: Row = {name: getattr(k, name) if k is not None else None for name in names}
    return row | {"intrinsics_source": stretch.source if stretch is not None else None}


def frames_table(rows: Sequence[Row]) -> pa.Table:
    """Return rows of the table `frames`, with what the exposure says of the light in the scene."""
    columns: dict[str, Sequence[object]] = {name: [row[name] for row in rows] for name in rows[0]}
    settings = [
        np.array(columns[name], dtype=np.float64)
        for name in ("f_number", "exposure_time_s", "iso_speed")
    ]
    columns["ev100"] = exposure_value_100(*settings).tolist()
    columns["scene_luminance_cd_m2"] = scene_luminance_cd_m2(
        settings[0], settings[1], settings[2]
    ).tolist()
    return as_table(columns, FRAMES)


def truth_table(frames: Sequence[Frame]) -> pa.Table:
    """Return the recorded truth of frames as rows of the table `ground_truth`."""
    rows = [(frame, truth) for frame in frames for truth in frame.truth]
    columns: dict[str, Sequence[object]] = {
        "camera": [frame.camera for frame, _ in rows],
        "frame_index": [frame.frame_index for frame, _ in rows],
    }
    for name in GROUND_TRUTH.names:
        if name not in columns and not name.endswith("_px"):
            columns[name] = [getattr(truth, name) for _, truth in rows]
    for side, name in enumerate(("x_min_px", "y_min_px", "x_max_px", "y_max_px")):
        columns[name] = [truth.bbox_xyxy_px[side] for _, truth in rows]
    return as_table(columns, GROUND_TRUTH)
