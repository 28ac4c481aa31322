"""A pose that is known beforehand but not exactly, as residuals of the fit to walkers.

With x the log of the camera's height, tilt and roll, x0 those that are given and P0 = L L' their
covariance, the residuals are L^-1 (x - x0): their squares add up to the exponent of the normal density.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.core.arrays import FloatArray
from pipeline.core.records import GroundPlane

# What is said to be exact is still of finite weight: a thousandth of the height, a hundredth of a degree.
LEAST_STD = np.array([1e-3, *np.deg2rad([0.01, 0.01])])
ROWS = 3  # of residuals


@dataclass(frozen=True, slots=True)
class PosePrior:
    """A pose (log height, tilt, roll), (3,), and the whitening of differences from it, (3, 3)."""

    pose: FloatArray
    whitening: FloatArray

    @classmethod
    def of(cls, plane: GroundPlane) -> PosePrior:
        """Return it of a pose with its covariance, which is over metres and radians."""
        return cls(log_pose(plane), np.linalg.inv(np.linalg.cholesky(log_covariance(plane))))

    def off(self, pose: FloatArray) -> FloatArray:
        """Return the residuals of a pose, (3,)."""
        return np.asarray(self.whitening @ (pose - self.pose))


def log_pose(plane: GroundPlane) -> FloatArray:
    """Return the log of the camera's height, tilt and roll, (3,)."""
    return np.array([np.log(plane.camera_height_m), plane.tilt_rad, plane.roll_rad])


def log_covariance(plane: GroundPlane) -> FloatArray:
    """Return the covariance of these, (3, 3)."""
    to_log = np.diag([1.0 / plane.camera_height_m, 1.0, 1.0])
    return np.asarray(to_log @ plane.covariance @ to_log + np.diag(LEAST_STD**2))
