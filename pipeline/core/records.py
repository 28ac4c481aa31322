"""Records that flow between the stages: small frozen dataclasses and structures of arrays.

Everything that is kept is columns (`pipeline.core.tables`). Unknown is NaN in numpy and null in Arrow,
never zero. Boxes are the outer edges in pixels of the stored picture, where the centre of the first
pixel is (0, 0).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import IntEnum, StrEnum

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
class KnownLength:
    """A length in metres between two points of a camera's pictures: of a tile, a post, a door."""

    # x, y, x, y as recorded; of an upright length the first is its foot, which stands on the ground
    points_px: tuple[float, ...]
    length_m: float
    std_m: float = 0.0  # of who measured it, or of doors and vehicles of that kind
    std_px: float = 1.0  # of the points, as somebody marks them
    upright: bool = False  # else both points are on the ground


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


RANK = 6  # of what is stored of `JointErrors`: the scale, and five directions for all the rest


class Error(IntEnum):
    """The unknowns, in the order of every slope and covariance."""

    LOG_HEIGHT = 0  # of the camera above the ground
    TILT = 1
    ROLL = 2
    REACH = 3  # of all feet before their bodies' axes, a share of the stature
    SIDE = 4  # boxes too tall by this share a standard deviation farther right
    NEAR_HEAD = 5  # their heads too high by this share when e times nearer
    NEAR_FOOT = 6  # their feet too low by this share when e times nearer
    ALL = 7  # all boxes too tall by this share
    BEND = 8  # points times (1 + k r^2) are where they should be
    LOG_FOCAL = 9


BOXES = (Error.SIDE, Error.NEAR_HEAD, Error.NEAR_FOOT, Error.ALL)


@dataclass(frozen=True, slots=True, eq=False)
class JointErrors:
    """Errors that a camera's pose has in common with the very boxes it was found from.

    One linear model holds them: the unknowns of `Error`, with one covariance C. An error of a height or
    a depth is its slopes over them times their errors, so what two of them have in common cancels or
    adds by itself. Everything is in logarithms: a slope is by how much of itself a length is off.

    The covariance is in parts, each a factor F (10, k) with F F' the covariance.

    `scale` is what the mean stature of the people here, or what is known instead, may be off;
    `boxes` what the considered biases of boxes do, with what the pose does for them; `camera` the rest.
    """

    scale: FloatArray  # (10, 1)
    camera: FloatArray  # (10, k)
    boxes: FloatArray  # (10, k)
    low_rank: FloatArray  # (10, RANK) about all of them; the first column is that of the scale
    near_log_m: float  # the log of the depth at which boxes are neither near nor far
    right_mean: float  # of columns of feet, normalised
    right_std: float

    @property
    def covariance(self) -> FloatArray:
        """C, (10, 10)."""
        whole = np.hstack([self.scale, self.camera, self.boxes])
        return np.asarray(whole @ whole.T)

    def variance(self, slopes: FloatArray) -> FloatArray:
        """Return the variance of what has these slopes, (n, 10), in all parts, (n,)."""
        return self.variance_of(slopes, np.hstack([self.scale, self.camera, self.boxes]))

    @staticmethod
    def variance_of(slopes: FloatArray, factor: FloatArray) -> FloatArray:
        """Return the part of a variance that a factor makes, (n,)."""
        return np.asarray(((slopes @ factor) ** 2).sum(axis=1))


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
    joint: JointErrors | None = None  # where it was found from these very boxes
