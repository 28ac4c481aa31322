"""Sizes of common sensors, by the name of their format, their chip, or the camera that they are in.

Sources:
    formats: "Table of sensor formats and sizes" of Wikipedia's "Image sensor format"; 1/2.8 after the
        Sony chips below. An optical format in inches is not standardized: of the chips that are sold as
        1/2.8, IMX335 (4:3) is 7 % narrower than IMX290 (16:9).
    Raspberry Pi: "Camera hardware specification" of its documentation (sensor image area, focal length).
    Sony chips: number of recording pixels and unit cell size on their product pages.
    Nikon, Canon: the specifications of the camera's manual.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from difflib import get_close_matches
from typing import NamedTuple

# The diagonal of a frame of 35 mm film, 43.27 mm. A lens of the equivalent focal length sees the same
# angle across it as the real lens across the picture (CIPA DCG-001; EXIF 2.32, FocalLengthIn35mmFilm).
DIAGONAL_35MM_MM = math.hypot(36.0, 24.0)


class Sensor(NamedTuple):
    """The light-sensitive area of a sensor, and the focal length of a lens that is fixed before it."""

    width_mm: float
    height_mm: float
    focal_length_mm: float = math.nan  # NaN: the lens is not part of the camera
    is_format: bool = False  # whether it stands for many chips, whose width differs a little


def _format(width_mm: float, height_mm: float) -> Sensor:
    return Sensor(width_mm, height_mm, is_format=True)


def _chip(width_px: int, height_px: int, pitch_um: float) -> Sensor:
    return Sensor(width_px * pitch_um / 1e3, height_px * pitch_um / 1e3)


SENSORS: Mapping[str, Sensor] = {
    "1/4": _format(3.60, 2.70),
    "1/3.6": _format(4.00, 3.00),
    "1/3.2": _format(4.54, 3.42),
    "1/3": _format(4.80, 3.60),
    "1/2.8": _format(5.57, 3.13),
    "1/2.7": _format(5.37, 4.04),
    "1/2.5": _format(5.76, 4.29),
    "1/2.3": _format(6.17, 4.55),
    "1/2": _format(6.40, 4.80),
    "1/1.8": _format(7.18, 5.32),
    "1/1.7": _format(7.60, 5.70),
    "2/3": _format(8.80, 6.60),
    "1 inch": _format(13.20, 8.80),
    "4/3": _format(17.30, 13.00),
    "aps-c canon": _format(22.30, 14.90),
    "aps-c": _format(23.60, 15.60),
    "super 35": _format(24.89, 18.66),
    "full frame": Sensor(36.0, 24.0),
    # Chips of surveillance and machine vision.
    "sony imx290": _chip(1920, 1080, 2.9),
    "sony imx291": _chip(1920, 1080, 2.9),
    "sony imx307": _chip(1920, 1080, 2.9),
    "sony imx327": _chip(1920, 1080, 2.9),
    "sony imx335": _chip(2592, 1944, 2.0),
    "sony imx415": _chip(3840, 2160, 1.45),
    "sony imx477": _chip(4056, 3040, 1.55),
    "sony imx219": _chip(3280, 2464, 1.12),
    "sony imx708": _chip(4608, 2592, 1.4),
    # Cameras. A focal length is given where the lens cannot be changed.
    "raspberry pi camera 1": Sensor(3.76, 2.74, 3.60),
    "raspberry pi camera 2": Sensor(3.68, 2.76, 3.04),
    "raspberry pi camera 3": Sensor(6.45, 3.63, 4.74),
    "raspberry pi camera 3 wide": Sensor(6.45, 3.63, 2.75),
    "raspberry pi hq camera": Sensor(6.287, 4.712),
    "nikon d5300": Sensor(23.5, 15.6),
    "canon eos 760d": Sensor(22.3, 14.9),
}
_SAME = {"35mm": "full frame", "1": "1 inch", "micro four thirds": "4/3", "four thirds": "4/3"}


def sensor_named(name: str) -> Sensor | None:
    """Return a sensor by its name; None if it is not in the table.

    Capitals, the signs for inches, "type", dashes and runs of spaces do not matter: `1/2.8"` and
    `1/2.8-inch type` are one name.
    """
    plain = _plain(name)
    plain = _plain(_SAME.get(plain, plain))
    return next((s for known, s in SENSORS.items() if _plain(known) == plain), None)


def like(name: str) -> list[str]:
    """Return the names in the table that are most like one that is not there."""
    return get_close_matches(name.lower(), SENSORS, n=4, cutoff=0.4) or sorted(SENSORS)


def _plain(name: str) -> str:
    text = re.sub(r"[\"'″”_-]+", " ", name.lower())
    text = re.sub(r"\b(inch(es)?|in|type|sensor|format)\b", " ", text)
    return " ".join(text.split())
