"""Lens by what a data sheet says: angle of view, sensor, or focal length for 35 mm film.

Each hint becomes the keys of a camera file that it stands for, so that all else knows these only. A
focal length in pixels, or a pixel pitch, that is stated beside a hint goes first.
"""

from __future__ import annotations

import math
from dataclasses import replace

from pipeline.core.config import CameraConfig
from pipeline.core.exposure import Exposure
from pipeline.core.sensors.table import DIAGONAL_35MM_MM, Sensor, sensor_named

# Data sheets round an angle of view to a degree.
ANGLE_ROUNDING_DEG = 0.5
# Difference in width of two chips of the format 1/2.8, IMX335 and IMX290 (`pipeline.core.sensors.table`).
FORMAT_SPREAD = 0.07
# The keys of a camera file that say how long its lens is, the best first.
WAYS_TO_GIVE_A_LENS = (
    "fx_px, hfov_deg, focal_length_35mm_mm, or focal_length_mm with pixel_pitch_x_um or sensor"
)


def gives_lens(camera: CameraConfig) -> bool:
    """Return whether a camera file says how long the lens is, in any of the ways."""
    sensor = sensor_named(camera.sensor) if camera.sensor else None
    fixed_mm = sensor.focal_length_mm if sensor else math.nan
    pitched = math.isfinite(camera.pixel_pitch_x_um) or sensor is not None
    focal_mm = fixed_mm if math.isnan(camera.focal_length_mm) else camera.focal_length_mm
    angles = (camera.fx_px, camera.hfov_deg, camera.focal_length_35mm_mm)
    return any(map(math.isfinite, angles)) or (pitched and math.isfinite(focal_mm))


def with_hints(
    camera: CameraConfig, exposure: Exposure, width_px: int, height_px: int
) -> tuple[CameraConfig, Exposure]:
    """Return a camera whose hints are stated as focal length and pixel pitch.

    Args:
        camera: the entry of the camera file.
        exposure: the settings of a frame; its number of sensor pixels scales the pitch.
        width_px: width of the stored picture.
        height_px: height of the stored picture.

    Returns:
        `fx_px` by `hfov_deg`: f = (w / 2) / tan(hfov / 2), the pinhole camera. Pitch, and the focal
        length of a fixed lens, by `sensor`, of which the picture is taken to be the largest part that
        has its shape. By `focal_length_35mm_mm` the same value in the exposure, where it gives a pitch,
        and `fx_px`: f = f35 d / d35, with the diagonals of the picture and of 35 mm film.
    """
    if width_px <= 0 or height_px <= 0:
        return camera, exposure
    if math.isfinite(camera.hfov_deg) and math.isnan(camera.fx_px):
        half_rad = math.radians(camera.hfov_deg) / 2
        camera = replace(camera, fx_px=width_px / 2 / math.tan(half_rad))
    sensor = sensor_named(camera.sensor) if camera.sensor else None
    stated = not math.isnan(camera.pixel_pitch_x_um) or not math.isnan(exposure.pixel_pitch_x_um)
    if sensor is not None and not stated:
        camera = _with_sensor(camera, sensor, exposure, width_px, height_px)
    equivalent_mm = camera.focal_length_35mm_mm
    if math.isfinite(equivalent_mm):
        exposure = replace(exposure, focal_length_35mm_mm=equivalent_mm)
        if not math.isfinite(camera.fx_px) and not _states_lens(camera):
            diagonal_px = math.hypot(width_px, height_px)
            camera = replace(camera, fx_px=equivalent_mm * diagonal_px / DIAGONAL_35MM_MM)
    return camera, exposure


def _states_lens(camera: CameraConfig) -> bool:
    return math.isfinite(camera.focal_length_mm + camera.pixel_pitch_x_um)


def _with_sensor(
    camera: CameraConfig, sensor: Sensor, exposure: Exposure, width_px: int, height_px: int
) -> CameraConfig:
    focal_mm = camera.focal_length_mm
    if math.isnan(focal_mm):
        focal_mm = sensor.focal_length_mm
    stored_um = stored_pitch_um(sensor, width_px, height_px)
    # A pitch in a camera file is of the sensor's own pixels; the lens scales it to the stored picture.
    shrunk_x = exposure.sensor_width_px / width_px
    shrunk_y = exposure.sensor_height_px / height_px
    return replace(
        camera,
        focal_length_mm=focal_mm,
        pixel_pitch_x_um=stored_um / (shrunk_x if math.isfinite(shrunk_x) else 1.0),
        pixel_pitch_y_um=stored_um / (shrunk_y if math.isfinite(shrunk_y) else 1.0),
    )


def stored_pitch_um(sensor: Sensor, width_px: int, height_px: int) -> float:
    """Return the pitch of a picture's pixels, if it is the largest part of its shape of a sensor.

    A picture that is wider than the sensor in shape has the sensor's width, one that is higher its
    height; a picture turned by a quarter is compared with the sensor turned.
    """
    long_mm, short_mm = sorted((sensor.width_mm, sensor.height_mm), reverse=True)
    long_px, short_px = sorted((width_px, height_px), reverse=True)
    return min(long_mm / long_px, short_mm / short_px) * 1e3


def assumption_of(camera: CameraConfig, width_px: int) -> tuple[str, str] | None:
    """Return code and message of the diagnostic of a lens by a hint; None if it rests on none."""
    if math.isfinite(camera.fx_px):
        return None
    if math.isfinite(camera.hfov_deg):
        half_rad = math.radians(camera.hfov_deg) / 2
        # d ln f / d hfov = -1 / sin(hfov), of f = (w / 2) / tan(hfov / 2)
        share = math.radians(ANGLE_ROUNDING_DEG) / math.sin(2 * half_rad)
        return "lens_by_angle", (
            f"the focal length, {width_px / 2 / math.tan(half_rad):.0f} px, is by hfov_deg = "
            f"{camera.hfov_deg:g}: an angle that is rounded to a degree makes distances unsure by up to "
            f"{share:.1%} more than their intervals say, and one that is told of another mode of the "
            "camera, or of a distorted picture, by more; give fx_px of a calibration if it matters"
        )
    if camera.sensor and math.isnan(camera.pixel_pitch_x_um):
        sensor = sensor_named(camera.sensor)
        spread = f", and chips of one format differ by up to {FORMAT_SPREAD:.0%}"
        return "lens_by_sensor", (
            f"the pixel pitch is by sensor = {camera.sensor!r}: the pictures are taken to show its full "
            "width or height. A video mode that uses a part of the sensor makes distances too short by "
            f"the same share{spread if sensor and sensor.is_format else ''}; give hfov_deg or fx_px to "
            "settle it"
        )
    if math.isfinite(camera.focal_length_35mm_mm) and not _states_lens(camera):
        return "rounded_focal_length", (
            f"the focal length is by focal_length_35mm_mm = {camera.focal_length_35mm_mm:g}: it is "
            "rounded to a millimetre, so distances are unsure by up to "
            f"{0.5 / camera.focal_length_35mm_mm:.1%} more than their intervals say; give fx_px if it "
            "matters"
        )
    return None
