"""Records that flow between the stages: small frozen dataclasses and structures of arrays.

Everything that is kept is columns (`pipeline.core.tables`). Unknown is NaN in numpy and null in Arrow,
never zero. Boxes are the outer edges in pixels of the stored picture, where the centre of the first
pixel is (0, 0).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import StrEnum

import numpy as np
import numpy.typing as npt

from pipeline.core.arrays import NAN, BoolArray, FloatArray
from pipeline.core.exposure import Exposure


class Pairing(StrEnum):
    """Origin of the exposure of a frame."""

    NEAREST = "nearest"  # an exposure within the tolerance
    LAST_KNOWN = "last_known"  # none within the tolerance; the last one before the frame
    EMBEDDED = "embedded"  # no message; the picture's own EXIF
    NONE = "none"  # the recording has no exposure at or before the frame


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
class LensClaim:
    """A calibration as a message states it, before it is known for which pictures it holds.

    Fields as `sensor_msgs/CameraInfo` defines them; `foxglove.CameraCalibration` has no binning and no
    region. Sizes and offsets in pixels of the whole sensor, 0 where nothing is stated.
    """

    width_px: int
    height_px: int
    k: tuple[float, ...]  # camera matrix, (3, 3) row by row; empty: none
    p: tuple[float, ...] = ()  # projection of rectified pictures, (3, 4) row by row; empty: none
    distortion_model: str = ""
    distortion: tuple[float, ...] = ()
    binning: tuple[int, int] = (1, 1)
    region: tuple[int, int, int, int] = (0, 0, 0, 0)  # left, top, width, height


@dataclass(frozen=True, slots=True)
class FoundLens:
    """A lens that nothing told of, found with the camera's pose."""

    intrinsics: Intrinsics
    std_px: float  # of the focal length


@dataclass(frozen=True, slots=True)
class Boxes:
    """Boxes that a detector found in one frame: a structure of n-long arrays."""

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
    """Predicted boxes of tracks in a frame that is not looked at yet: a structure of n-long arrays."""

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
    """Layout of bare pixels in their bytes; `encoding` is ROS' or Foxglove's name, or i420."""

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
    rectified: Intrinsics | None = None  # the lens if the picture was rectified, where that is open


class Severity(StrEnum):
    """Severity of a diagnostic."""

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
    """The pose of a fixed camera above flat ground, with its covariance."""

    camera_height_m: float
    tilt_rad: float
    roll_rad: float = 0.0
    # (3, 3) over (camera_height_m, tilt_rad, roll_rad)
    covariance: FloatArray = field(default_factory=lambda: np.zeros((3, 3)))
    source: str = "given"  # "given", "transforms", "walkers", "truth"
    # (4,): of the logarithm of the focal length with those three, and its variance, where it was found
    # together with them; None where the lens is known beside
    focal_covariance: FloatArray | None = None
