"""The ends of a box as angles: what every method needs of the camera, computed once."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import pandas as pd

from pipeline.core.arrays import FloatArray
from pipeline.core.records import Intrinsics
from pipeline.estimate.boxes.scatter import Scatter
from pipeline.estimate.types import BoolArray, Measured
from pipeline.optics.distortion import check_distortion
from pipeline.optics.ground_plane import foot_depth_m, height_m, remove_roll
from pipeline.optics.pinhole import PinholeCamera
from pipeline.optics.silhouette import axis_rows
from pipeline.optics.thin_lens import image_distance_mm

# What all frames of a track have in common, beside what is each one's own: shoes of the ground's colour,
# a bag, a shadow. The depths of whole tracks of the motion detector are off by that (36 rendered
# recordings), from the best tracks to the worst.
COMMON_SHARE = 0.9


def camera_of(intrinsics: Intrinsics) -> PinholeCamera:
    """Return the optics' camera; a distortion that the optics cannot use counts as none."""
    model, coefficients = intrinsics.distortion_model, intrinsics.distortion
    try:
        check_distortion(model, coefficients)
    except ValueError:
        model, coefficients = "", ()
    return PinholeCamera(
        intrinsics.fx_px,
        intrinsics.fy_px,
        intrinsics.cx_px,
        intrinsics.cy_px,
        intrinsics.width_px,
        intrinsics.height_px,
        model,
        coefficients,
    )


