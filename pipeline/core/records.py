"""The typed records that flow between the stages.

In-stream records are small frozen dataclasses. Everything that is kept is columns: an Arrow schema
a table, whose names and types are those of `schemas/sql/tables.sql` (a test holds the two together).
Pass 1 leaves out `recording_id` (the hash of a file is known when it has been read) and `run_id`;
the store adds both when it commits.

Unknown is NaN in numpy and null in Arrow, never zero. Boxes are the outer edges in pixels of the
stored picture, where the centre of the first pixel is (0, 0).
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field, fields
from enum import StrEnum

import numpy as np
import numpy.typing as npt
import pyarrow as pa

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]
BoolArray = npt.NDArray[np.bool_]

NAN = float("nan")


class Pairing(StrEnum):
    """How a frame came by its exposure."""

    NEAREST = "nearest"  # an exposure within the tolerance
    LAST_KNOWN = "last_known"  # none within the tolerance; the last one before the frame
    EMBEDDED = "embedded"  # no message; the picture's own EXIF
    NONE = "none"  # the recording has no exposure at or before the frame


class Method(StrEnum):
    """How a depth came about (DESIGN, section 2)."""

    APERTURE = "aperture"
    INVERSE = "inverse"
    SIZE = "size"
    GROUND = "ground"
    DEFOCUS = "defocus"
    FUSED = "fused"


class Dimension(StrEnum):
    """Which side of the box a size or a calibration speaks of."""

    WIDTH = "width"
    HEIGHT = "height"


@dataclass(frozen=True, slots=True)
class Exposure:
    """Lens and exposure settings of one frame, in the units of `stadimeter.CameraExposure`."""

    exposure_time_s: float = NAN
    f_number: float = NAN
    iso_speed: float = NAN
    exposure_bias_ev: float = NAN
    focal_length_mm: float = NAN
    focus_distance_m: float = NAN
    gain_db: float = NAN
    digital_zoom_ratio: float = NAN
    pixel_pitch_x_um: float = NAN
    pixel_pitch_y_um: float = NAN
    sensor_width_px: float = NAN
    sensor_height_px: float = NAN


UNKNOWN_EXPOSURE = Exposure()
EXPOSURE_FIELDS = tuple(f.name for f in fields(Exposure))


@dataclass(frozen=True, slots=True)
class Intrinsics:
    """A pinhole camera with distortion, in pixels of the stored picture."""

    width_px: int
    height_px: int
    fx_px: float
    fy_px: float
    cx_px: float
    cy_px: float
    distortion_model: str = ""
    distortion: tuple[float, ...] = ()


@dataclass(frozen=True, slots=True)
class FoundLens:
    """A lens that nothing told of, found with the camera's pose."""

    intrinsics: Intrinsics
    std_px: float  # of the focal length


@dataclass(frozen=True, slots=True)
class Boxes:
    """What a detector found in one frame: a structure of n-long arrays."""

    bbox_xyxy_px: FloatArray  # (n, 4)
    score: FloatArray  # (n,), 0..1
    class_name: tuple[str, ...]
    std_px: FloatArray  # (n, 4), one sigma of each edge
    object_id: tuple[str | None, ...]  # the recording's own id, stable over frames

    def __len__(self) -> int:
        return len(self.score)

    @staticmethod
    def empty() -> Boxes:
        """Return no boxes."""
        return Boxes(np.empty((0, 4)), np.empty(0), (), np.empty((0, 4)), ())

    def take(self, index: npt.NDArray[np.intp] | npt.NDArray[np.bool_]) -> Boxes:
        """Return the boxes at `index`: positions, or a mask."""
        rows = np.arange(len(self))[index]
        return Boxes(
            self.bbox_xyxy_px[rows],
            self.score[rows],
            tuple(self.class_name[i] for i in rows),
            self.std_px[rows],
            tuple(self.object_id[i] for i in rows),
        )


@dataclass(frozen=True, slots=True)
class Expected:
    """Where tracks must be in a frame that is not looked at yet: a structure of n-long arrays."""

    bbox_xyxy_px: FloatArray  # (n, 4)
    walked: BoolArray  # (n,), whether they have come from elsewhere


@dataclass(frozen=True, slots=True)
class TrueObject:
    """Ground truth of one object in one frame; NaN is unknown."""

    object_id: str
    class_name: str
    depth_m: float = NAN
    range_m: float = NAN
    height_m: float = NAN
    width_m: float = NAN
    x_m: float = NAN
    y_m: float = NAN
    bbox_xyxy_px: tuple[float, float, float, float] = (NAN, NAN, NAN, NAN)


@dataclass(frozen=True, slots=True)
class RawLayout:
    """How bare pixels lie in their bytes; `encoding` is ROS' or Foxglove's name, or i420."""

    encoding: str
    width_px: int
    height_px: int
    step_bytes: int = 0  # from one row to the next; 0: no padding
    big_endian: bool = False
    bits: int = 16  # used ones, where samples are 16 bits wide


