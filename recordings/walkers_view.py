"""The simulated camera: world points to pixels through `pipeline.optics`, and outlines of spheres.

World: x right of the camera, y ahead of it on the ground, z up from the ground. The camera stands
above the origin.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pipeline.core.records import GroundPlane, Intrinsics
from pipeline.optics.ground_plane import foot_depth_m, ground_position_m, remove_roll
from pipeline.optics.pinhole import PinholeCamera

Floats = npt.NDArray[np.float64]

AROUND = 16  # points of an outline: they lie within 2 % of the radius
_CIRCLE = np.stack(
    [
        np.cos(2 * np.pi * np.arange(AROUND) / AROUND),
        np.sin(2 * np.pi * np.arange(AROUND) / AROUND),
    ],
    axis=1,
)


@dataclass(frozen=True, slots=True)
class View:
    """A camera of known lens and pose."""

    focal_length_mm: float
    pixel_pitch_um: float  # of the sensor's own pixels
    sensor_width_px: int
    sensor_height_px: int
    intrinsics: Intrinsics  # of the stored picture
    plane: GroundPlane

    @property
    def width_px(self) -> int:
        """Width of the stored picture."""
        return self.intrinsics.width_px

    @property
    def height_px(self) -> int:
        """Height of the stored picture."""
        return self.intrinsics.height_px

    @property
    def camera(self) -> PinholeCamera:
        """The optics' camera."""
        k = self.intrinsics
        return PinholeCamera(
            k.fx_px,
            k.fy_px,
            k.cx_px,
            k.cy_px,
            k.width_px,
            k.height_px,
            k.distortion_model,
            k.distortion,
        )

    @property
    def camera_from_world(self) -> Floats:
        """The rotation, (3, 3): rows are the picture's x and y and the optical axis."""
        tilt, roll = self.plane.tilt_rad, self.plane.roll_rad
        cos, sin = math.cos(tilt), math.sin(tilt)
        level = np.array([[1, 0, 0], [0, -sin, -cos], [0, cos, -sin]])
        turn = np.array(
            [[math.cos(roll), math.sin(roll), 0], [-math.sin(roll), math.cos(roll), 0], [0, 0, 1]]
        )
        return np.asarray(turn @ level)

    def in_camera(self, world_m: Floats) -> Floats:
        """Return points, (..., 3), in the camera's axes."""
        return np.asarray((world_m - [0, 0, self.plane.camera_height_m]) @ self.camera_from_world.T)

    def project(self, world_m: Floats) -> Floats:
        """Return pixels, (..., 2), of points, (..., 3); NaN for what has no image."""
        return self.camera.project(self.in_camera(world_m))

    def depth_m(self, world_m: Floats) -> Floats:
        """Return distances along the optical axis, (...,), of points, (..., 3)."""
        return np.asarray(self.in_camera(world_m)[..., 2])

    def outlines(self, centres_m: Floats, radii_m: Floats) -> Floats:
        """Return the outlines, (..., k, 2) in pixels, of spheres (..., 3) of radii (...,).

        A sphere is seen as the circle in which the cone of rays touches it.
        """
        centres = self.in_camera(centres_m)
        far = np.linalg.norm(centres, axis=-1, keepdims=True)
        ray = centres / far
        share = np.clip((radii_m[..., None] / far) ** 2, 0, 0.9)
        middle = centres * (1 - share)
        rim = radii_m[..., None] * np.sqrt(1 - share)
        across = np.stack([ray[..., 2], np.zeros_like(ray[..., 0]), -ray[..., 0]], axis=-1)
        across /= np.linalg.norm(across, axis=-1, keepdims=True)
        along = np.cross(ray, across)
        points = (
            middle[..., None, :]
            + (rim * across)[..., None, :] * _CIRCLE[:, :1]
            + (rim * along)[..., None, :] * _CIRCLE[:, 1:]
        )
        return self.camera.project(points)

    def shadows(self, centres_m: Floats, radii_m: Floats, sun: Floats) -> Floats:
        """Return outlines, (..., k, 2) in pixels, of the spheres' shadows on the ground.

        `sun` (3,) is the unit vector towards the sun.
        """
        first = np.cross(sun, [0.0, 0.0, 1.0])
        first /= np.linalg.norm(first)
        rim = _CIRCLE[:, :1] * first + _CIRCLE[:, 1:] * np.cross(sun, first)
        points = centres_m[..., None, :] + radii_m[..., None, None] * rim
        height_m = np.maximum(points[..., 2:], 0.0)
        return self.project(points - sun * (height_m / sun[2]))

    def ground(self, pixels: Floats) -> tuple[Floats, Floats, Floats]:
        """Return x, y and depth on the ground of pixels, (..., 2); NaN at and above the horizon."""
        seen = remove_roll(self.camera.normalize(pixels), self.plane.roll_rad)
        depth_m = foot_depth_m(self.plane.camera_height_m, self.plane.tilt_rad, seen[..., 1])
        x_m, y_m = ground_position_m(depth_m, seen[..., 0], seen[..., 1], self.plane.tilt_rad)
        return x_m, y_m, depth_m
