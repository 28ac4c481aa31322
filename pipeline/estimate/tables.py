"""Rows of stored tables as arrays for the methods, and what the methods find as rows again."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pyarrow as pa
import pyarrow.compute

from pipeline.core.arrays import FloatArray
from pipeline.core.calibration import Calibration
from pipeline.core.camera_row import CameraRow, camera_rows
from pipeline.core.records import GroundPlane
from pipeline.core.tables import CALIBRATIONS, ESTIMATES
from pipeline.estimate.cadence import possible
from pipeline.estimate.frame_lens import (
    JOINED,
    LENS_COLUMNS,
    SIZE_COLUMNS,
    FrameLens,
    to_usual,
    usual_of,
)
from pipeline.estimate.types import Estimated, Measured, OtherBoxes


@dataclass(frozen=True, slots=True)
class Rows:
    """Rows of the tables that pass 2 makes of some tracks of a camera."""

    estimates: pa.Table
    track_heights: pa.Table
    quality: pa.Table
    cadences: pa.Table

    def by_table(self) -> dict[str, pa.Table]:
        """Return them by the name of their table."""
        return {
            "estimates": self.estimates,
            "track_heights": self.track_heights,
            "observation_quality": self.quality,
            "track_cadences": possible(self.cadences),
        }


def measured_by_camera(
    observations: pa.Table,
    frames: pa.Table,
    cameras: pa.Table,
    poses: Mapping[str, GroundPlane],
) -> list[Measured]:
    """Return the observations of each camera, joined with their frames, as arrays."""
    lens = frames.select(
        [
            "camera",
            "frame_index",
            "capture_time_ns",
            "exposure_time_s",
            "f_number",
            "focal_length_mm",
            "focus_distance_m",
            "pixel_pitch_x_um",
            "pixel_pitch_y_um",
            *SIZE_COLUMNS,
        ]
    ).rename_columns({name: JOINED[name] for name in SIZE_COLUMNS})
    # A join takes no lists: what a lens is comes after it, by the row of the frame.
    lens = lens.append_column("frame_row", pa.array(np.arange(lens.num_rows)))
    joined = observations.join(lens, ["camera", "frame_index"], join_type="inner")
    joined = joined.sort_by("observation_index")
    of_frames = frames.select(LENS_COLUMNS).take(joined["frame_row"])
    of_frames = of_frames.rename_columns([JOINED[name] for name in LENS_COLUMNS])
    for name in of_frames.column_names:
        joined = joined.append_column(name, of_frames[name])
    found = []
    for camera in camera_rows(cameras):
        name = camera.camera
        mine = joined.filter(pa.compute.equal(joined["camera"], name))
        if mine.num_rows:
            usual = usual_of(frames.filter(pa.compute.equal(frames["camera"], name)))
            found.append(measured_of(mine, camera, poses.get(name), usual=usual))
    return found


def measured_of(
    table: pa.Table,
    camera: CameraRow,
    plane: GroundPlane | None,
    others: pa.Table | None = None,
    usual: FrameLens | None = None,
) -> Measured:
    """Return observations of one camera, joined with their frames, as arrays.

    Args:
        table: the observations, in the order of their number.
        camera: the camera's row of the table `cameras`.
        plane: its pose, where it is known.
        others: index, frame and box of what else is in their frames, joined with these.
        usual: the lens that most of the camera's pictures have, by the table `frames`.
    """
    mapped = to_usual(table, camera, usual)
    table = table if mapped.kept.all() else table.filter(pa.array(mapped.kept))
    scale = mapped.scale

    def number(name: str) -> FloatArray:
        return np.asarray(table[name].to_numpy(), dtype=np.float64)

    sides = ("x_min", "y_min", "x_max", "y_max")
    names = table["class_name"].combine_chunks().dictionary_encode("encode")
    cuts = ("left", "top", "right", "bottom")
    return Measured(
        camera=camera.camera,
        observation_index=table["observation_index"].to_numpy(),
        frame_index=table["frame_index"].to_numpy(),
        capture_time_ns=table["capture_time_ns"].to_numpy(),
        track_id=table["track_id"].to_numpy(),
        class_name=np.array(names.dictionary.to_pylist(), dtype=np.object_)[
            names.indices.to_numpy()
        ],
        bbox_xyxy_px=mapped.boxes(np.stack([number(f"{s}_px") for s in sides], axis=1)),
        std_xyxy_px=scale * np.nan_to_num(np.stack([number(f"{s}_std_px") for s in sides], axis=1)),
        truncated=np.stack(
            [table[f"truncated_{c}"].to_numpy().astype(np.bool_) for c in cuts], axis=1
        ),
        occlusion=np.nan_to_num(number("occlusion")),
        f_number=number("f_number"),
        focal_length_mm=number("focal_length_mm"),
        focus_distance_m=number("focus_distance_m"),
        pixel_pitch_x_um=number("pixel_pitch_x_um") / scale[:, 0],
        pixel_pitch_y_um=number("pixel_pitch_y_um") / scale[:, 1],
        intrinsics=camera.intrinsics,
        ground_plane=plane,
        exposure_time_s=number("exposure_time_s"),
        blur_sigma_px=number("blur_sigma_px") * scale[:, 0],
        blur_std_px=number("blur_std_px") * scale[:, 0],
        filled=~np.asarray(table["measured"].fill_null(True)).astype(np.bool_),
        recorded=np.asarray(pa.compute.equal(table["detector"], RECORDED).fill_null(False)),
        raw_bbox_xyxy_px=mapped.boxes(_raw_boxes(table)),
        others=_other_boxes(others, camera, usual),
    )


RECORDED = "recorded"  # the detector whose boxes come from the recording


def _raw_boxes(table: pa.Table) -> FloatArray:
    """Return boxes as they were found, (n, 4), before tracks were smoothed."""
    sides = ("x_min_px", "y_min_px", "x_max_px", "y_max_px")
    columns = [pa.compute.coalesce(table[f"raw_{s}"], table[s]).to_numpy() for s in sides]
    return np.stack(columns, axis=1).astype(np.float64)


def _other_boxes(
    table: pa.Table | None, camera: CameraRow, usual: FrameLens | None
) -> OtherBoxes | None:
    if table is None or not table.num_rows:
        return None
    mapped = to_usual(table, camera, usual)
    table = table if mapped.kept.all() else table.filter(pa.array(mapped.kept))
    sides = [table[f"{s}_px"].to_numpy() for s in ("x_min", "y_min", "x_max", "y_max")]
    return OtherBoxes(
        table["observation_index"].to_numpy(),
        table["frame_index"].to_numpy(),
        mapped.boxes(np.stack(sides, axis=1).astype(np.float64)),
    )


def estimates_table(measured: Measured, estimated: Estimated, method: str) -> pa.Table:
    """Return the rows of a method that have a depth, in the schema of the table `estimates`."""
    known = np.isfinite(estimated.depth_m)
    in_range = estimated.in_calibrated_range
    columns: dict[str, object] = {
        name: getattr(estimated, name)[known]
        for name in ESTIMATES.names
        if hasattr(estimated, name) and name != "in_calibrated_range"
    }
    columns["observation_index"] = measured.observation_index[known]
    columns["method"] = pa.repeat(
        pa.scalar(method, ESTIMATES.field("method").type), int(known.sum())
    )
    columns["in_calibrated_range"] = pa.array(in_range[known] > 0, mask=np.isnan(in_range[known]))
    arrays = [pa.array(columns[f.name], type=f.type, from_pandas=True) for f in ESTIMATES]
    return pa.Table.from_arrays(arrays, schema=ESTIMATES)


def calibrations_table(calibrations: Sequence[Calibration]) -> pa.Table:
    """Return calibrations as rows of the table `calibrations`, one a parameter."""
    pairs = [(c, p) for c in calibrations for p in c.parameters]
    columns: dict[str, list[object]] = {
        "parameter": [p.name for _, p in pairs],
        "f_number": [p.f_number for _, p in pairs],
        "value": [p.value for _, p in pairs],
        "std_error": [p.std_error for _, p in pairs],
    }
    for name in CALIBRATIONS.names:
        if name not in columns:
            columns[name] = [_plain(getattr(c, name)) for c, _ in pairs]
    arrays = [pa.array(columns[f.name], type=f.type, from_pandas=True) for f in CALIBRATIONS]
    return pa.Table.from_arrays(arrays, schema=CALIBRATIONS)


def _plain(value: object) -> object:
    return str(value) if isinstance(value, str) else value
