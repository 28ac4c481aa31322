"""Input of `calibrate_from_truth`, from the tables of a stored recording."""

from __future__ import annotations

import numpy as np
import pyarrow as pa

from pipeline.estimate.boxes.geometry import Geometry
from pipeline.estimate.tables import measured_by_camera

_SCHEMA = pa.schema(
    [
        ("recording_id", pa.string()),
        ("camera", pa.string()),
        ("class_name", pa.string()),
        ("object_id", pa.string()),
        ("f_number", pa.float64()),
        ("focal_length_mm", pa.float64()),
        ("focus_distance_m", pa.float64()),
        ("width_on_sensor_mm", pa.float64()),
        ("height_on_sensor_mm", pa.float64()),
        ("true_depth_m", pa.float64()),
        ("true_height_m", pa.float64()),
        ("true_width_m", pa.float64()),
    ]
)
_TRUE = ("object_id", "true_depth_m", "true_height_m", "true_width_m")


def truth_table(
    recording_id: str,
    observations: pa.Table,
    frames: pa.Table,
    cameras: pa.Table,
    matches: pa.Table,
) -> pa.Table:
    """Return one row an observation that has a truth: sizes as the methods will see them.

    Distortion is removed, and a side that the picture cuts is null. Tables of several recordings can
    be put one under the other.

    Args:
        recording_id: of all the tables' rows.
        observations: a recording's rows of this table.
        frames: its rows of this one.
        cameras: and of this.
        matches: observation_index, object_id and what is known of true_depth_m, true_height_m and
            true_width_m (the table `matches`).
    """
    tables = []
    names = [name for name in _TRUE if name in matches.column_names]
    index = matches["observation_index"].to_numpy()
    for measured in measured_by_camera(observations, frames, cameras, poses={}):
        geometry = Geometry.of(measured)
        rows = np.flatnonzero(np.isin(measured.observation_index, index))
        order = np.argsort(index, kind="stable")
        at = order[np.searchsorted(index[order], measured.observation_index[rows])]
        true = matches.select(names).take(pa.array(at))
        columns: dict[str, object] = {
            "recording_id": [recording_id] * len(rows),
            "camera": [measured.camera] * len(rows),
            "class_name": measured.class_name[rows],
            "f_number": measured.f_number[rows],
            "focal_length_mm": measured.focal_length_mm[rows],
            "focus_distance_m": measured.focus_distance_m[rows],
            "width_on_sensor_mm": geometry.width_on_sensor_mm[rows],
            "height_on_sensor_mm": geometry.height_on_sensor_mm[rows],
        }
        arrays = [
            true[f.name].combine_chunks().cast(f.type)
            if f.name in names
            else pa.array(columns.get(f.name, [None] * len(rows)), f.type, from_pandas=True)
            for f in _SCHEMA
        ]
        tables.append(pa.Table.from_arrays(arrays, schema=_SCHEMA))
    return pa.concat_tables(tables) if tables else _SCHEMA.empty_table()
