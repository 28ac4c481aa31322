"""Choice of objects whose blur can tell their depth, by lens data, before a pixel is read.

A surveillance camera's blur does not change over the depths at which people stand before it. Then
nothing is decoded at full size and nothing is measured.
"""

from __future__ import annotations

import math
from enum import StrEnum
from functools import lru_cache

import numpy as np

from pipeline.core.arrays import FloatArray
from pipeline.core.calibration import CalibratedMethod, Dimension
from pipeline.core.config import CameraConfig, Config
from pipeline.core.lens import Lens
from pipeline.optics.defocus import (
    diffraction_sigma_um,
    dioptres,
    radius_per_dioptre_um,
    resolvable_radius,
)
from pipeline.optics.thin_lens import image_distance_mm

# What a camera does to a sharp edge, in its pixels, where nobody has measured it. The pixel's own area
# gives 0.29, interpolated filter colours up to 0.5 more, a lens 0.25-0.6, scaling down takes some of it
# away again: cameras lie between 0.4 and 0.85.
FLOOR_PX, FLOOR_STD_PX = 0.60, 0.13
# The sizes of things where their class says nothing of it: from a hand to a lorry; and of what has no
# class, something that moves: from a bag or a dog.
ANY_SIZE_M = (0.05, 4.0)
NO_CLASS, NO_CLASS_SIZE_M = ("", "unknown"), (0.3, 4.0)
# A size prior's mean and this many standard deviations to either side: nearly everybody.
SPREAD = 3.0


class Declined(StrEnum):
    """Reasons for which an object has no blur."""

    LENS_UNKNOWN = "lens_unknown"  # f-number, focal length, focus distance or pixel pitch
    # At no depth where it can be would it blur more than the lens does, or its box is too small.
    UNRESOLVABLE = "unresolvable"
    NO_EDGES = "no_edges"  # or too few that are steps, or clipped
    TOO_WIDE = "too_wide"  # the blur of one side of the object reaches the other
    MOTION = "motion"  # edges across one direction are softer than along it
    TOO_MANY = "too_many"  # larger boxes of the frame were measured
    NO_PICTURE = "no_picture"


def known(lens: Lens) -> bool:
    """Return whether blur would say anything at all: the four facts that it needs."""
    return (
        lens.f_number > 0
        and lens.focal_length_mm > 0
        and lens.focus_distance_m * 1e3 > lens.focal_length_mm
        and lens.pixel_pitch_x_um > 0
        and lens.pixel_pitch_y_um > 0
    )


def floor_of(lens: Lens, camera: CameraConfig) -> tuple[float, float]:
    """Return what the camera does to a sharp edge at this aperture, and its standard deviation, px."""
    floor_px, std_px = camera.blur_floor_px, camera.blur_floor_std_px
    if math.isnan(floor_px):
        floor_px, std_px = FLOOR_PX, FLOOR_STD_PX
    pitch_um = math.sqrt(lens.pixel_pitch_x_um * lens.pixel_pitch_y_um)
    total_px = math.hypot(floor_px, float(diffraction_sigma_um(lens.f_number)) / pitch_um)
    return total_px, std_px * floor_px / total_px


def resolvable(
    bbox_xyxy_px: FloatArray, class_name: tuple[str, ...], lens: Lens, config: Config, camera: str
) -> np.ndarray:
    """Return which boxes may be blurred by more than is unsure of the floor, (n,).

    An object of a size between known bounds, as large in the picture as its box, is between two
    depths; blur goes up from the plane of focus to either side, so one of the two has the most.
    """
    settings = config.camera_named(camera)
    least, at_focus, v_mm = _least_dioptres(
        lens, settings.blur_floor_px, settings.blur_floor_std_px
    )
    sides_mm = (bbox_xyxy_px[:, 2:] - bbox_xyxy_px[:, :2]) * (
        np.array([lens.pixel_pitch_x_um, lens.pixel_pitch_y_um]) * 1e-3
    )
    if not len(bbox_xyxy_px):
        return np.zeros(0, dtype=np.bool_)
    bounds = [_size_bounds(name, config, camera) for name in class_name]
    side = np.array([b[0] for b in bounds], dtype=np.intp)
    sizes_m = np.array([b[1:] for b in bounds], dtype=np.float64).reshape(-1, 2)
    o_mm = np.where(side == 2, sides_mm.max(axis=1), sides_mm[np.arange(len(side)), side % 2])
    depths_m = np.maximum(v_mm * sizes_m / o_mm[:, None], lens.focal_length_mm * 2e-3)
    return np.asarray(np.abs(1.0 / depths_m - at_focus).max(axis=1) > least)


@lru_cache(maxsize=256)
def _least_dioptres(lens: Lens, floor_px: float, floor_std_px: float) -> tuple[float, float, float]:
    """Return how far from the plane of focus blur is resolved, that plane, both in 1/m, and v in mm."""
    settings = CameraConfig("", blur_floor_px=floor_px, blur_floor_std_px=floor_std_px)
    pitch_um = math.sqrt(lens.pixel_pitch_x_um * lens.pixel_pitch_y_um)
    limit_um = float(resolvable_radius(*floor_of(lens, settings))) * pitch_um
    s_m, f_mm = lens.focus_distance_m, lens.focal_length_mm
    per_dioptre_um = float(radius_per_dioptre_um(f_mm, lens.f_number, s_m))
    return limit_um / per_dioptre_um, float(dioptres(s_m)), float(image_distance_mm(s_m, f_mm))


def _size_bounds(name: str, config: Config, camera: str) -> tuple[int, float, float]:
    """Return which side of the box (0 width, 1 height, 2 the longer) and between which sizes it is."""
    for calibration in config.calibration:
        if (
            calibration.method is CalibratedMethod.SIZE
            and calibration.object_class == name
            and calibration.camera in ("", camera)
        ):
            size_m = calibration.value("object_size_m")
            spread = SPREAD * np.nan_to_num(calibration.value("residual_relative"), nan=0.1)
            return (
                _side(calibration.dimension),
                size_m * max(1 - spread, 0.1),
                size_m * (1 + spread),
            )
    for prior in config.size_prior:
        if prior.object_class == name:
            low = max(prior.mean_m - SPREAD * prior.std_m, prior.mean_m / 10)
            return _side(prior.dimension), low, prior.mean_m + SPREAD * prior.std_m
    return (2, *NO_CLASS_SIZE_M) if name in NO_CLASS else (2, *ANY_SIZE_M)


def _side(dimension: Dimension) -> int:
    return 0 if dimension is Dimension.WIDTH else 1
