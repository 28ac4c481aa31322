"""What a recording and a camera file together say of a lens, in pixels of the stored picture."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from pipeline.core.arrays import NAN
from pipeline.core.config import CameraConfig
from pipeline.core.exposure import Exposure
from pipeline.core.records import Intrinsics

# A picture that was scaled keeps its aspect ratio to within the rounding of its sides.
ASPECT_TOLERANCE = 0.01
# Focal length over pixel pitch and a calibrated focal length in pixels differ by the focus (v > f)
# and by rounding of the lens data, both under a few per cent; more is a contradiction.
FOCAL_TOLERANCE = 0.05


@dataclass(frozen=True, slots=True)
class Lens:
    """The lens of one frame; pitches are of the stored picture's pixels. NaN is unknown."""

    f_number: float
    focal_length_mm: float
    focus_distance_m: float
    pixel_pitch_x_um: float
    pixel_pitch_y_um: float


def lens_of(
    exposure: Exposure,
    camera: CameraConfig,
    intrinsics: Intrinsics | None,
    width_px: int,
    height_px: int,
) -> Lens:
    """Combine a frame's exposure with the camera file; the recording's word goes first."""
    focal_length_mm = _known(exposure.focal_length_mm, camera.focal_length_mm)
    sensor_x_um = _known(exposure.pixel_pitch_x_um, camera.pixel_pitch_x_um)
    sensor_y_um = _known(exposure.pixel_pitch_y_um, camera.pixel_pitch_y_um, sensor_x_um)
    zoom = _known(exposure.digital_zoom_ratio, 1.0)
    pitch_x_um = sensor_x_um * _scale(exposure.sensor_width_px, width_px) / zoom
    pitch_y_um = sensor_y_um * _scale(exposure.sensor_height_px, height_px) / zoom
    if intrinsics is not None:
        pitch_x_um = _known(pitch_x_um, focal_length_mm * 1e3 / intrinsics.fx_px)
        pitch_y_um = _known(pitch_y_um, focal_length_mm * 1e3 / intrinsics.fy_px)
    return Lens(
        f_number=_known(exposure.f_number, camera.f_number),
        focal_length_mm=focal_length_mm,
        focus_distance_m=_known(exposure.focus_distance_m, camera.focus_distance_m),
        pixel_pitch_x_um=pitch_x_um,
        pixel_pitch_y_um=pitch_y_um,
    )


def intrinsics_of(
    recorded: Intrinsics | None, camera: CameraConfig, lens: Lens, width_px: int, height_px: int
) -> tuple[Intrinsics | None, str | None, str | None]:
    """Return the pinhole camera of a picture, where it comes from, and a complaint.

    From the recording, scaled to the picture if it was made at another size; else from the camera
    file; else from focal length and pixel pitch with the centre assumed in the middle.
    """
    complaint = None
    if recorded is not None:
        fitted = fit_to_picture(recorded, width_px, height_px)
        if fitted is not None:
            return fitted, "recording", _contradiction(fitted, lens) or _scaling(recorded, fitted)
        complaint = (
            f"the calibration is for {recorded.width_px}x{recorded.height_px}, the pictures are "
            f"{width_px}x{height_px}, another shape; it was not used"
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
        "which is right if the pictures were"
    )


def _scale(sensor_px: float, stored_px: int) -> float:
    return sensor_px / stored_px if math.isfinite(sensor_px) and stored_px > 0 else 1.0


def _known(*values: float) -> float:
    return next((v for v in values if not math.isnan(v)), NAN)
