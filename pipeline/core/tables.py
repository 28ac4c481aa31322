"""Arrow schemas of the tables that the passes write.

Names and types are those of `schemas/sql/tables.sql`; a test holds the two together. Pass 1 leaves out
`recording_id` (the hash of a file is known when it has been read) and `run_id`; the store adds both.
"""

from __future__ import annotations

import pyarrow as pa

from pipeline.core.exposure import FIELDS


def _schema(*columns: tuple[str, pa.DataType]) -> pa.Schema:
    return pa.schema([pa.field(name, kind) for name, kind in columns])


_I32, _I64, _F32, _F64 = pa.int32(), pa.int64(), pa.float32(), pa.float64()

_TEXT, _BOOL = pa.string(), pa.bool_()

# Of a camera, and of each of its frames.
_LENS = (
    ("fx_px", _F64),
    ("fy_px", _F64),
    ("cx_px", _F64),
    ("cy_px", _F64),
    ("distortion_model", _TEXT),
    ("distortion", pa.list_(_F64)),
    ("intrinsics_source", _TEXT),
)

CAMERAS = _schema(
    ("camera", _TEXT),
    ("topic", _TEXT),
    ("frame_id", _TEXT),
    ("width_px", _I32),
    ("height_px", _I32),
    *_LENS,
    ("camera_height_m", _F64),
    ("camera_height_std_m", _F64),
    ("tilt_rad", _F64),
    ("tilt_std_rad", _F64),
    ("roll_rad", _F64),
    ("roll_std_rad", _F64),
    ("pose_source", _TEXT),
    ("recorded_height_m", _F64),
    ("recorded_tilt_rad", _F64),
    ("recorded_roll_rad", _F64),
    ("recorded_ground_frame", _TEXT),
    ("focal_std_px", _F64),
    ("centre_source", _TEXT),
    ("distortion_source", _TEXT),
    ("rectified_fx_px", _F64),
    ("rectified_fy_px", _F64),
    ("rectified_cx_px", _F64),
    ("rectified_cy_px", _F64),
    ("pose_loadings", pa.list_(_F64)),
)

FRAMES = _schema(
    ("camera", _TEXT),
    ("frame_index", _I32),
    ("log_time_ns", _I64),
    ("capture_time_ns", _I64),
    ("image_format", _TEXT),
    ("image_bytes", _I32),
    ("width_px", _I32),
    ("height_px", _I32),
    ("decoded", _BOOL),
    ("exposure_pairing", _TEXT),
    ("exposure_offset_ns", _I64),
    *((row.name, _F64) for row in FIELDS.values() if row.stored),
    ("luminance", _F64),
    ("clipped_fraction", _F64),
    ("ev100", _F64),
    ("scene_luminance_cd_m2", _F64),
    *_LENS,
)

TRACKS = _schema(
    ("camera", _TEXT),
    ("track_id", _I32),
    ("class_name", _TEXT),
    ("object_id", _TEXT),
    ("first_frame_index", _I32),
    ("last_frame_index", _I32),
    ("first_time_ns", _I64),
    ("last_time_ns", _I64),
    ("observation_count", _I32),
    ("filled_count", _I32),
    ("looked_at_count", _I32),
    ("confirmed_count", _I32),
    ("verdict", _TEXT),
)

OBSERVATIONS = _schema(
    ("observation_index", _I32),
    ("camera", _TEXT),
    ("frame_index", _I32),
    ("track_id", _I32),
    ("object_id", _TEXT),
    ("class_name", _TEXT),
    ("detector", _TEXT),
    ("score", _F64),
    ("x_min_px", _F64),
    ("y_min_px", _F64),
    ("x_max_px", _F64),
    ("y_max_px", _F64),
    ("x_min_std_px", _F64),
    ("y_min_std_px", _F64),
    ("x_max_std_px", _F64),
    ("y_max_std_px", _F64),
    ("truncated_left", _BOOL),
    ("truncated_top", _BOOL),
    ("truncated_right", _BOOL),
    ("truncated_bottom", _BOOL),
    ("occlusion", _F64),
    ("luminance", _F64),
    ("blur_sigma_px", _F64),
    ("blur_std_px", _F64),
    ("blur_edge_count", _I32),
    ("blur_reason", _TEXT),
    ("measured", _BOOL),
    ("confirmed", _BOOL),
    ("raw_x_min_px", _F64),
    ("raw_y_min_px", _F64),
    ("raw_x_max_px", _F64),
    ("raw_y_max_px", _F64),
)