@dataclass(frozen=True, slots=True)
class Frame:
    """One picture of one camera, still encoded, with all that belongs to its time.

    Where `layout` is given, the picture is bare pixels, and not a JPEG, PNG or WebP.
    """

    camera: str
    frame_index: int
    log_time_ns: int
    capture_time_ns: int
    image_format: str
    image: bytes
    exposure: Exposure
    exposure_pairing: Pairing
    exposure_offset_ns: int | None
    intrinsics: Intrinsics | None
    detections: Boxes | None  # None: the recording has no detections for this frame
    truth: tuple[TrueObject, ...]
    topic: str
    byte_offset: int
    layout: RawLayout | None = None


class Severity(StrEnum):
    """How much a diagnostic matters."""

    INFO = "info"
    WARNING = "warning"  # a value was refused or assumed
    ERROR = "error"  # data were lost


@dataclass(frozen=True, slots=True)
class Diagnostic:
    """Something in the input that was refused, repaired, assumed or lost."""

    severity: Severity
    code: str  # a stable word for SQL: "damaged_chunk", "invalid_exposure", ...
    message: str
    camera: str | None = None
    topic: str | None = None
    byte_offset: int | None = None
    log_time_ns: int | None = None
    end_time_ns: int | None = None
    count: int = 1  # how many times it happened; the place is the first one's


@dataclass(frozen=True, slots=True)
class GroundPlane:
    """The pose of a fixed camera above flat ground (DESIGN, section 2), with its covariance."""

    camera_height_m: float
    tilt_rad: float
    roll_rad: float = 0.0
    # (3, 3) over (camera_height_m, tilt_rad, roll_rad)
    covariance: FloatArray = field(default_factory=lambda: np.zeros((3, 3)))
    source: str = "given"  # "given", "transforms", "walkers", "truth"
    # (4,): of the logarithm of the focal length with those three, and its variance, where it was found
    # together with them; None where the lens is known beside
    focal_covariance: FloatArray | None = None


def _schema(*columns: tuple[str, pa.DataType]) -> pa.Schema:
    return pa.schema([pa.field(name, kind) for name, kind in columns])


_I32, _I64, _F64 = pa.int32(), pa.int64(), pa.float64()
_TEXT, _BOOL = pa.string(), pa.bool_()

CAMERAS = _schema(
    ("camera", _TEXT),
    ("topic", _TEXT),
    ("frame_id", _TEXT),
    ("width_px", _I32),
    ("height_px", _I32),
    ("fx_px", _F64),
    ("fy_px", _F64),
    ("cx_px", _F64),
    ("cy_px", _F64),
    ("distortion_model", _TEXT),
    ("distortion", pa.list_(_F64)),
    ("intrinsics_source", _TEXT),
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
    ("exposure_time_s", _F64),
    ("f_number", _F64),
    ("iso_speed", _F64),
    ("exposure_bias_ev", _F64),
    ("gain_db", _F64),
    ("focal_length_mm", _F64),
    ("focus_distance_m", _F64),
    ("pixel_pitch_x_um", _F64),
    ("pixel_pitch_y_um", _F64),
    ("luminance", _F64),
    ("clipped_fraction", _F64),
    ("ev100", _F64),
    ("scene_luminance_cd_m2", _F64),
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
)

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

# What pass 2 writes.
PASS_TWO = {
    "estimates": ESTIMATES,
    "track_heights": TRACK_HEIGHTS,
    "observation_quality": OBSERVATION_QUALITY,
    "calibrations": CALIBRATIONS,
}


@dataclass(frozen=True, slots=True)
class Parameter:
    """One fitted number; `f_number` where it holds for one aperture only (the paper's k)."""

    name: str
    value: float
    std_error: float = NAN
    f_number: float = NAN


@dataclass(frozen=True, slots=True)
class Calibration:
    """What turns a size in the picture into a depth, for one camera, object class and dimension.

    A calibration of the paper's kind is an object size in disguise (DESIGN, section 1), so it
    belongs to what it was made on. Empty `camera` means any camera.

    Parameters by method: `aperture` has one `k` an f-number (Eq. 16); `inverse` has `b0_m` and
    `b1_m_mm` (Eq. 17: depth = b0 + b1 / size on the sensor); `size` has `object_size_m`.
    """

    method: Method
    object_class: str
    dimension: Dimension
    parameters: tuple[Parameter, ...]
    camera: str = ""
    residual_std_m: float = NAN  # spread of depth about the fit
    observation_count: int = 0
    depth_min_m: float = NAN  # the range in which it was fitted
    depth_max_m: float = NAN
    fit_rmse_m: float = NAN
    loo_rmse_m: float = NAN
    kfold_rmse_m: float = NAN
    source: str = ""

    @property
    def calibration_id(self) -> str:
        """Return a name that changes when any number of the calibration changes."""
        return hashlib.sha256(repr(self).encode()).hexdigest()[:12]

    def value(self, name: str) -> float:
        """Return a parameter that does not depend on the aperture; NaN if there is none."""
        return next((p.value for p in self.parameters if p.name == name), NAN)

    def std_error(self, name: str) -> float:
        """Return the standard error of a parameter that does not depend on the aperture."""
        return next((p.std_error for p in self.parameters if p.name == name), NAN)

    def by_f_number(self, name: str) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return f-numbers, values and standard errors, (n,) each, by rising f-number."""
        rows = sorted((p.f_number, p.value, p.std_error) for p in self.parameters if p.name == name)
        table = np.array(rows, dtype=np.float64).reshape(-1, 3)
        return table[:, 0], table[:, 1], table[:, 2]
