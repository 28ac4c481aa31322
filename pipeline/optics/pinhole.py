"""The camera as an ideal pinhole behind a lens with distortion.

Pixels have the centre of the first one at (0, 0). Normalised coordinates are x right, y down, at
unit distance along the optical axis; points in the camera's frame are x right, y down, z ahead.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pipeline.optics.arrays import ArrayLike, Floats, floats, quiet
from pipeline.optics.distortion import check_distortion, distort, undistort


@dataclass(frozen=True, slots=True)
class PinholeCamera:
    """A camera in pixels of the picture.

    Raises:
        ValueError: the distortion is none that `check_distortion` lets pass.
    """

    fx_px: float
    fy_px: float
    cx_px: float
    cy_px: float
    width_px: int = 0
    height_px: int = 0
    distortion_model: str = ""
    distortion: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        check_distortion(self.distortion_model, self.distortion)

    @quiet
    def normalize(self, points_px: ArrayLike) -> Floats:
        """Return undistorted normalised coordinates, (..., 2), of pixels, (..., 2).

        A pixel farther out than the distortion can be inverted becomes NaN.
        """
        bent = (floats(points_px) - self._centre_px) / self._focal_px
        return undistort(bent, self.distortion_model, self.distortion)

    @quiet
    def project(self, points_xyz_m: ArrayLike) -> Floats:
        """Return pixels, (..., 2), of points in the camera's frame, (..., 3).

        NaN behind the camera, and where the distortion model no longer holds.
        """
        points = floats(points_xyz_m)
        xy = np.where(points[..., 2:] > 0, points[..., :2] / points[..., 2:], np.nan)
        bent = distort(xy, self.distortion_model, self.distortion)
        return np.asarray(bent * self._focal_px + self._centre_px)

    def scaled(self, factor_x: float, factor_y: float) -> PinholeCamera:
        """Return the camera of a picture that was resized by these factors."""
        return replace(
            self,
            fx_px=self.fx_px * factor_x,
            fy_px=self.fy_px * factor_y,
            cx_px=(self.cx_px + 0.5) * factor_x - 0.5,
            cy_px=(self.cy_px + 0.5) * factor_y - 0.5,
            width_px=round(self.width_px * factor_x),
            height_px=round(self.height_px * factor_y),
        )

    @property
    def _focal_px(self) -> Floats:
        return np.array([self.fx_px, self.fy_px])

    @property
    def _centre_px(self) -> Floats:
        return np.array([self.cx_px, self.cy_px])