# Observations on their way to the store: with colours, until tracks are linked by them.
OBSERVED = OBSERVATIONS.append(pa.field("colours", pa.binary()))

ESTIMATES = _schema(
    ("observation_index", _I32),
    ("method", _TEXT),
    ("calibration_id", _TEXT),
    ("depth_m", _F64),
    ("depth_std_m", _F64),
    ("height_m", _F64),
    ("height_std_m", _F64),
    ("height_assumed", _BOOL),
    ("range_m", _F64),
    ("x_m", _F64),
    ("y_m", _F64),
    ("in_calibrated_range", _BOOL),
    ("branch", _TEXT),
)

BACKGROUND_LINES = _schema(
    ("camera", _TEXT),
    ("x0_px", _F64),
    ("y0_px", _F64),
    ("x1_px", _F64),
    ("y1_px", _F64),
)

TRACK_HEIGHTS = _schema(
    ("camera", _TEXT),
    ("track_id", _I32),
    ("method", _TEXT),
    ("height_m", _F64),
    ("height_std_m", _F64),
    ("height_assumed", _BOOL),
    ("height_plausible", _BOOL),
    ("depth_min_m", _F64),
    ("depth_median_m", _F64),
    ("depth_max_m", _F64),
    ("observation_count", _I32),
    ("height_low_m", _F64),
    ("height_high_m", _F64),
    ("own_std_m", _F64),
    ("common_loadings_m", pa.list_(pa.float32(), 6)),
    ("scale_share", _F32),
    ("camera_share", _F32),
    ("boxes_share", _F32),
    ("posture_share", _F32),
    ("doubt_share", _F32),
)

TRACK_CADENCES = _schema(
    ("camera", _TEXT),
    ("track_id", _I32),
    ("cadence_hz", _F64),
    ("cadence_std_hz", _F64),
    ("window_count", _I32),
    ("speed_m_s", _F64),
)

OBSERVATION_QUALITY = _schema(
    ("observation_index", _I32),
    ("quality", _F64),
    ("contact_visible", _BOOL),
    ("head_visible", _BOOL),
    ("aspect_plausible", _BOOL),
    ("alone", _BOOL),
    ("stride_phase_rad", _F64),
)

GROUND_TRUTH = _schema(
    ("camera", _TEXT),
    ("frame_index", _I32),
    ("object_id", _TEXT),
    ("class_name", _TEXT),
    ("depth_m", _F64),
    ("range_m", _F64),
    ("height_m", _F64),
    ("width_m", _F64),
    ("x_m", _F64),
    ("y_m", _F64),
    ("x_min_px", _F64),
    ("y_min_px", _F64),
    ("x_max_px", _F64),
    ("y_max_px", _F64),
)

CALIBRATIONS = _schema(
    ("calibration_id", _TEXT),
    ("camera", _TEXT),
    ("object_class", _TEXT),
    ("dimension", _TEXT),
    ("method", _TEXT),
    ("parameter", _TEXT),
    ("f_number", _F64),
    ("value", _F64),
    ("std_error", _F64),
    ("residual_std_m", _F64),
    ("observation_count", _I32),
    ("depth_min_m", _F64),
    ("depth_max_m", _F64),
    ("loo_rmse_m", _F64),
    ("kfold_rmse_m", _F64),
    ("fit_rmse_m", _F64),
    ("source", _TEXT),
)

DIAGNOSTICS = _schema(
    ("severity", _TEXT),
    ("code", _TEXT),
    ("message", _TEXT),
    ("camera", _TEXT),
    ("topic", _TEXT),
    ("byte_offset", _I64),
    ("log_time_ns", _I64),
    ("end_time_ns", _I64),
    ("count", _I64),
)

# What pass 1 writes, in the order in which the store takes it.
PASS_ONE = {
    "cameras": CAMERAS,
    "frames": FRAMES,
    "tracks": TRACKS,
    "background_lines": BACKGROUND_LINES,
    "observations": OBSERVATIONS,
    "ground_truth": GROUND_TRUTH,
    "diagnostics": DIAGNOSTICS,
}

# Schemas of the parts that pass 1 leaves, by table.
PARTS = PASS_ONE | {"observations": OBSERVED}

# What pass 2 writes.
PASS_TWO = {
    "estimates": ESTIMATES,
    "track_heights": TRACK_HEIGHTS,
    "observation_quality": OBSERVATION_QUALITY,
    "track_cadences": TRACK_CADENCES,
    "calibrations": CALIBRATIONS,
}