@dataclass(frozen=True)
class Geometry:
    """Boxes of one camera as undistorted normalised coordinates (x right, y down, at distance 1).

    Without intrinsics they come from pixel pitch and image distance, which tells sizes but not
    directions: those are NaN.

    Of a body the ends are where its axis meets the ground, and its crown (`optics.silhouette`): `reach`
    is how far its lower end is before the axis, in shares of its height, (n,), and `reach_std` how that
    differs from frame to frame; NaN for what is a line. Without `reach` all are lines. `scatter` is what
    the track's own heights say of the boxes; `measured` has that in its deviations already.
    """

    measured: Measured
    reach: FloatArray | None = None
    reach_std: FloatArray | None = None
    scatter: Scatter | None = None

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
            width_px = self._sides * m.intrinsics.fx_px
        return np.where(self.width_cut, np.nan, width_px * m.pixel_pitch_x_um * 1e-3)

    @cached_property
    def height_on_sensor_mm(self) -> FloatArray:
        """Height of the box on the sensor, the lens's distortion removed.

        NaN where an end is cut off or the pitch is unknown.
        """
        m = self.measured
        height_px = m.bbox_xyxy_px[:, 3] - m.bbox_xyxy_px[:, 1]
        if m.intrinsics is not None and m.intrinsics.distortion_model:
            height_px = (self.foot - self.head)[:, 1] * m.intrinsics.fy_px
        return np.where(self.height_cut, np.nan, height_px * m.pixel_pitch_y_um * 1e-3)

    @cached_property
    def width_angle(self) -> FloatArray:
        """Width of the box at unit distance; NaN where a side is cut off."""
        if self.measured.intrinsics is None:
            return np.asarray(self.width_on_sensor_mm / self.image_distance_mm)
        return np.where(self.width_cut, np.nan, self._sides)

    @cached_property
    def height_angle(self) -> FloatArray:
        """Height of the box at unit distance; NaN where an end is cut off."""
        if self.measured.intrinsics is None:
            return np.asarray(self.height_on_sensor_mm / self.image_distance_mm)
        return np.where(self.height_cut, np.nan, (self.foot - self.head)[:, 1])

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

    @cached_property
    def width_cut(self) -> BoolArray:
        """Whether the picture cuts off the left or the right side, (n,)."""
        return np.asarray(self.measured.truncated[:, 0] | self.measured.truncated[:, 2])

    @cached_property
    def height_cut(self) -> BoolArray:
        """Whether the picture cuts off the head or the feet, (n,)."""
        return np.asarray(self.measured.truncated[:, 1] | self.measured.truncated[:, 3])

    @property
    def foot(self) -> FloatArray:
        """Where the object stands, (n, 2), the camera's roll removed."""
        return self._ends[0]

    @property
    def head(self) -> FloatArray:
        """Its upper end, (n, 2), the camera's roll removed."""
        return self._ends[1]

    def but(self, **changes: Any) -> Geometry:
        """Return the same boxes with something else said of them; where they are need not be found again.

        Args:
            changes: other fields; `measured` may differ in its deviations alone.
        """
        other = replace(self, **changes)
        kept = ["_edges", "middle", "_sides"]
        if "reach" not in changes:
            kept += ["_ends", "reach_m"]
        for name in kept:
            if name in self.__dict__:
                other.__dict__[name] = self.__dict__[name]
        return other

    @cached_property
    def _edges(self) -> tuple[FloatArray, FloatArray]:
        """The middles of the box's lower and upper edge."""
        return self._point(3), self._point(1)

    @cached_property
    def _ends(self) -> tuple[FloatArray, FloatArray]:
        """Lower and upper end: the middles of the box's edges, and with the pose, as it leans.

        What is upright leans in the picture: away from the middle of a picture that looks down, and
        with the roll. The box reaches from one end to the other, so each end is half of that beside
        the middle. With a roll this moves the row of the foot as well.
        """
        foot, head = self._edges
        plane = self.measured.ground_plane
        if plane is None or self.measured.intrinsics is None:
            return foot, head
        tilt, roll = plane.tilt_rad, plane.roll_rad
        at_foot, at_head = foot, head
        for _ in range(2):  # the second time moves it by less than a hundredth of a pixel
            rise = foot[:, 1] - head[:, 1]
            # The head is nearer than the foot by this share of the foot's depth: H sin t / Z.
            nearer = rise * np.sin(tilt) / (np.cos(tilt) - head[:, 1] * np.sin(tilt))
            with np.errstate(invalid="ignore", divide="ignore"):
                outwards = (foot[:, 0] + head[:, 0]) / 2 * nearer / (2 - nearer)
            lean = rise * np.sin(roll) / 2 - outwards * np.cos(roll)
            lean = np.where(self.height_cut | ~np.isfinite(lean), 0.0, lean)
            step = np.column_stack([lean, np.zeros(len(lean))])
            foot, head = at_foot + remove_roll(step, roll), at_head - remove_roll(step, roll)
        return self._axis(foot, head, tilt)

    def _axis(
        self, foot: FloatArray, head: FloatArray, tilt: float
    ) -> tuple[FloatArray, FloatArray]:
        """Return where the axis of a body begins and ends; of a line its ends."""
        if self.reach is None:
            return foot, head
        y_foot, y_head = axis_rows(foot[:, 1], head[:, 1], tilt, self.reach)
        body = np.isfinite(y_foot) & np.isfinite(y_head) & ~self.height_cut
        low = np.where(body, y_foot, foot[:, 1])
        high = np.where(body, y_head, head[:, 1])
        return np.column_stack([foot[:, 0], low]), np.column_stack([head[:, 0], high])

    @cached_property
    def reach_m(self) -> FloatArray:
        """What reach makes of the depth, in metres for each unit of it; 0 for a line."""
        plane = self.measured.ground_plane
        if self.reach is None or plane is None:
            return np.zeros(len(self.measured))
        tilt = plane.tilt_rad
        depth_m = foot_depth_m(plane.camera_height_m, tilt, self.foot[:, 1])
        tall_m = height_m(depth_m, self.foot[:, 1], self.head[:, 1], tilt)
        return np.where(np.isfinite(self.reach), np.nan_to_num(tall_m) * np.cos(tilt), 0.0)

    @cached_property
    def middle(self) -> FloatArray:
        """The middle of the box, (n, 2), the camera's roll removed."""
        return self._at((self.measured.bbox_xyxy_px[:, :2] + self.measured.bbox_xyxy_px[:, 2:]) / 2)

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
        tilt = plane.tilt_rad
        slope = self.foot[:, 1] * np.cos(tilt) + np.sin(tilt)
        # dy = -slope^2 dZ / h, and the reach moves Z by `reach_m`.
        by_reach = slope**2 / plane.camera_height_m * self.reach_m
        return np.nan_to_num(by_reach * self.reach_std)

    @cached_property
    def common_std(self) -> FloatArray:
        """Standard deviations of what the ends have in common along a track, (n, 2): foot, head.

        In proportion to what is each frame's own, at the track's median.
        """
        m, tall = self.measured, (self.foot - self.head)[:, 1]
        with np.errstate(invalid="ignore", divide="ignore"):
            share = np.column_stack([self._std(3), self._std(1)]) / tall[:, None]
        share[~np.isfinite(share)] = np.nan
        of_track = pd.DataFrame(share).groupby(m.track_id).transform("median").to_numpy()
        return np.nan_to_num(COMMON_SHARE * of_track * tall[:, None])

    @cached_property
    def head_std(self) -> FloatArray:
        """Standard deviation of the upper edge, normalised."""
        return self._std(1)

    @cached_property
    def _sides(self) -> FloatArray:
        """Distance between the middles of the box's sides at unit distance; needs intrinsics."""
        box = self.measured.bbox_xyxy_px
        y_px = (box[:, 1] + box[:, 3]) / 2
        left = self._at(np.stack([box[:, 0], y_px], axis=1))
        right = self._at(np.stack([box[:, 2], y_px], axis=1))
        return np.asarray((right - left)[:, 0])

    def _point(self, edge: int) -> FloatArray:
        box = self.measured.bbox_xyxy_px
        return self._at(np.stack([(box[:, 0] + box[:, 2]) / 2, box[:, edge]], axis=1))

    def _at(self, points_px: FloatArray) -> FloatArray:
        m = self.measured
        if m.intrinsics is None:
            return np.full(points_px.shape, np.nan)
        points = camera_of(m.intrinsics).normalize(points_px)
        return remove_roll(points, m.ground_plane.roll_rad) if m.ground_plane else points

    def _std(self, edge: int) -> FloatArray:
        m = self.measured
        if m.intrinsics is None:
            return np.full(len(m), np.nan)
        return np.asarray(m.std_xyxy_px[:, edge] / m.intrinsics.fy_px)
