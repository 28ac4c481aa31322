"""Test of a known lens against the people who walk.

The fit of a pose is done once more with the focal length unknown (`calibrate.focal`), from the known one.
People tell it to 10-35 % only, so this finds a calibration of another zoom, lens or crop, not a
careless one. What is known is not replaced: among the cameras of which the people say so, those whose
boxes are bad are about as many as those whose lens data are wrong. A calibration stays, and the
contradiction is told; lens data (a focal length in mm over a pixel pitch), which are wrong for every
cropped picture, stay too, but so unsure that the interval holds either.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import OptimizeResult

from pipeline.calibrate.walkers.covariance import covariance_of
from pipeline.calibrate.walkers.focal_length import BENT_STD, MODEL_STD, free_focal
from pipeline.calibrate.walkers.model import ABOVE, ROLL, TILT
from pipeline.calibrate.walkers.pace import pace_of
from pipeline.calibrate.walkers.pose import Fitted
from pipeline.core.arrays import FloatArray
from pipeline.core.records import Diagnostic, GroundPlane, Severity

# Of 48 rendered cameras with the right lens, by true boxes and by found ones, one is farther off: by bad
# boxes. A focal length that is twice as long is told of a quarter of `bench.walkers`' cameras with 20
# people and of a third with 40. These were counted at 2.5 deviations and without `BENT_STD`.
CONTRADICTION = 2.6  # deviations: by chance one in a hundred is farther off, either way
DOUBTFUL = "lens_data"  # the source of a lens that no calibration tells
_SAID_BY = {
    "recording": "the recording's calibration",
    "camera_file": "the camera file",
    DOUBTFUL: "focal length over pixel pitch",
}
_REMEDY = {
    "recording": "Check that the calibration is of this lens, its zoom and these pictures",
    "camera_file": "Correct fx_px and fy_px, or leave them out for what the people tell",
    DOUBTFUL: "Intervals allow for either; give fx_px of these pictures in a camera file",
}


@dataclass(frozen=True, slots=True)
class LensCheck:
    """Verdict of the people on a focal length."""

    known_px: float
    log_ratio: float  # of theirs over the known one
    std: float
    by_focal: FloatArray  # (3,) of height, tilt, roll by the focal length's logarithm

    @property
    def contradicts(self) -> bool:
        """True if it is beyond chance."""
        return abs(self.log_ratio) > CONTRADICTION * self.std

    def widened(self, plane: GroundPlane) -> GroundPlane:
        """Return the pose as unsure as if either focal length were as likely."""
        variance = self.log_ratio**2 / 2
        return replace(
            plane,
            covariance=plane.covariance + variance * np.outer(self.by_focal, self.by_focal),
            focal_covariance=np.append(variance * self.by_focal, variance),
        )

    def describe(self, camera: str, source: str) -> Diagnostic:
        """Return what is to be said of it, and to be done."""
        found_px = self.known_px * math.exp(self.log_ratio)
        return Diagnostic(
            Severity.WARNING,
            "focal_length_contradicted",
            f"the people who walk indicate a focal length of {found_px:.0f} px ± {100 * self.std:.0f} % "
            f"(one standard error), {_SAID_BY.get(source, source)} says {self.known_px:.0f} px: depths "
            f"are off by as much as it is. {_REMEDY.get(source, 'Check it')}",
            camera=camera,
        )


def check_lens(fitted: Fitted) -> LensCheck | None:
    """Return what the people of a fit say of the lens it was made with, None if there is none."""
    lens = fitted.measured.intrinsics
    if lens is None:
        return None
    start = np.append(fitted.fit.x, 0.0)
    pace = pace_of(fitted.sample, OptimizeResult(x=start))
    free = free_focal(fitted.fit, fitted.sample, fitted.scale, pace)
    focal = len(free.x) - 1
    covariance = covariance_of(free, fitted.sample, fitted.scale, (ABOVE, TILT, ROLL, focal))
    # The same fit as where no lens is known, so the same error beyond what it states of itself.
    std = math.hypot(math.sqrt(covariance[3, 3]), MODEL_STD, BENT_STD)
    by_focal = covariance[:3, 3] / covariance[3, 3]
    return LensCheck(lens.fx_px, float(free.x[focal]), std, by_focal)
