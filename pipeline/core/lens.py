"""Lens by recording and camera file together, in pixels of the stored picture."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from pipeline.core.arrays import NAN
from pipeline.core.config import CameraConfig
from pipeline.core.exposure import FIELDS, Exposure
from pipeline.core.records import Intrinsics

# A picture that was scaled keeps its aspect ratio to within the rounding of its sides.
ASPECT_TOLERANCE = 0.01
# Focal length over pixel pitch and a calibrated focal length in pixels differ by the focus (v > f)
# and by rounding of the lens data, both under a few per cent; more is a contradiction.
FOCAL_TOLERANCE = 0.05
# The diagonal of a frame of 35 mm film, 43.27 mm. A lens of the equivalent focal length sees the same
# angle across it as the real lens across the picture (CIPA DCG-001; EXIF 2.32, FocalLengthIn35mmFilm).
DIAGONAL_35MM_MM = math.hypot(36.0, 24.0)


@dataclass(frozen=True, slots=True)
class Lens:
    """The lens of one frame; pitches are of the stored picture's pixels. NaN is unknown."""

    f_number: float
    focal_length_mm: float
    focus_distance_m: float
    pixel_pitch_x_um: float
    pixel_pitch_y_um: float
    focal_length_35mm_mm: float = NAN
    # Whether angles and pitch come from it, as nothing better is stated.
    by_equivalent: bool = False


def lens_of(
    exposure: Exposure,
    camera: CameraConfig,
    intrinsics: Intrinsics | None,
    width_px: int,
    height_px: int,
) -> Lens:
    """Combine a frame's exposure with the camera file; the recording's word goes first.

    A recording that states no pitch, but the focal length for 35 mm film, gives the pitch by it, unless
    it holds a calibration: the equivalent is rounded to a millimetre, a calibration is better.
    """
    focal_length_mm = _known(exposure.focal_length_mm, camera.focal_length_mm)
    equivalent_mm, pitch_um = exposure.focal_length_35mm_mm, NAN
    if math.isnan(exposure.pixel_pitch_x_um) and intrinsics is None:
        pitch_um = pitch_by_equivalent_um(focal_length_mm, equivalent_mm, width_px, height_px)
    pitch_x_um, pitch_y_um = pitch_um, pitch_um
    if math.isnan(pitch_um):
        pitch_x_um, pitch_y_um = _stated_pitches_um(exposure, camera, width_px, height_px)
    if intrinsics is not None:
        pitch_x_um = _known(pitch_x_um, focal_length_mm * 1e3 / intrinsics.fx_px)
        pitch_y_um = _known(pitch_y_um, focal_length_mm * 1e3 / intrinsics.fy_px)
    no_angles = math.isnan(focal_length_mm / pitch_x_um)
    return Lens(
        f_number=_known(exposure.f_number, camera.f_number),
        focal_length_mm=focal_length_mm,
        focus_distance_m=_known(exposure.focus_distance_m, camera.focus_distance_m),
        pixel_pitch_x_um=pitch_x_um,
        pixel_pitch_y_um=pitch_y_um,
        focal_length_35mm_mm=equivalent_mm,
        by_equivalent=not math.isnan(pitch_um if not no_angles else equivalent_mm),
    )


def _stated_pitches_um(
    exposure: Exposure, camera: CameraConfig, width_px: int, height_px: int
) -> tuple[float, float]:
    """Return the pitches of the stored picture's pixels by those of the sensor's; NaN if unknown."""
    sensor_x_um = _known(exposure.pixel_pitch_x_um, camera.pixel_pitch_x_um)
    sensor_y_um = _known(exposure.pixel_pitch_y_um, camera.pixel_pitch_y_um, sensor_x_um)
    zoom = _known(exposure.digital_zoom_ratio, 1.0)
    return (
        sensor_x_um * _scale(exposure.sensor_width_px, width_px) / zoom,
        sensor_y_um * _scale(exposure.sensor_height_px, height_px) / zoom,
    )


def pitch_by_equivalent_um(
    focal_length_mm: float, focal_length_35mm_mm: float, width_px: int, height_px: int
) -> float:
    """Return the pitch of a picture's pixels by its focal length and the one for 35 mm film.

    The sensor's diagonal is that of 35 mm film times focal_length_mm / focal_length_35mm_mm. The
    equivalent is of the picture as it is, digital zoom included. NaN where anything is unknown, or no
    sensor has such a pitch.
    """
    if width_px <= 0 or height_px <= 0:
        return NAN
    diagonal_mm = DIAGONAL_35MM_MM * focal_length_mm / focal_length_35mm_mm
    pitch_um = diagonal_mm * 1e3 / math.hypot(width_px, height_px)
    low_um, high_um = FIELDS["pixel_pitch_x_um"].bounds
    return pitch_um if low_um <= pitch_um <= high_um else NAN


