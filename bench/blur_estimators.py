"""Published estimators of the blur of an edge, in the same pyramid, beside the one that is used.

All get the same edges, those that the fit takes for steps, and give sigma in the pixels of their level;
how edges are combined is the same for all too. So nothing but the estimators is compared: alone, a ratio
of slopes has no way to tell a step from something else.

- fit: the edge-spread function of a disc and the camera's floor, fitted
  (`pipeline.measure.blur.edge_spread`).
- Gaussian fit: the same, with a Gaussian's edge; what ISO 12233 readers do.
- re-blur ratio: Zhuo & Sim, "Defocus map estimation from a single image" (Pattern Recognition 44,
  2011): the gradient of an edge over that of the edge blurred once more by sigma_0, R; sigma = sigma_0 /
  sqrt(R^2 - 1). Exact for a Gaussian.
- re-blur ratio, disc: the same ratio, read off the closed form for a disc and the floor (`peak_slope`).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.ndimage import gaussian_filter1d
from scipy.special import ive

from pipeline.core.arrays import FloatArray
from pipeline.measure.blur.edge_spread import Widths, fitted, in_stored_pixels, widths_of
from pipeline.measure.blur.edges import REACH_PX, Edges

REBLUR_PX = 1.0
BOX_PX2 = 1 / 3  # the variance of a difference of neighbours two pixels apart
Estimator = Callable[[Edges, float], Widths]


def peak_slope(radius: FloatArray, sigma: FloatArray | float) -> FloatArray:
    """Return the steepest slope of a unit edge behind a disc and a Gaussian.

    The Gaussian averaged over the disc's semicircle: with b = (r / (2 sigma))^2 it is
    exp(-b) (I0(b) + I1(b)) / (sqrt(2 pi) sigma); 2 / (pi r) for the disc alone.
    """
    b = (radius / (2.0 * np.asarray(sigma))) ** 2
    return np.asarray((ive(0, b) + ive(1, b)) / (np.sqrt(2.0 * np.pi) * sigma))


def gaussian_fit(edges: Edges, floor_px: float) -> Widths:
    """Fit a Gaussian's edge: as if all of the blur were the floor's."""
    return widths_of(edges, 1e3)


def reblur(edges: Edges, floor_px: float, *, disc: bool = False) -> Widths:
    """Read sigma off the ratio of the steepest slopes before and after another blur."""
    good, _, log_std = fitted(edges, floor_px)
    profile = edges.profile[good]
    middle = slice(REACH_PX - 2, REACH_PX + 3)
    before = np.gradient(profile, axis=1)[:, middle].max(axis=1, initial=0.0)
    again = gaussian_filter1d(profile, REBLUR_PX, axis=1) if len(profile) else profile
    after = np.gradient(again, axis=1)[:, middle].max(axis=1, initial=0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = before / after
        sigma = np.sqrt(REBLUR_PX**2 / (ratio**2 - 1))
        if disc:
            scale = 2.0**edges.level
            floor = np.sqrt(floor_px**2 + (scale**2 - 1) / 12) / scale
            sigma = _by_disc(ratio, floor)
        # The slope between neighbours two pixels apart is that behind a box of two.
        sigma = np.sqrt(np.maximum(sigma**2 - BOX_PX2, 1e-4))
    known = np.isfinite(sigma)
    return in_stored_pixels(edges, good[known], sigma[known], (sigma * log_std)[known])


def _by_disc(ratio: FloatArray, floor: float) -> FloatArray:
    """Return the sigma of a disc and the floor, and the box of a gradient, by the ratio of slopes."""
    base = np.sqrt(floor**2 + BOX_PX2)
    radius = np.linspace(0.0, 12.0, 481)
    falling = peak_slope(radius, base) / peak_slope(radius, np.hypot(base, REBLUR_PX))
    # A ratio above that of the floor alone is sharper than the floor: Gaussian from there.
    r = np.interp(-ratio, -falling, radius)
    wide = np.hypot(r / 2, base)
    with np.errstate(invalid="ignore"):
        return np.where(ratio > falling[0], np.sqrt(REBLUR_PX**2 / (ratio**2 - 1)), wide)


ESTIMATORS: dict[str, Estimator] = {
    "edge fit, disc and floor": widths_of,
    "edge fit, Gaussian": gaussian_fit,
    "re-blur ratio, disc": lambda edges, floor: reblur(edges, floor, disc=True),
    "re-blur ratio (Zhuo & Sim)": reblur,
}
