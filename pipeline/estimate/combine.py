"""All methods on all cameras of a recording: stored tables in, estimates in long form out."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute

from pipeline.config import Config
from pipeline.estimate import aperture, defocus, fused, ground, inverse, size
from pipeline.estimate.columns import Estimated, Measured
from pipeline.estimate.gait import as_standing
from pipeline.estimate.geometry import Geometry
from pipeline.estimate.notes import not_applicable, outside_calibration
from pipeline.estimate.reach import with_reach
from pipeline.estimate.tracks import track_heights
from pipeline.quality import assess, with_track
from pipeline.records import (
    CALIBRATIONS,
    ESTIMATES,
    OBSERVATION_QUALITY,
    TRACK_HEIGHTS,
    Calibration,
    Diagnostic,
    FloatArray,
    GroundPlane,
    Intrinsics,
    Method,
)

METHODS: Mapping[Method, Callable[[Geometry, Config], Estimated]] = {
    Method.APERTURE: aperture.estimate,
    Method.INVERSE: inverse.estimate,
    Method.SIZE: size.estimate,
    Method.GROUND: lambda geometry, config: ground.estimate(geometry),
}


@dataclass(frozen=True, slots=True)
class Estimates:
    """What pass 2 makes of a recording."""

    estimates: pa.Table
    track_heights: pa.Table
    calibrations: pa.Table
    quality: pa.Table
    diagnostics: list[Diagnostic]


def estimate(
    observations: pa.Table,
    frames: pa.Table,
    cameras: pa.Table,
    poses: Mapping[str, GroundPlane],
    config: Config,
) -> Estimates:
    """Run every method that applies on every camera of a recording.

    Args:
        observations: a recording's rows of this table.
        frames: its rows of this one.
        cameras: and of this.
        poses: the ground plane of each camera whose pose is known.
        config: calibrations and priors.
    """
    rows, heights, judged, notes = [], [], [], []
    used: dict[str, Calibration] = {}
    for measured in measured_by_camera(observations, frames, cameras, poses):
        quality = assess(measured)
        geometry = with_reach(quality.applied(measured))
        made = {method: run(geometry, config) for method, run in METHODS.items()}
        made = {m: e for m, e in made.items() if np.isfinite(e.depth_m).any()}
        by_blur, said = defocus.estimate(geometry, config, made)
        notes += said
        if np.isfinite(by_blur.depth_m).any():
            made[Method.DEFOCUS] = by_blur
        if made:
            by_ground = made.get(Method.GROUND)
            track = fused.beside_track(geometry.measured, by_ground, quality) if by_ground else None
            quality = with_track(quality, track) if track else quality
            best = fused.estimate(geometry, made, track)
            for member in made.values():
                as_standing(measured, member, best.speed_m_s, member.height_assumed)
            made[Method.FUSED] = best
        for method, estimated in made.items():
            rows.append(_long(measured, estimated, method))
            heights.append(track_heights(measured, estimated, method, config.size_prior))
            ids = set(estimated.calibration_id) - {None}
            used |= {c.calibration_id: c for c in config.calibration if c.calibration_id in ids}
            notes += outside_calibration(measured, estimated, method)
        judged.append(quality.table(measured))
        notes += not_applicable(measured, config)
    return Estimates(
        pa.concat_tables(rows) if rows else ESTIMATES.empty_table(),
        pa.concat_tables(heights) if heights else TRACK_HEIGHTS.empty_table(),
        calibrations_table(list(used.values())),
        pa.concat_tables(judged) if judged else OBSERVATION_QUALITY.empty_table(),
        notes,
    )


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
        ]
    )
    joined = observations.join(lens, ["camera", "frame_index"], join_type="inner")
    joined = joined.sort_by("observation_index")
    result = []
    for camera in cameras.to_pylist():
        name = camera["camera"]
        mine = joined.filter(pa.compute.equal(joined["camera"], name))
        if mine.num_rows:
            result.append(_measured(mine, name, _intrinsics(camera), poses.get(name)))
    return result


def _measured(
    table: pa.Table, camera: str, intrinsics: Intrinsics | None, plane: GroundPlane | None
) -> Measured:
    def number(name: str) -> FloatArray:
        return np.asarray(table[name].to_numpy(), dtype=np.float64)

    sides = ("x_min", "y_min", "x_max", "y_max")
    cuts = ("left", "top", "right", "bottom")
    return Measured(
        camera=camera,
        observation_index=table["observation_index"].to_numpy(),
        frame_index=table["frame_index"].to_numpy(),
        capture_time_ns=table["capture_time_ns"].to_numpy(),
        track_id=table["track_id"].to_numpy(),
        class_name=np.array(table["class_name"].to_pylist(), dtype=np.object_),
        bbox_xyxy_px=np.stack([number(f"{s}_px") for s in sides], axis=1),
        std_xyxy_px=np.nan_to_num(np.stack([number(f"{s}_std_px") for s in sides], axis=1)),
        truncated=np.stack(
            [table[f"truncated_{c}"].to_numpy().astype(np.bool_) for c in cuts], axis=1
        ),
        occlusion=np.nan_to_num(number("occlusion")),
        f_number=number("f_number"),
        focal_length_mm=number("focal_length_mm"),
        focus_distance_m=number("focus_distance_m"),
        pixel_pitch_x_um=number("pixel_pitch_x_um"),
        pixel_pitch_y_um=number("pixel_pitch_y_um"),
        intrinsics=intrinsics,
        ground_plane=plane,
        exposure_time_s=number("exposure_time_s"),
        blur_sigma_px=number("blur_sigma_px"),
        blur_std_px=number("blur_std_px"),
    )


def _intrinsics(camera: Mapping[str, Any]) -> Intrinsics | None:
    if camera["fx_px"] is None:
        return None
    numbers = {k: camera[k] for k in ("width_px", "height_px", "fx_px", "fy_px", "cx_px", "cy_px")}
    return Intrinsics(
        **numbers,
        distortion_model=str(camera["distortion_model"] or ""),
        distortion=tuple(camera["distortion"] or ()),
    )


def _long(measured: Measured, estimated: Estimated, method: Method) -> pa.Table:
    """Return the rows of a method that have a depth, in the schema of the table `estimates`."""
    known = np.isfinite(estimated.depth_m)
    in_range = estimated.in_calibrated_range
    columns: dict[str, object] = {
        name: getattr(estimated, name)[known]
        for name in ESTIMATES.names
        if hasattr(estimated, name) and name != "in_calibrated_range"
    }
    columns["observation_index"] = measured.observation_index[known]
    columns["method"] = [str(method)] * int(known.sum())
    columns["in_calibrated_range"] = pa.array(in_range[known] > 0, mask=np.isnan(in_range[known]))
    arrays = [pa.array(columns[f.name], type=f.type, from_pandas=True) for f in ESTIMATES]
    return pa.Table.from_arrays(arrays, schema=ESTIMATES)


def calibrations_table(calibrations: list[Calibration]) -> pa.Table:
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