def intrinsics_of(
    recorded: Intrinsics | None, camera: CameraConfig, lens: Lens, width_px: int, height_px: int
) -> tuple[Intrinsics | None, str | None, str | None]:
    """Return the pinhole camera of a picture, where it comes from, and a complaint.

    From the recording, scaled to the picture if it was made at another size; else from the camera
    file; else from focal length and pixel pitch, or the focal length for 35 mm film alone, with the
    centre assumed in the middle.
    """
    complaint = None
    if recorded is not None:
        fitted = fit_to_picture(recorded, width_px, height_px)
        if fitted is not None:
            return fitted, "recording", _contradiction(fitted, lens) or _scaling(recorded, fitted)
        complaint = (
            f"the calibration is for {recorded.width_px}x{recorded.height_px}, the pictures are "
            f"{width_px}x{height_px}, another aspect ratio; it was not used"
        )
    if math.isfinite(camera.fx_px):
        return (
            Intrinsics(
                width_px,
                height_px,
                camera.fx_px,
                _known(camera.fy_px, camera.fx_px),
                _known(camera.cx_px, (width_px - 1) / 2),
                _known(camera.cy_px, (height_px - 1) / 2),
                camera.distortion_model,
                camera.distortion,
            ),
            "camera_file",
            complaint,
        )
    fx_px = lens.focal_length_mm * 1e3 / lens.pixel_pitch_x_um
    fy_px = lens.focal_length_mm * 1e3 / lens.pixel_pitch_y_um
    if not math.isfinite(fx_px + fy_px):  # angles need no pitch where the equivalent is stated
        diagonal_px = math.hypot(width_px, height_px)
        fx_px = fy_px = lens.focal_length_35mm_mm * diagonal_px / DIAGONAL_35MM_MM
    if not math.isfinite(fx_px + fy_px):
        return None, None, complaint
    centre_x_px, centre_y_px = (width_px - 1) / 2, (height_px - 1) / 2
    return (
        Intrinsics(width_px, height_px, fx_px, fy_px, centre_x_px, centre_y_px),
        "lens_data",
        complaint,
    )


def fit_to_picture(recorded: Intrinsics, width_px: int, height_px: int) -> Intrinsics | None:
    """Return the intrinsics for a scaled picture; None if it has another shape (was cropped)."""
    if recorded.width_px <= 0 or recorded.height_px <= 0:
        return replace(recorded, width_px=width_px, height_px=height_px)
    sx, sy = width_px / recorded.width_px, height_px / recorded.height_px
    if abs(sx / sy - 1) > ASPECT_TOLERANCE:
        return None
    return replace(
        recorded,
        width_px=width_px,
        height_px=height_px,
        fx_px=recorded.fx_px * sx,
        fy_px=recorded.fy_px * sy,
        # the centre of the first pixel is (0, 0): the corner at -0.5 is what stays in place
        cx_px=(recorded.cx_px + 0.5) * sx - 0.5,
        cy_px=(recorded.cy_px + 0.5) * sy - 0.5,
    )


def _contradiction(intrinsics: Intrinsics, lens: Lens) -> str | None:
    by_lens_px = lens.focal_length_mm * 1e3 / lens.pixel_pitch_x_um
    if math.isfinite(by_lens_px) and abs(by_lens_px / intrinsics.fx_px - 1) > FOCAL_TOLERANCE:
        return (
            f"focal length and pixel pitch give {by_lens_px:.0f} px, the calibration "
            f"{intrinsics.fx_px:.0f} px; angles are taken from the calibration"
        )
    return None


def _scaling(recorded: Intrinsics, fitted: Intrinsics) -> str | None:
    sizes = [(k.width_px, k.height_px) for k in (recorded, fitted)]
    if sizes[0] == sizes[1] or min(sizes[0]) <= 0:
        return None
    (was_x, was_y), (is_x, is_y) = sizes
    return (
        f"the calibration is for {was_x}x{was_y}, the pictures are {is_x}x{is_y}; it was scaled, "
        "which is correct only if the pictures were scaled too"
    )


def _scale(sensor_px: float, stored_px: int) -> float:
    return sensor_px / stored_px if math.isfinite(sensor_px) and stored_px > 0 else 1.0


def _known(*values: float) -> float:
    return next((v for v in values if not math.isnan(v)), NAN)
