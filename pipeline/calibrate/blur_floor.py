"""A camera's own softness, by which depth from defocus is limited: three ways to find it.

- sweeps: of what stands still while the aperture changes, blur's variance is a line that begins there;
- truth: where depth is known, so is the disc, and what is left of the variance is the floor;
- sharpest: without either, the sharpest tenth of the objects is taken to be in focus.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from pipeline.core.arrays import FloatArray
from pipeline.core.config import CameraConfig
from pipeline.core.errors import CalibrationUndetermined
from pipeline.core.robust import MAD_TO_STD
from pipeline.estimate.boxes.geometry import Geometry
from pipeline.estimate.methods.defocus import LENS_STD, BlurVariance, focus_std_per_m
from pipeline.estimate.methods.defocus_sweep import LEAST_STD_PX, solve
from pipeline.estimate.types import Measured
from pipeline.optics.defocus import dioptres

LEAST_OBSERVATIONS, LEAST_TRACKS = 5, 10
SHARPEST = 0.1


@dataclass(frozen=True, slots=True)
class BlurFloor:
    """Width of a sharp edge, without diffraction: pixels of the stored picture."""

    floor_px: float
    std_px: float
    source: str
    count: int  # of observations


def calibrate_blur_floor(measured: Measured, true_depth_m: FloatArray) -> BlurFloor:
    """Find the floor of one camera of one recording.

    Args:
        measured: its observations with their blur.
        true_depth_m: what is known of their depth, (n,), NaN where nothing is.

    Raises:
        CalibrationUndetermined: too little blur was measured.
    """
    if measured.blur_sigma_px is None:
        raise CalibrationUndetermined("no blur was measured in the pictures")
    blur = BlurVariance.of(Geometry.of(measured), CameraConfig(measured.camera))
    excess = blur.variance - blur.diffraction
    before = (blur.floor - blur.diffraction, blur.floor_std)
    found = []
    sweeps = solve(measured, excess, blur.std, blur.per_dioptre2, before)
    if sweeps is not None and sweeps.floor_px2 > 0:
        count = int(np.isfinite(sweeps.u2).sum())
        found.append(_floor(sweeps.floor_px2, sweeps.floor_px2_std, "sweeps", count))
    by_truth = _by_truth(blur, excess, measured, true_depth_m)
    if by_truth is not None:
        found.append(by_truth)
    if not found:
        found.append(_by_sharpest(measured))
    return combined(found)


def combined(floors: Sequence[BlurFloor]) -> BlurFloor:
    """Return one floor from several of the same camera, by precision; apart, they are less sure."""
    weight = np.array([1 / f.std_px**2 for f in floors])
    value = np.array([f.floor_px for f in floors])
    mean = float((weight * value).sum() / weight.sum())
    squared = float((weight * (value - mean) ** 2).sum()) / max(len(floors) - 1, 1)
    std = float(np.sqrt(max(squared, 1.0) / weight.sum()))
    sources = " and ".join(dict.fromkeys(f.source for f in floors))
    return BlurFloor(mean, max(std, LEAST_STD_PX), sources, sum(f.count for f in floors))


def _floor(variance_px2: float, std_px2: float, source: str, count: int) -> BlurFloor:
    floor_px = float(np.sqrt(variance_px2))
    return BlurFloor(floor_px, max(std_px2 / (2 * floor_px), LEAST_STD_PX), source, count)


def _by_truth(
    blur: BlurVariance, excess: FloatArray, m: Measured, true_depth_m: FloatArray
) -> BlurFloor | None:
    """Return the weighted median of the variance that the disc of the true depth leaves."""
    at_focus = dioptres(m.focus_distance_m)
    u = np.abs(dioptres(true_depth_m) - at_focus)
    left = excess - blur.per_dioptre2 * u**2
    by_lens = (
        blur.per_dioptre2 * 2 * u * np.hypot(u * LENS_STD, focus_std_per_m(m.focus_distance_m))
    )
    std = np.sqrt(blur.std**2 + by_lens**2 + (blur.diffraction / 2) ** 2)
    known = np.isfinite(left) & (std > 0)
    if known.sum() < LEAST_OBSERVATIONS:
        return None
    order = np.argsort(left[known])
    left, weight = left[known][order], 1 / std[known][order] ** 2
    total = np.cumsum(weight)
    middle = float(left[np.searchsorted(total, total[-1] / 2)])
    if middle <= 0:
        return None
    z = np.abs(left - middle) * np.sqrt(weight)
    wider = max(MAD_TO_STD * float(np.median(z)), 1.0)
    return _floor(middle, wider * np.sqrt(np.pi / 2 / total[-1]), "truth", int(known.sum()))


def _by_sharpest(m: Measured) -> BlurFloor:
    frame = pd.Series(np.asarray(m.blur_sigma_px)).groupby(m.track_id).median().dropna()
    if len(frame) < LEAST_TRACKS:
        raise CalibrationUndetermined(
            f"blur was measured in {len(frame)} tracks: there is no aperture sweep, no truth and too "
            "few objects to take the sharpest for sharp"
        )
    low, next_ = (float(v) for v in frame.quantile([SHARPEST, 2 * SHARPEST]))
    return BlurFloor(low, max((next_ - low) / 2, 0.05), "sharpest", len(frame))
