"""Directions of boxes, and of the ends of what is in them, as a camera sees them.

Both are found once, whatever is learned of the boxes' deviations later.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pipeline.core.arrays import FloatArray
from pipeline.core.records import Intrinsics
from pipeline.estimate.types import Measured
from pipeline.optics.distortion import check_distortion
from pipeline.optics.ground_plane import foot_depth_m, height_m, remove_roll
from pipeline.optics.pinhole import PinholeCamera
from pipeline.optics.silhouette import axis_rows


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
class Directions:
    """Points of boxes as undistorted normalised coordinates, the camera's roll removed.

    NaN without intrinsics. Of `measured` only boxes, lens and pose are read.
    """

    measured: Measured

    @cached_property
    def edges(self) -> tuple[FloatArray, FloatArray]:
        """Middles of the box's lower and upper edge."""
        return self._point(3), self._point(1)

    @cached_property
    def middle(self) -> FloatArray:
        """Middle of the box, (n, 2), the camera's roll removed."""
        return self._at((self.measured.bbox_xyxy_px[:, :2] + self.measured.bbox_xyxy_px[:, 2:]) / 2)

    @cached_property
    def sides(self) -> FloatArray:
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


@dataclass(frozen=True)
class Ends:
    """Lower and upper ends of what is in the boxes.

    Of a body these are where its axis meets the ground, and its crown (`optics.silhouette`): `reach`
    is how far its lower end is before the axis, in shares of its height, (n,); NaN for what is a line.
    Without `reach` all are lines.
    """

    directions: Directions
    reach: FloatArray | None = None

    @cached_property
    def both(self) -> tuple[FloatArray, FloatArray]:
        """Lower and upper end, (n, 2) each.

        The middles of the box's edges; with the pose, as it leans.

        What is upright leans in the picture: away from the middle of a picture that looks down, and
        with the roll. The box reaches from one end to the other, so each end is half of that beside
        the middle. With a roll this moves the row of the foot as well.
        """
        foot, head = self.directions.edges
        plane = self.directions.measured.ground_plane
        if plane is None or self.directions.measured.intrinsics is None:
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
            lean = np.where(self.directions.measured.height_cut | ~np.isfinite(lean), 0.0, lean)
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
        body = np.isfinite(y_foot) & np.isfinite(y_head) & ~self.directions.measured.height_cut
        low = np.where(body, y_foot, foot[:, 1])
        high = np.where(body, y_head, head[:, 1])
        return np.column_stack([foot[:, 0], low]), np.column_stack([head[:, 0], high])

    @cached_property
    def reach_m(self) -> FloatArray:
        """Depth that the reach makes, in metres for each unit of it; 0 for a line."""
        plane = self.directions.measured.ground_plane
        if self.reach is None or plane is None:
            return np.zeros(len(self.directions.measured))
        tilt = plane.tilt_rad
        depth_m = foot_depth_m(plane.camera_height_m, tilt, self.both[0][:, 1])
        tall_m = height_m(depth_m, self.both[0][:, 1], self.both[1][:, 1], tilt)
        return np.where(np.isfinite(self.reach), np.nan_to_num(tall_m) * np.cos(tilt), 0.0)
