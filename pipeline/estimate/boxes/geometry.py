"""Sizes of boxes and directions of their ends, with their deviations: computed once for all methods."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
import pandas as pd

from pipeline.core.arrays import FloatArray
from pipeline.core.records import GroundPlane
from pipeline.estimate.boxes.ends import Directions, Ends
from pipeline.estimate.boxes.scatter import Scatter
from pipeline.estimate.types import Estimated, Measured
from pipeline.optics.thin_lens import image_distance_mm

# What all frames of a track have in common, beside what is each one's own: shoes of the ground's colour,
# a bag, a shadow. The depths of whole tracks of the motion detector are off by that (36 rendered
# recordings), from the best tracks to the worst.
COMMON_SHARE = 0.9
# A box that a recording gives may be drawn down to the shoes, as a silhouette ends, or down to the ground
# below the body, as a point on the ground is marked; one of them holds for all boxes of a recording. The
# reach is taken as a silhouette's. Where both are as likely, its error is none or all of it: sqrt(1/2).
REACH_CONVENTION_STD = 0.71


@dataclass(frozen=True)
class Geometry:
    """Boxes of one camera as undistorted normalised coordinates (x right, y down, at distance 1).

    Without intrinsics they come from pixel pitch and image distance, which tells sizes but not
    directions: those are NaN.

    It is never changed; `with_reach`, `with_scatter` and `after` return a new one, and what does not
    depend on the change (`ends`) is shared. `reach_std` is how the reach of bodies differs from frame to
    frame, (n,), NaN for what is a line. `scatter` is what the track's own heights say of the boxes;
    `measured` has that in its deviations already. `earlier` is what other methods made of the boxes, by
    name, for methods that come after them.
    """

    measured: Measured
    ends: Ends
    reach_std: FloatArray | None = None
    scatter: Scatter | None = None
    earlier: Mapping[str, Estimated] = field(default_factory=dict)

    @classmethod
    def of(cls, measured: Measured) -> Geometry:
        """Return the geometry of boxes around lines."""
        return cls(measured, Ends(Directions(measured)))

    def with_reach(self, reach: FloatArray, reach_std: FloatArray | None = None) -> Geometry:
        """Return the same boxes, around bodies."""
        ends = Ends(self.ends.directions, reach)
        return replace(self, ends=ends, reach_std=reach_std)

    def with_scatter(self, scatter: Scatter) -> Geometry:
        """Return the same boxes, as good as the heights of their tracks say."""
        std_px = self.measured.std_xyxy_px.copy()
        std_px[:, [1, 3]] *= np.sqrt(scatter.ratio)[:, None]
        measured = replace(self.measured, std_xyxy_px=std_px)
        return replace(self, measured=measured, scatter=scatter)

    def after(self, earlier: Mapping[str, Estimated]) -> Geometry:
        """Return the same boxes, with what other methods made of them."""
        return replace(self, earlier=dict(earlier))

    @property
    def reach(self) -> FloatArray | None:
        """Distance of lower ends before the axes of bodies, in shares of their height, (n,)."""
        return self.ends.reach

    @property
    def reach_m(self) -> FloatArray:
        """Depth that the reach makes, in metres for each unit of it, (n,); 0 for a line."""
        return self.ends.reach_m

    @property
    def middle(self) -> FloatArray:
        """Middle of the box, (n, 2), the camera's roll removed."""
        return self.ends.directions.middle

    @cached_property
    def image_distance_mm(self) -> FloatArray:
        """Image distance of every frame: f where the focus is infinite or unknown."""
        m = self.measured
        return image_distance_mm(m.focus_distance_m, m.focal_length_mm)

    @cached_property
    def width_on_sensor_mm(self) -> FloatArray:
        """Width of the box on the sensor, the lens's distortion removed.

        NaN where a side is cut off or the pitch is unknown.
        """
        m = self.measured
        width_px = m.bbox_xyxy_px[:, 2] - m.bbox_xyxy_px[:, 0]
        if m.intrinsics is not None and m.intrinsics.distortion_model:
            width_px = self.ends.directions.sides * m.intrinsics.fx_px
        return np.where(self.measured.width_cut, np.nan, width_px * m.pixel_pitch_x_um * 1e-3)

    @cached_property
    def height_on_sensor_mm(self) -> FloatArray:
        """Height of the box on the sensor, the lens's distortion removed.

        NaN where an end is cut off or the pitch is unknown.
        """
        m = self.measured
        height_px = m.bbox_xyxy_px[:, 3] - m.bbox_xyxy_px[:, 1]
        if m.intrinsics is not None and m.intrinsics.distortion_model:
            height_px = (self.foot - self.head)[:, 1] * m.intrinsics.fy_px
        return np.where(self.measured.height_cut, np.nan, height_px * m.pixel_pitch_y_um * 1e-3)

    @cached_property
    def width_angle(self) -> FloatArray:
        """Width of the box at unit distance; NaN where a side is cut off."""
        if self.measured.intrinsics is None:
            return np.asarray(self.width_on_sensor_mm / self.image_distance_mm)
        return np.where(self.measured.width_cut, np.nan, self.ends.directions.sides)

    @cached_property
    def height_angle(self) -> FloatArray:
        """Height of the box at unit distance; NaN where an end is cut off."""
        if self.measured.intrinsics is None:
            return np.asarray(self.height_on_sensor_mm / self.image_distance_mm)
        return np.where(self.measured.height_cut, np.nan, (self.foot - self.head)[:, 1])

    @cached_property
    def width_angle_std(self) -> FloatArray:
        """Standard deviation of `width_angle`."""
        m = self.measured
        if m.intrinsics is None:
            return np.asarray(self.width_std_mm / self.image_distance_mm)
        return np.asarray(np.hypot(m.std_xyxy_px[:, 0], m.std_xyxy_px[:, 2]) / m.intrinsics.fx_px)

    @cached_property
    def height_angle_std(self) -> FloatArray:
        """Standard deviation of `height_angle`."""
        if self.measured.intrinsics is None:
            return np.asarray(self.height_std_mm / self.image_distance_mm)
        return np.hypot(self.foot_std, self.head_std)

    @cached_property
    def width_std_mm(self) -> FloatArray:
        """Standard deviation of the width: both sides' errors, independent."""
        m = self.measured
        std_px = np.hypot(m.std_xyxy_px[:, 0], m.std_xyxy_px[:, 2])
        return np.asarray(std_px * m.pixel_pitch_x_um * 1e-3)

    @cached_property
    def height_std_mm(self) -> FloatArray:
        """Standard deviation of the height: both ends' errors, independent."""
        m = self.measured
        std_px = np.hypot(m.std_xyxy_px[:, 1], m.std_xyxy_px[:, 3])
        return np.asarray(std_px * m.pixel_pitch_y_um * 1e-3)

    @property
    def foot(self) -> FloatArray:
        """Lower end of the object, where it stands, (n, 2), the camera's roll removed."""
        return self.ends.both[0]

    @property
    def head(self) -> FloatArray:
        """Its upper end, (n, 2), the camera's roll removed."""
        return self.ends.both[1]

    @cached_property
    def foot_std(self) -> FloatArray:
        """Standard deviation of the foot's row, normalised: of the lower edge, and of the stride."""
        return np.hypot(self._std(3), self.swing_std)

    @cached_property
    def swing_std(self) -> FloatArray:
        """The part of `foot_std` that is of the stride."""
        plane = self.measured.ground_plane
        if self.reach_std is None or plane is None:
            return np.zeros(len(self.measured))
        return np.nan_to_num(self._foot_by_reach(plane) * self.reach_std)

    def _foot_by_reach(self, plane: GroundPlane) -> FloatArray:
        """Return the foot's row, normalised, by a unit of reach: dy = slope^2 dZ / h."""
        tilt = plane.tilt_rad
        slope = self.foot[:, 1] * np.cos(tilt) + np.sin(tilt)
        return np.asarray(slope**2 / plane.camera_height_m * self.reach_m)

    @cached_property
    def common_std(self) -> FloatArray:
        """Standard deviations of what the ends have in common along a track, (n, 2): foot, head.

        In proportion to what is each frame's own, at the track's median; of the foot of a body also how
        its boxes end.
        """
        m, tall = self.measured, (self.foot - self.head)[:, 1]
        with np.errstate(invalid="ignore", divide="ignore"):
            share = np.column_stack([self._std(3), self._std(1)]) / tall[:, None]
        share[~np.isfinite(share)] = np.nan
        of_track = pd.DataFrame(share).groupby(m.track_id).transform("median").to_numpy()
        common = np.nan_to_num(COMMON_SHARE * of_track * tall[:, None])
        reach = self.ends.reach
        if reach is not None and m.ground_plane is not None and m.recorded is not None:
            convention = REACH_CONVENTION_STD * reach * self._foot_by_reach(m.ground_plane)
            convention = np.where(m.recorded, convention, 0.0)
            common[:, 0] = np.hypot(common[:, 0], np.nan_to_num(convention))
        return common

    @cached_property
    def head_std(self) -> FloatArray:
        """Standard deviation of the upper edge, normalised."""
        return self._std(1)

    def _std(self, edge: int) -> FloatArray:
        m = self.measured
        if m.intrinsics is None:
            return np.full(len(m), np.nan)
        return np.asarray(m.std_xyxy_px[:, edge] / m.intrinsics.fy_px)
