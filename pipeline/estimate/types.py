"""Input and output of every method: columns of one camera of one recording."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from pipeline.core.arrays import NAN, FloatArray, IntArray
from pipeline.core.records import Diagnostic, GroundPlane, Intrinsics
from pipeline.core.robust import noise_part

TextArray = npt.NDArray[np.object_]
BoolArray = npt.NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class OtherBoxes:
    """Boxes of other tracks in the same frames: they may hide what is estimated."""

    observation_index: IntArray
    frame_index: IntArray
    bbox_xyxy_px: FloatArray  # (k, 4)


@dataclass(frozen=True, slots=True)
class SweepFloor:
    """The camera's own softness by all its aperture sweeps, in one round of their fit."""

    px2: float
    px2_std: float
    scale: float  # by which points scatter more than they should


@dataclass(frozen=True, slots=True)
class CameraBlur:
    """Verdict of the blur of all of a camera, or of a fair sample of its tracks."""

    contradicted: Diagnostic | None = None
    floor: tuple[SweepFloor, ...] | None = None  # by sweeps, a round of the fit each


@dataclass(frozen=True, slots=True)
class Measured:
    """Measurements of pass 1, one row an observation: arrays of length n, NaN is unknown.

    Tracks are whole. They need not be all of the camera: the boxes of the others are in `others` then.
    """

    camera: str
    observation_index: IntArray
    frame_index: IntArray
    capture_time_ns: IntArray
    track_id: IntArray
    class_name: TextArray
    bbox_xyxy_px: FloatArray  # (n, 4)
    std_xyxy_px: FloatArray  # (n, 4)
    truncated: BoolArray  # (n, 4): left, top, right, bottom
    occlusion: FloatArray
    f_number: FloatArray
    focal_length_mm: FloatArray
    focus_distance_m: FloatArray
    pixel_pitch_x_um: FloatArray
    pixel_pitch_y_um: FloatArray
    intrinsics: Intrinsics | None
    ground_plane: GroundPlane | None
    exposure_time_s: FloatArray | None = None
    blur_sigma_px: FloatArray | None = None  # None: nobody looked
    blur_std_px: FloatArray | None = None
    filled: BoolArray | None = None  # boxes that nobody measured: gaps of a track
    recorded: BoolArray | None = None  # boxes that the recording gave; None: they are silhouettes
    raw_bbox_xyxy_px: FloatArray | None = None  # (n, 4), as the detector gave them, not smoothed
    others: OtherBoxes | None = None  # None: nobody else is there
    camera_blur: CameraBlur | None = None  # None: these are all of the camera

    def __len__(self) -> int:
        return len(self.observation_index)

    @property
    def width_cut(self) -> BoolArray:
        """True for a box whose left or right side the picture cuts off, (n,)."""
        return np.asarray(self.truncated[:, 0] | self.truncated[:, 2])

    @property
    def height_cut(self) -> BoolArray:
        """True for a box whose upper or lower end the picture cuts off, (n,)."""
        return np.asarray(self.truncated[:, 1] | self.truncated[:, 3])

    def take(self, rows: BoolArray) -> Measured:
        """Return the observations of a mask (n,)."""
        columns: dict[str, Any] = {f.name: getattr(self, f.name) for f in fields(self)}
        kept: dict[str, Any] = {k: v[rows] for k, v in columns.items() if isinstance(v, np.ndarray)}
        return replace(self, **kept)

    def only(self, track_ids: IntArray) -> Measured:
        """Return some tracks, and what else is in their frames as boxes."""
        mine = np.isin(self.track_id, track_ids)
        kept = self.take(mine)
        beside = ~mine & np.isin(self.frame_index, kept.frame_index)
        columns = ("observation_index", "frame_index", "bbox_xyxy_px")
        parts = [tuple(getattr(self, name)[beside] for name in columns)]
        if self.others is not None:
            there = np.isin(self.others.frame_index, kept.frame_index)
            parts.append(tuple(getattr(self.others, name)[there] for name in columns))
        return replace(kept, others=OtherBoxes(*map(np.concatenate, zip(*parts, strict=True))))


@dataclass(frozen=True, slots=True, eq=False)
class Estimated:
    """Estimates of a method, one row an observation, (n,) each, NaN where it does not apply.

    It is never changed: each step makes a new one (`dataclasses.replace`).

    `depth_m` is along the optical axis, `range_m` Euclidean; `x_m`, `y_m` are the position on the
    ground (right, ahead) where the pose is known, and across and along the axis where it is not.
    `depth_common_std_m` and `height_common_std_m` are the parts of `depth_std_m` and `height_std_m`
    that all frames of a track share (a calibration's error), so that they do not average out.
    `height_doubt_m` is the part of `height_std_m` that is there because the track may be no one person.
    `height_assumed` is True where the height was put in rather than measured. `speed_m_s` is known
    where positions were smoothed.
    `in_calibrated_range` is 1, 0, or NaN where the calibration states no range.
    """

    depth_m: FloatArray
    depth_std_m: FloatArray
    depth_common_std_m: FloatArray
    height_m: FloatArray
    height_std_m: FloatArray
    height_common_std_m: FloatArray
    height_doubt_m: FloatArray
    height_assumed: BoolArray
    range_m: FloatArray
    x_m: FloatArray
    y_m: FloatArray
    speed_m_s: FloatArray
    in_calibrated_range: FloatArray
    calibration_id: TextArray
    branch: TextArray  # of defocus: near or far of the plane of focus
    notes: tuple[Diagnostic, ...] = ()  # what is to be said of them

    @classmethod
    def unknown(cls, count: int) -> Estimated:
        """Return estimates of observations of which nothing is known yet."""
        nan, zero = np.full(count, NAN), np.zeros(count)
        none: TextArray = np.full(count, None, dtype=np.object_)
        false: BoolArray = np.zeros(count, dtype=np.bool_)
        for shared in (nan, zero, none, false):
            shared.setflags(write=False)
        return cls(
            depth_m=nan,
            depth_std_m=nan,
            depth_common_std_m=zero,
            height_m=nan,
            height_std_m=nan,
            height_common_std_m=zero,
            height_doubt_m=zero,
            height_assumed=false,
            range_m=nan,
            x_m=nan,
            y_m=nan,
            speed_m_s=nan,
            in_calibrated_range=nan,
            calibration_id=none,
            branch=none,
        )

    def __len__(self) -> int:
        return len(self.depth_m)

    @property
    def depth_noise_m(self) -> FloatArray:
        """The part of `depth_std_m` that differs from frame to frame, (n,)."""
        return noise_part(self.depth_std_m, self.depth_common_std_m)

    @property
    def height_noise_m(self) -> FloatArray:
        """The part of `height_std_m` that differs from frame to frame, (n,)."""
        return noise_part(self.height_std_m, self.height_common_std_m)
