"""Observations made up from known geometry, as arrays and as the tables that pass 1 stores."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pyarrow as pa

from pipeline.core.records import GroundPlane, Intrinsics
from pipeline.core.tables import CAMERAS, FRAMES, OBSERVATIONS
from pipeline.estimate.types import Estimated, Measured
from pipeline.optics.ground_plane import project_person
from pipeline.optics.pinhole import PinholeCamera
from pipeline.optics.silhouette import mean_reach, silhouette_rows, steepness

VGA = Intrinsics(1280, 720, 1200.0, 1190.0, 640.0, 350.0)


def estimates(count: int, **fields: Any) -> Estimated:
    """Return estimates of which nothing but these fields, (count,) each, is known."""
    return replace(Estimated.unknown(count), **fields)


def measured(bbox: np.ndarray, **changes: Any) -> Measured:
    """Return whole, exact boxes of one person a row in a camera of which only `VGA` is known."""
    n = len(bbox)
    nan = np.full(n, np.nan)
    base = Measured(
        camera="cam",
        observation_index=np.arange(n),
        frame_index=np.arange(n),
        capture_time_ns=np.arange(n) * 40_000_000,
        track_id=np.zeros(n, dtype=np.int64),
        class_name=np.full(n, "person", dtype=np.object_),
        bbox_xyxy_px=np.asarray(bbox, dtype=np.float64),
        std_xyxy_px=np.zeros((n, 4)),
        truncated=np.zeros((n, 4), dtype=np.bool_),
        occlusion=np.zeros(n),
        f_number=nan,
        focal_length_mm=nan,
        focus_distance_m=nan,
        pixel_pitch_x_um=nan,
        pixel_pitch_y_um=nan,
        intrinsics=VGA,
        ground_plane=None,
    )
    return replace(base, **changes)


def lens(n: int, **changes: float) -> dict[str, np.ndarray]:
    """Return the columns of the paper's lens: 50 mm, 3.9 um, f/2.8, focus unknown."""
    values = {
        "focal_length_mm": 50.0,
        "pixel_pitch_x_um": 3.9,
        "pixel_pitch_y_um": 3.9,
        "f_number": 2.8,
        "focus_distance_m": np.nan,
    } | changes
    return {name: np.full(n, value) for name, value in values.items()}


def people(
    x_m: np.ndarray,
    y_m: np.ndarray,
    height_m: np.ndarray,
    plane: GroundPlane,
    camera: Intrinsics = VGA,
) -> np.ndarray:
    """Return the boxes, (n, 4), of people of no width who stand on the ground."""
    foot, head = project_person(
        x_m, y_m, height_m, plane.camera_height_m, plane.tilt_rad, plane.roll_rad
    )
    optics = PinholeCamera(
        camera.fx_px,
        camera.fy_px,
        camera.cx_px,
        camera.cy_px,
        camera.width_px,
        camera.height_px,
        camera.distortion_model,
        camera.distortion,
    )
    ends = [optics.project(np.column_stack([p, np.ones(len(p))])) for p in (foot, head)]
    middle = (ends[0][:, 0] + ends[1][:, 0]) / 2
    return np.stack([middle, ends[1][:, 1], middle, ends[0][:, 1]], axis=1)


def outlined(
    box: np.ndarray, plane: GroundPlane, heading_rad: float, camera: Intrinsics = VGA
) -> np.ndarray:
    """Return boxes of `people` as the outlines of bodies that walk in a direction; no roll."""
    foot = (box[:, 3] - camera.cy_px) / camera.fy_px
    head = (box[:, 1] - camera.cy_px) / camera.fy_px
    steep, _ = steepness(head, plane.tilt_rad)
    towards = -np.sin(heading_rad)
    reach = mean_reach(steep, towards, towards**2)
    low, high = silhouette_rows(foot, head, plane.tilt_rad, reach)
    outline = box.copy()
    outline[:, 3] = low * camera.fy_px + camera.cy_px
    outline[:, 1] = high * camera.fy_px + camera.cy_px
    return outline


def _table(schema: pa.Schema, n: int, columns: dict[str, Any]) -> pa.Table:
    arrays = [
        pa.array(columns[f.name], type=f.type, from_pandas=True)
        if f.name in columns
        else pa.nulls(n, f.type)
        for f in schema
    ]
    return pa.Table.from_arrays(arrays, schema=schema)


def tables(
    bbox: np.ndarray, lens_columns: dict[str, np.ndarray], **observed: Any
) -> dict[str, Any]:
    """Return one observation a frame as observations, frames and cameras of camera `cam`."""
    n = len(bbox)
    columns: dict[str, Any] = {
        "observation_index": np.arange(n),
        "camera": ["cam"] * n,
        "frame_index": np.arange(n),
        "track_id": np.zeros(n, dtype=np.int32),
        "class_name": ["person"] * n,
        "occlusion": np.zeros(n),
    }
    for i, side in enumerate(("x_min", "y_min", "x_max", "y_max")):
        columns[f"{side}_px"] = bbox[:, i]
        columns[f"{side}_std_px"] = np.zeros(n)
    for side in ("left", "top", "right", "bottom"):
        columns[f"truncated_{side}"] = np.zeros(n, dtype=np.bool_)
    frames = {
        "camera": ["cam"] * n,
        "frame_index": np.arange(n),
        "capture_time_ns": np.arange(n) * 40_000_000,
    }
    camera = {f: [getattr(VGA, f)] for f in ("width_px", "height_px", "fx_px", "fy_px")}
    camera |= {"camera": ["cam"], "cx_px": [VGA.cx_px], "cy_px": [VGA.cy_px]}
    return {
        "observations": _table(OBSERVATIONS, n, columns | observed),
        "frames": _table(FRAMES, n, frames | lens_columns),
        "cameras": _table(CAMERAS, 1, camera),
    }
