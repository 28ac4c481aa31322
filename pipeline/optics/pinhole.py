"""The camera as an ideal pinhole behind a lens with distortion.

Pixels have the centre of the first one at (0, 0). Normalised coordinates are x right, y down, at
unit distance along the optical axis; points in the camera's frame are x right, y down, z ahead.
The distortion models and their parameter order are OpenCV's, which foxglove and ROS share.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
ArrayLike = npt.ArrayLike

_ITERATIONS = 20
_CONVERGED = 1e-9  # in normalised units: far below a thousandth of a pixel
_STEP = 1e-6  # of the numerical Jacobian


def _brown(xy: Floats, d: tuple[float, ...]) -> Floats:
    """Brown-Conrady: k1 k2 p1 p2 k3, and the rational k4 k5 k6 where given."""
    k1, k2, p1, p2, k3, k4, k5, k6 = (*d, *(0.0,) * 8)[:8]
    x, y = xy[..., 0], xy[..., 1]
    r2 = x * x + y * y
    radial = (1 + r2 * (k1 + r2 * (k2 + r2 * k3))) / (1 + r2 * (k4 + r2 * (k5 + r2 * k6)))
    return np.stack(
        [
            x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x),
            y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y,
        ],
        axis=-1,
    )


def _equidistant(xy: Floats, d: tuple[float, ...]) -> Floats:
    """Kannala-Brandt fisheye: theta (1 + k1 theta^2 + k2 theta^4 + k3 theta^6 + k4 theta^8)."""
    k1, k2, k3, k4 = (*d, *(0.0,) * 4)[:4]
    r = np.hypot(xy[..., 0], xy[..., 1])
    theta = np.arctan(r)
    t2 = theta * theta
    bent = theta * (1 + t2 * (k1 + t2 * (k2 + t2 * (k3 + t2 * k4))))
    with np.errstate(invalid="ignore", divide="ignore"):
        scale = np.where(r > 1e-12, bent / r, 1.0)
    return xy * scale[..., None]


_MODELS: dict[str, Callable[[Floats, tuple[float, ...]], Floats]] = {
    "plumb_bob": _brown,
    "rational_polynomial": _brown,
    "equidistant": _equidistant,
    "kannala_brandt": _equidistant,
    "fisheye": _equidistant,
}
DISTORTION_MODELS = ("", "none", *_MODELS)


@dataclass(frozen=True, slots=True)
class PinholeCamera:
    """A camera in pixels of the picture.

    Raises:
        ValueError: the distortion model is not one of `DISTORTION_MODELS`.
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
        if self.distortion_model not in DISTORTION_MODELS:
            known = ", ".join(_MODELS)
            raise ValueError(f"distortion model {self.distortion_model!r} is not one of {known}")

    def normalize(self, points_px: ArrayLike) -> Floats:
        """Return undistorted normalised coordinates, (..., 2), of pixels, (..., 2).

        The distortion is inverted by Newton's method. A point at which it cannot be inverted (beyond
        the radius up to which the model is one to one) becomes NaN.
        """
        points = np.asarray(points_px, dtype=np.float64)
        centre, focal = np.array([self.cx_px, self.cy_px]), np.array([self.fx_px, self.fy_px])
        bent = (points - centre) / focal
        return self._undistort(bent) if self._bends else bent

    def project(self, points_xyz_m: ArrayLike) -> Floats:
        """Return pixels, (..., 2), of points in the camera's frame, (..., 3); NaN behind it."""
        points = np.asarray(points_xyz_m, dtype=np.float64)
        with np.errstate(invalid="ignore", divide="ignore"):
            xy = points[..., :2] / np.where(points[..., 2:] > 0, points[..., 2:], np.nan)
        bent = self._distort(xy) if self._bends else xy
        return bent * [self.fx_px, self.fy_px] + [self.cx_px, self.cy_px]

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
    def _bends(self) -> bool:
        return self.distortion_model in _MODELS and (
            any(self.distortion) or _MODELS[self.distortion_model] is _equidistant
        )

    def _distort(self, xy: Floats) -> Floats:
        return _MODELS[self.distortion_model](xy, self.distortion)

    def _undistort(self, bent: Floats) -> Floats:
        flat = bent.reshape(-1, 2)
        xy = flat.copy()
        if _MODELS[self.distortion_model] is _equidistant:  # start on the right branch
            radius = np.hypot(flat[:, 0], flat[:, 1])
            with np.errstate(invalid="ignore", divide="ignore"):
                start = np.tan(np.clip(radius, 0, 1.5)) / radius
            xy = flat * np.where(radius > 1e-12, start, 1.0)[:, None]
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            active = np.arange(len(flat))
            for _ in range(_ITERATIONS):
                error = self._distort(xy[active]) - flat[active]
                xy[active] -= self._solve(xy[active], error)
                # Convergence is quadratic: after this step the error is far below the limit.
                active = active[(np.abs(error) > _CONVERGED).any(axis=1)]
                if len(active) == 0:
                    break
            residual = np.abs(self._distort(xy) - flat).max(axis=1, initial=0.0)
            xy[~((residual < _CONVERGED) & (self._determinant(xy) > 0))] = np.nan
        return xy.reshape(bent.shape)

    def _jacobian(self, xy: Floats) -> tuple[Floats, Floats]:
        right, down = np.array([_STEP, 0.0]), np.array([0.0, _STEP])
        dx = (self._distort(xy + right) - self._distort(xy - right)) / (2 * _STEP)
        dy = (self._distort(xy + down) - self._distort(xy - down)) / (2 * _STEP)
        return dx, dy

    def _determinant(self, xy: Floats) -> Floats:
        dx, dy = self._jacobian(xy)
        return np.asarray(dx[:, 0] * dy[:, 1] - dx[:, 1] * dy[:, 0])

    def _solve(self, xy: Floats, error: Floats) -> Floats:
        dx, dy = self._jacobian(xy)
        determinant = dx[:, 0] * dy[:, 1] - dx[:, 1] * dy[:, 0]
        step_x = (dy[:, 1] * error[:, 0] - dy[:, 0] * error[:, 1]) / determinant
        step_y = (dx[:, 0] * error[:, 1] - dx[:, 1] * error[:, 0]) / determinant
        return np.stack([step_x, step_y], axis=1)
