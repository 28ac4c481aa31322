"""Segments of known length in the picture: on the ground, or upright on it.

With the pose each has a length: the distance of two points of the ground, or the height of what stands
between them (`optics.ground_plane`). The residual is the logarithm of that over the known one, in
standard deviations.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from pipeline.core.arrays import FloatArray
from pipeline.core.records import GroundPlane, Intrinsics, KnownLength
from pipeline.estimate.boxes.ends import camera_of
from pipeline.optics.ground_plane import (
    depth_jacobian,
    foot_depth_m,
    ground_position_m,
    height_jacobian,
    height_m,
    remove_roll,
)

# A residual of what cannot be: far off, but finite, so that the fit can find its way back.
IMPOSSIBLE = 100.0
MARK_STEP = 1e-3  # of a mark's deviation, for differences


@dataclass(frozen=True, slots=True)
class Segments:
    """Segments of known length; the first point of an upright one is its foot."""

    points: FloatArray  # (d, 2, 2) normalised
    length_m: FloatArray  # (d,)
    std: FloatArray  # (d,) relative
    upright: npt.NDArray[np.bool_]  # (d,)

    def __len__(self) -> int:
        return len(self.length_m)

    @classmethod
    def of(
        cls,
        lengths: tuple[KnownLength, ...],
        lens: Intrinsics | None,
        plane: GroundPlane | None = None,
    ) -> Segments:
        """Return what is known, its points normalised by a lens; without one there is nothing.

        What a misplaced mark does to a length follows from the pose, where one is known already.
        """
        if lens is None:
            lengths = ()
        camera = camera_of(lens) if lens else None
        points = [camera.normalize(ends_px(k)) for k in lengths if camera is not None]
        segments = cls(
            np.array(points).reshape(-1, 2, 2),
            np.array([k.length_m for k in lengths]),
            np.array([_relative_std(k) for k in lengths]),
            np.array([k.upright for k in lengths], dtype=np.bool_),
        )
        if plane is None or lens is None or not lengths:
            return segments
        own = np.array([k.std_m for k in lengths]) / segments.length_m
        marks = np.array([k.std_px for k in lengths]) / lens.fy_px
        std = np.hypot(own, segments._by_marks(marks, plane))
        return replace(segments, std=np.where(np.isfinite(std), std, segments.std))

    def _by_marks(self, mark_std: FloatArray, plane: GroundPlane) -> FloatArray:
        """Return the relative deviation of the lengths by that of each coordinate of a mark, (d,)."""
        pose = plane.camera_height_m, plane.tilt_rad, plane.roll_rad
        found_m = self.found_m(*pose)
        step = MARK_STEP * mark_std[:, None]
        slopes = []
        for end, axis in ((0, 0), (0, 1), (1, 0), (1, 1)):
            moved = self.points.copy()
            moved[:, end, axis] += step[:, 0]
            slopes.append((replace(self, points=moved).found_m(*pose) - found_m) / found_m)
        return np.asarray(np.linalg.norm(slopes, axis=0) / MARK_STEP)

    def found_m(self, above_m: float, tilt_rad: float, roll_rad: float) -> FloatArray:
        """Return the lengths that a pose gives, (d,); NaN where it gives none."""
        ends = remove_roll(self.points, roll_rad)
        foot, head = ends[:, 0], ends[:, 1]
        z_m = foot_depth_m(above_m, tilt_rad, foot[:, 1])
        tall_m = height_m(z_m, foot[:, 1], head[:, 1], tilt_rad)
        apart_m = np.linalg.norm(self._apart_m(above_m, tilt_rad, ends), axis=1)
        return np.where(self.upright, tall_m, apart_m)

    def off(self, above_m: float, tilt_rad: float, roll_rad: float) -> FloatArray:
        """Return how far they are off, in standard deviations, (d,)."""
        with np.errstate(divide="ignore", invalid="ignore"):
            found_m = self.found_m(above_m, tilt_rad, roll_rad)
            error = np.log(found_m / self.length_m) / self.std
        return np.where(np.isfinite(error), error, IMPOSSIBLE)

    def off_jacobian(self, above_m: float, tilt_rad: float, roll_rad: float) -> FloatArray:
        """Return the derivatives of `off` by the camera's height (its log), tilt and roll, (d, 3)."""
        ends = remove_roll(self.points, roll_rad)
        tall = self._by_tall(above_m, tilt_rad, ends)
        apart = self._by_apart(above_m, tilt_rad, ends)
        scaled = np.where(self.upright[:, None], tall, apart) / self.std[:, None]
        return np.where(np.isfinite(scaled).all(axis=1, keepdims=True), scaled, 0.0)

    def _apart_m(self, above_m: float, tilt_rad: float, ends: FloatArray) -> FloatArray:
        """Return the vectors on the ground between the ends, (d, 2)."""
        z_m = foot_depth_m(above_m, tilt_rad, ends[..., 1])
        place = ground_position_m(z_m, ends[..., 0], ends[..., 1], tilt_rad)
        return np.asarray(np.diff(np.stack(place, axis=-1), axis=1)[:, 0])

    def _by_tall(self, above_m: float, tilt_rad: float, ends: FloatArray) -> FloatArray:
        foot, head = ends[:, 0], ends[:, 1]
        z_m = foot_depth_m(above_m, tilt_rad, foot[:, 1])
        tall_m = height_m(z_m, foot[:, 1], head[:, 1], tilt_rad)
        by_above, by_tilt, by_roll, _, _ = height_jacobian(above_m, tilt_rad, foot, head)
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.stack([by_above * above_m, by_tilt, by_roll], axis=1) / tall_m[:, None]

    def _by_apart(self, above_m: float, tilt_rad: float, ends: FloatArray) -> FloatArray:
        cos, sin = np.cos(tilt_rad), np.sin(tilt_rad)
        right, down = ends[..., 0], ends[..., 1]
        z_m = foot_depth_m(above_m, tilt_rad, down)
        _, z_by_tilt, z_by_roll, _ = depth_jacobian(above_m, tilt_rad, right, down)
        ahead = cos - down * sin
        by_tilt = [z_by_tilt * right, z_by_tilt * ahead - z_m * (sin + down * cos)]
        by_roll = [z_by_roll * right - z_m * down, z_by_roll * ahead - z_m * right * sin]
        apart = self._apart_m(above_m, tilt_rad, ends)
        with np.errstate(divide="ignore", invalid="ignore"):
            along = apart / (apart**2).sum(axis=1, keepdims=True)
            slopes = [
                (along * np.diff(np.stack(by, axis=-1), axis=1)[:, 0]).sum(axis=1)
                for by in (by_tilt, by_roll)
            ]
        return np.stack([np.ones(len(apart)), *slopes], axis=1)


def ends_px(known: KnownLength) -> FloatArray:
    """Return both points in pixels, (2, 2)."""
    return np.array(known.points_px, dtype=np.float64).reshape(2, 2)


def _relative_std(known: KnownLength) -> float:
    """Return about how far a length may be off, as a share: by who measured it, and by two marks.

    No pose is known yet: a mark that is off by a pixel changes a length by that share of its pixels.
    """
    apart_px = float(np.linalg.norm(np.diff(ends_px(known), axis=0)))
    return float(np.hypot(known.std_m / known.length_m, np.sqrt(2) * known.std_px / apart_px))
