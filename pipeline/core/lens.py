"""Lens by recording and camera file together, in pixels of the stored picture."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from pipeline.core.arrays import NAN
from pipeline.core.config import CameraConfig
from pipeline.core.exposure import FIELDS, UNKNOWN_EXPOSURE, Exposure
from pipeline.core.records import Intrinsics
from pipeline.core.sensors.hints import with_hints
from pipeline.core.sensors.table import DIAGONAL_35MM_MM

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
    """Combine a frame's exposure with the camera file; the camera file's word goes first.

    Fields of other channels that the camera file names are its word too, so a number beside them only
    fills. Where no pitch is stated, but the focal length for 35 mm film, that gives the pitch, unless
    the recording holds a calibration: the equivalent is rounded to a millimetre. Hints of the camera
    file (`pipeline.core.sensors.hints`) count as the keys that they stand for.
    """
    camera, exposure = with_hints(camera, exposure, width_px, height_px)
    focal_length_mm = _stated("focal_length_mm", exposure, camera)
    equivalent_mm, pitch_um = exposure.focal_length_35mm_mm, NAN
    stated_um = _stated("pixel_pitch_x_um", exposure, camera)
    if math.isnan(stated_um) and intrinsics is None:
        pitch_um = pitch_by_equivalent_um(focal_length_mm, equivalent_mm, width_px, height_px)
    pitch_x_um, pitch_y_um = pitch_um, pitch_um
    if math.isnan(pitch_um):
        pitch_x_um, pitch_y_um = _stated_pitches_um(exposure, camera, width_px, height_px)
    if intrinsics is not None:
        pitch_x_um = _known(pitch_x_um, focal_length_mm * 1e3 / intrinsics.fx_px)
        pitch_y_um = _known(pitch_y_um, focal_length_mm * 1e3 / intrinsics.fy_px)
    no_angles = math.isnan(focal_length_mm / pitch_x_um)
    return Lens(
        f_number=_stated("f_number", exposure, camera),
        focal_length_mm=focal_length_mm,
        focus_distance_m=_stated("focus_distance_m", exposure, camera),
        pixel_pitch_x_um=pitch_x_um,
        pixel_pitch_y_um=pitch_y_um,
        focal_length_35mm_mm=equivalent_mm,
        by_equivalent=not math.isnan(pitch_um if not no_angles else equivalent_mm),
    )


def _stated(name: str, exposure: Exposure, camera: CameraConfig) -> float:
    """Return a value by the camera file, else by the recording; NaN if neither states it."""
    recorded, given = getattr(exposure, name), getattr(camera, name)
    named = getattr(camera.exposure, name)
    return float(_known(recorded, given) if named else _known(given, recorded))


def overridden(exposure: Exposure, camera: CameraConfig) -> str | None:
    """Return a sentence on values of the camera file that a frame of the recording contradicts."""
    texts = []
    for name in ("f_number", "focal_length_mm", "focus_distance_m", "pixel_pitch_x_um"):
        recorded, used = getattr(exposure, name), _stated(name, exposure, camera)
        if math.isfinite(recorded) and abs(used / recorded - 1) > FOCAL_TOLERANCE:
            texts.append(f"{name} {used:g} (the recording states others)")
    if not texts:
        return None
    return (
        f"the camera file goes before the recording: {', '.join(texts)}; correct it if it is wrong"
    )


def _stated_pitches_um(
    exposure: Exposure, camera: CameraConfig, width_px: int, height_px: int
) -> tuple[float, float]:
    """Return the pitches of the stored picture's pixels by those of the sensor's; NaN if unknown."""
    sensor_x_um = _stated("pixel_pitch_x_um", exposure, camera)
    sensor_y_um = _known(_stated("pixel_pitch_y_um", exposure, camera), sensor_x_um)
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
    """Return the pinhole camera of a picture, the source of its focal length, and a complaint.

    What the camera file states goes first, value by value. Else the calibration of the recording,
    scaled to the picture if it was made at another size, unless focal length and pixel pitch of the
    camera file contradict it; else focal length and pixel pitch, or the focal length for 35 mm film
    alone, with the centre assumed in the middle. A hint of the camera file (an angle of view, a sensor)
    goes first only where the calibration contradicts it. A calibration whose focal length the camera file
    replaces keeps its centre and distortion only if the two agree.
    """
    hinted, _ = with_hints(camera, UNKNOWN_EXPOSURE, width_px, height_px)
    complaint = None
    fitted = fit_to_picture(recorded, width_px, height_px) if recorded is not None else None
    if recorded is not None and fitted is None:
        complaint = (
            f"the calibration is for {recorded.width_px}x{recorded.height_px}, the pictures are "
            f"{width_px}x{height_px}, another shape; it was not used"
        )
    given_px = hinted.fx_px
    if math.isnan(given_px) and _states_lens(hinted):
        given_px = lens.focal_length_mm * 1e3 / lens.pixel_pitch_x_um
    if recorded is not None and fitted is not None:
        complaint = _contradiction(fitted, lens) or _scaling(recorded, fitted)
        if math.isfinite(given_px) and abs(given_px / fitted.fx_px - 1) > FOCAL_TOLERANCE:
            complaint = (
                f"the recording's calibration states {fitted.fx_px:.0f} px, the camera file "
                f"{given_px:.0f} px; the camera file is taken, and the calibration is not used"
            )
            fitted = None
    if fitted is not None:
        source = "recording" if math.isnan(camera.fx_px) else "camera_file"
        return _with_given(fitted, camera), source, complaint
    fx_px = lens.focal_length_mm * 1e3 / lens.pixel_pitch_x_um
    fy_px = lens.focal_length_mm * 1e3 / lens.pixel_pitch_y_um
    if not math.isfinite(fx_px + fy_px):  # angles need no pitch where the equivalent is stated
        diagonal_px = math.hypot(width_px, height_px)
        fx_px = fy_px = lens.focal_length_35mm_mm * diagonal_px / DIAGONAL_35MM_MM
    source = "lens_data"
    if math.isfinite(hinted.fx_px):
        fx_px, fy_px, source = hinted.fx_px, hinted.fx_px, "camera_file"
    if not math.isfinite(fx_px + fy_px):
        return None, None, complaint
    middle_px = (width_px - 1) / 2, (height_px - 1) / 2
    plain = Intrinsics(width_px, height_px, fx_px, fy_px, *middle_px)
    return _with_given(plain, camera), source, complaint


def lens_sources(lens: Intrinsics, camera: CameraConfig, source: str | None) -> tuple[str, str]:
    """Return where the centre and the distortion of a lens come from: recording, camera_file, assumed.

    Args:
        lens: as `intrinsics_of` returns it.
        camera: the entry of the camera file.
        source: of the focal length.
    """
    middle = math.isclose(lens.cx_px, (lens.width_px - 1) / 2) and math.isclose(
        lens.cy_px, (lens.height_px - 1) / 2
    )
    centre = "recording" if source == "recording" or not middle else "assumed"
    distortion = "recording" if source == "recording" or lens.distortion else "assumed"
    return (
        "camera_file" if math.isfinite(camera.cx_px + camera.cy_px) else centre,
        "camera_file" if camera.distortion_model else distortion,
    )


def _states_lens(camera: CameraConfig) -> bool:
    return math.isfinite(camera.focal_length_mm + camera.pixel_pitch_x_um)


def _with_given(lens: Intrinsics, camera: CameraConfig) -> Intrinsics:
    """Return a lens with what the camera file states of it, value by value."""
    fx_px = _known(camera.fx_px, lens.fx_px)
    alike = _known(camera.fx_px, lens.fy_px) if math.isfinite(camera.fx_px) else lens.fy_px
    bent = bool(camera.distortion_model)
    return replace(
        lens,
        fx_px=fx_px,
        fy_px=_known(camera.fy_px, alike),
        cx_px=_known(camera.cx_px, lens.cx_px),
        cy_px=_known(camera.cy_px, lens.cy_px),
        distortion_model=camera.distortion_model if bent else lens.distortion_model,
        distortion=camera.distortion if bent else lens.distortion,
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
