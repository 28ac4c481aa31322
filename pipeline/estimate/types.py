"""What every method takes and gives: columns of one camera of one recording."""

from __future__ import annotations

from dataclasses import dataclass, field, fields, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from pipeline.core.arrays import NAN, FloatArray, IntArray
from pipeline.core.records import GroundPlane, Intrinsics

TextArray = npt.NDArray[np.object_]
BoolArray = npt.NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class Boxes:
    """Boxes of other tracks in the same frames: they may hide what is estimated."""

    observation_index: IntArray
    frame_index: IntArray
    bbox_xyxy_px: FloatArray  # (k, 4)


@dataclass(frozen=True, slots=True)
class Measured:
    """What pass 1 measured, one row an observation: arrays of length n, NaN is unknown.

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
    others: Boxes | None = None  # None: nobody else is there

    def __len__(self) -> int:
        return len(self.observation_index)

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
        return replace(kept, others=Boxes(*map(np.concatenate, zip(*parts, strict=True))))


@dataclass(slots=True)
class Estimated:
    """What a method gives, one row an observation, NaN where it does not apply.

    `depth_m` is along the optical axis, `range_m` Euclidean; `x_m`, `y_m` are the position on the
    ground (right, ahead) where the pose is known, and across and along the axis where it is not.
    `depth_common_std_m` and `height_common_std_m` are the parts of `depth_std_m` and `height_std_m`
    that all frames of a track share (a calibration's error), so that they do not average out.
    `height_doubt_m` is the part of `height_std_m` that is there because the track may be no one person.
    `height_assumed` is True where the height was put in rather than measured. `speed_m_s` is known
    where positions were smoothed.
    `in_calibrated_range` is 1, 0, or NaN where the calibration states no range.
    """

    count: int
    depth_m: FloatArray = field(init=False)
    depth_std_m: FloatArray = field(init=False)
    depth_common_std_m: FloatArray = field(init=False)
    height_m: FloatArray = field(init=False)
    height_std_m: FloatArray = field(init=False)
    height_common_std_m: FloatArray = field(init=False)
    height_doubt_m: FloatArray = field(init=False)
    height_assumed: BoolArray = field(init=False)
    range_m: FloatArray = field(init=False)
    x_m: FloatArray = field(init=False)
    y_m: FloatArray = field(init=False)
    speed_m_s: FloatArray = field(init=False)
    in_calibrated_range: FloatArray = field(init=False)
    calibration_id: TextArray = field(init=False)
    branch: TextArray = field(init=False)  # of defocus: near or far of the plane of focus

    def __post_init__(self) -> None:
        for name in ("depth_m", "depth_std_m", "height_m", "height_std_m"):
            setattr(self, name, np.full(self.count, NAN))
        for name in ("depth_common_std_m", "height_common_std_m", "height_doubt_m"):
            setattr(self, name, np.zeros(self.count))
        for name in ("range_m", "x_m", "y_m", "speed_m_s", "in_calibrated_range"):
            setattr(self, name, np.full(self.count, NAN))
        self.height_assumed = np.zeros(self.count, dtype=np.bool_)
        self.calibration_id = np.full(self.count, None, dtype=np.object_)
        self.branch = np.full(self.count, None, dtype=np.object_)
