"""A photograph of a levelling staff, drawn so that the same bytes come out on every machine.

Light is linear until the last step. Blurs run on 16-bit integers, the rest is single additions,
products and roots, which round alike everywhere; the tone curve is a table.

The staff is sharp, as a camera that focused on it would show it and as the paper's own pictures
are; the wall behind is blurred as the aperture and the distances say (see recordings/README.md on
what the paper says of focus).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import cache

import cv2
import numpy as np
import numpy.typing as npt

from pipeline.optics.exposure import linear_to_srgb
from recordings.staff_table import (
    EXPOSURE_TIME_S,
    FOCAL_LENGTH_MM,
    ISO_SPEED,
    PIXEL_PITCH_UM,
    SENSOR_HEIGHT_PX,
    SENSOR_WIDTH_PX,
    Photo,
)

Light = npt.NDArray[np.float32]

SCALE = 0.25  # of the stored picture
WIDTH_PX, HEIGHT_PX = round(SENSOR_WIDTH_PX * SCALE), round(SENSOR_HEIGHT_PX * SCALE)

# A dim office: a white surface has 200 lux / pi = 64 cd/m^2. A pixel is full at 78 N^2 / (0.65 t
# ISO) = 94 cd/m^2 at f/2.8 (ISO 12232), so white is two thirds of full there, and at f/1.8 clips.
ILLUMINANCE_LUX = 200.0
# A stored pixel gathers 1 / SCALE^2 of the sensor's, under blue, green and red filters in these
# shares. 4000 electrons fill one at ISO 1000.
FILTER_SHARE = np.array([0.25, 0.5, 0.25], np.float32)
FULL_WELL_ELECTRONS, READ_NOISE_ELECTRONS = 4000.0, 3.0
CONVERTER_BITS = 14

WALL_DISTANCE_M = 2.5
# Each stored pixel averages four by four, and a good lens is a little softer than its sensor.
STAFF_BLUR_PX = 0.55
AXIS_READING_CM = 123.7  # what the staff reads at the height of the camera

# Reflectances, blue, green, red.
FACE, INK, RED = (0.83, 0.86, 0.86), (0.03, 0.03, 0.03), (0.05, 0.05, 0.50)
LEFT_RIM, RIGHT_RIM, GROOVE = (0.57, 0.56, 0.55), (0.53, 0.52, 0.51), (0.16, 0.16, 0.16)
WALL, WOOD = (0.105, 0.125, 0.135), (0.035, 0.065, 0.11)

_ONE = 65535.0  # a reflectance of 1 where light is kept in 16 bits
_COARSE = 4  # the background is drawn at a quarter of the size: it is never sharp


def photograph(photo: Photo, seed: int) -> npt.NDArray[np.uint8]:
    """Return the stored picture, (h, w, 3) BGR, with the camera's noise."""
    light = _background(_wall_blur_px(photo))
    _put_staff(light, photo)
    light *= _lighting(photo.f_number)
    return _develop(light, photo.f_number, seed)


def _develop(light: Light, f_number: float, seed: int) -> npt.NDArray[np.uint8]:
    """Return what sensor, converter and tone curve make of reflected light (spent in the doing)."""
    luminance = ILLUMINANCE_LUX / math.pi
    full = 78.0 * f_number**2 / (0.65 * EXPOSURE_TIME_S * ISO_SPEED)
    # Eq. 15: at constant time and ISO a pixel's value goes with luminance / N^2.
    light *= np.float32(luminance / full)
    pixels = (FILTER_SHARE / SCALE**2).astype(np.float32)
    # Thousands of photons: their Poisson spread is normal, sqrt(n), beside the read noise.
    variance = light * (1 / (pixels * np.float32(FULL_WELL_ELECTRONS)))
    variance += (READ_NOISE_ELECTRONS / FULL_WELL_ELECTRONS) ** 2 / pixels
    noise = np.random.default_rng((595, seed)).standard_normal(light.shape, np.float32)
    noise *= np.sqrt(variance, out=variance)
    light += noise
    top = (1 << CONVERTER_BITS) - 1
    light *= np.float32(top)
    np.clip(np.rint(light, out=light), 0, top, out=light)
    return _tone_curve()[light.astype(np.uint16)]


@cache
def _tone_curve() -> npt.NDArray[np.uint8]:
    linear = np.arange(1 << CONVERTER_BITS) / ((1 << CONVERTER_BITS) - 1)
    return np.rint(linear_to_srgb(linear) * 255).astype(np.uint8)


def _lighting(f_number: float) -> Light:
    """Return the light on the scene, brighter from the window on the left, less the vignette."""
    across = np.linspace(-1, 1, WIDTH_PX, dtype=np.float32)[None, :]
    down = np.linspace(-1, 1, HEIGHT_PX, dtype=np.float32)[:, None]
    window = 1 - np.float32(0.10) * across - np.float32(0.05) * down
    corner = np.float32(0.10 * 1.8 / f_number) * (across * across + down * down)
    return np.asarray((window * (1 - corner))[..., None], np.float32)


def _wall_blur_px(photo: Photo) -> float:
    """Return sigma of the wall's blur: half the radius f a |1/d - 1/D| of its blur circle."""
    aperture_m = FOCAL_LENGTH_MM / (2 * photo.f_number) * 1e-3
    radius_m = FOCAL_LENGTH_MM * 1e-3 * aperture_m * (1 / photo.drawn_depth_m - 1 / WALL_DISTANCE_M)
    return radius_m / (PIXEL_PITCH_UM * 1e-6) * SCALE / 2


def _background(sigma_px: float) -> Light:
    """Return the wall and the bench before it, out of focus, (h, w, 3)."""
    blurred = cv2.GaussianBlur(_wall_and_bench(), (0, 0), sigma_px / _COARSE)
    fine = cv2.resize(blurred, (WIDTH_PX, HEIGHT_PX), interpolation=cv2.INTER_LINEAR_EXACT)
    return fine.astype(np.float32) * np.float32(1 / _ONE)


@cache
def _wall_and_bench() -> npt.NDArray[np.uint16]:
    """Return a plastered wall above a wooden bench, the same in every photograph."""
    width, height = WIDTH_PX // _COARSE, HEIGHT_PX // _COARSE
    chance = np.random.default_rng(595)
    rough = _to_16_bits(0.5 + 0.10 * chance.standard_normal((height, width)))
    stains = _to_16_bits(0.5 + 0.12 * chance.standard_normal((height // 25, width // 25)))
    stains = cv2.resize(stains, (width, height), interpolation=cv2.INTER_LINEAR_EXACT)
    texture = (rough.astype(np.float64) + stains) / _ONE  # about 1
    image = np.array(WALL) * texture[..., None]
    bench = round(height * 0.80)
    grain = 1 + 0.35 * np.repeat(chance.standard_normal((height - bench, 1)), width, axis=1)
    image[bench:] = np.array(WOOD) * np.clip(grain, 0.3, None)[..., None] * texture[bench:, :, None]
    image[bench : bench + 3] *= 1.8  # its edge catches the light
    image[bench - 4 : bench] *= 0.7
    return _to_16_bits(image)


def _to_16_bits(light: npt.NDArray[np.floating]) -> npt.NDArray[np.uint16]:
    return np.clip(np.rint(light * _ONE), 0, _ONE).astype(np.uint16)


def _put_staff(light: Light, photo: Photo) -> None:
    """Draw the staff upright in the middle, as wide as the row says, and soften it."""
    width = photo.width_px * SCALE
    left = WIDTH_PX / 2 - width / 2
    # A border of background goes with it, so that the staff's edges blur into what is behind them.
    border = math.ceil(6 * STAFF_BLUR_PX)
    x0, x1 = math.floor(left) - border, math.ceil(left + width) + border
    part = light[:, x0:x1].astype(np.float64)
    _draw_staff(part, left - x0, width, photo.px_per_cm * SCALE)
    soft = cv2.GaussianBlur(_to_16_bits(part), (0, 0), STAFF_BLUR_PX)
    light[:, x0:x1] = soft.astype(np.float32) * np.float32(1 / _ONE)


def _draw_staff(
    image: npt.NDArray[np.float64], left: float, width: float, px_per_cm: float
) -> None:
    """Draw an aluminium staff of the E type: each decimetre an E, its number, and an E mirrored."""
    height = image.shape[0]

    def across(low: float, high: float) -> tuple[float, float]:
        return left + low * width, left + high * width

    def down(low_cm: float, high_cm: float) -> tuple[float, float]:
        zero = height / 2 + AXIS_READING_CM * px_per_cm
        return zero - high_cm * px_per_cm, zero - low_cm * px_per_cm

    whole = (0.0, float(height))
    # Rims first, the face over them: painted twice, an outer edge would cover its pixel twice.
    _fill(image, across(0, 0.5), whole, LEFT_RIM)
    _fill(image, across(0.5, 1), whole, RIGHT_RIM)
    _fill(image, across(0.055, 0.945), whole, GROOVE)
    _fill(image, across(0.062, 0.938), whole, FACE)
    # Nothing of the ink overlaps, so that shares of a pixel add up to what is covered.
    ink = np.zeros((height, image.shape[1], 1))
    half_cm = math.ceil(height / 2 / px_per_cm) + 1
    for cm in range(round(AXIS_READING_CM) - half_cm, round(AXIS_READING_CM) + half_cm):
        # The tape along the right rim: a tick each half and each whole centimetre.
        _add(ink, across(0.90, 0.938), down(cm - 0.03, cm + 0.03))
        _add(ink, across(0.915, 0.938), down(cm + 0.48, cm + 0.52))
        step = cm % 10
        if step < 5:
            bar, spine = across(0.10, 0.47), across(0.10, 0.18)
        else:
            bar, spine = across(0.50, 0.87), across(0.79, 0.87)
        # Bars at 0, 2, 4 and, mirrored, 5, 7, 9 cm; the spine between them.
        _add(ink, bar if step % 5 % 2 == 0 else spine, down(cm, cm + 1))
    image += ink * (np.array(INK) - image)
    for decimetre in range(round(AXIS_READING_CM - half_cm) // 10, 25):
        x, (y, _) = across(0.52, 0.87), down(10 * decimetre + 2.5, 10 * decimetre + 2.5)
        _write_number(image, str(decimetre), (x[0] + x[1]) / 2, y, 0.30 * width)


def _write_number(
    image: npt.NDArray[np.float64], text: str, x: float, y: float, height: float
) -> None:
    """Write figures in red, centred on (x, y); pixel edges are whole numbers."""
    fine = 8
    advance = 0.62 * height
    rows, columns = math.ceil(height * 1.2), math.ceil(advance * len(text) + 0.2 * height)
    x0, y0 = round(x - columns / 2), round(y - rows / 2)
    top, bottom = max(0, -y0), min(rows, image.shape[0] - y0)
    if top >= bottom:  # above or below the picture
        return
    # A figure is one unit high and half a unit wide.
    begin = (x - x0 - (advance * len(text) - 0.12 * height) / 2, y - y0 - height / 2)
    mask = np.zeros((rows * fine, columns * fine), np.uint8)
    for index, figure in enumerate(text):
        offset = np.array([begin[0] + index * advance, begin[1]])
        for stroke in _strokes(figure):
            points = np.rint((stroke * height + offset) * fine).astype(np.int32)
            cv2.polylines(mask, [points], False, (255,), max(1, round(0.13 * height * fine)))
    share = mask.reshape(rows, fine, columns, fine).mean(axis=(1, 3)) / 255
    part = image[y0 + top : y0 + bottom, x0 : x0 + columns]
    part += share[top:bottom, : part.shape[1], None] * (np.array(RED) - part)


def _strokes(figure: str) -> Iterator[npt.NDArray[np.float64]]:
    """Yield the strokes of a figure, (n, 2) points in a box half as wide as high, y down."""
    for stroke in _FIGURES[figure]:
        if isinstance(stroke[0], tuple):
            yield np.array(stroke)
        else:  # an arc: centre, radii, from and to in degrees, clockwise from the right
            cx, cy, rx, ry, begin, end = stroke
            angle = np.radians(np.linspace(begin, end, 33))
            yield np.stack([cx + rx * np.cos(angle), cy + ry * np.sin(angle)], axis=1)


_FIGURES: dict[str, tuple[tuple, ...]] = {  # type: ignore[type-arg]
    "0": ((0.25, 0.5, 0.19, 0.435, 0, 360),),
    "1": (((0.10, 0.22), (0.28, 0.07), (0.28, 0.93)),),
    "2": ((0.25, 0.26, 0.18, 0.195, 180, 385), ((0.41, 0.34), (0.06, 0.93), (0.45, 0.93))),
    "3": ((0.24, 0.27, 0.17, 0.20, 190, 450), (0.24, 0.70, 0.20, 0.235, 270, 530)),
    "4": (((0.46, 0.68), (0.04, 0.68), (0.34, 0.07), (0.34, 0.93)),),
    "5": (
        ((0.42, 0.07), (0.11, 0.07), (0.08, 0.48)),
        (0.23, 0.65, 0.21, 0.28, 225, 510),
    ),
    "6": ((0.25, 0.66, 0.19, 0.275, 0, 360), (0.38, 0.66, 0.32, 0.60, 180, 265)),
    "7": (((0.05, 0.07), (0.45, 0.07), (0.19, 0.93)),),
    "8": ((0.25, 0.275, 0.16, 0.21, 0, 360), (0.25, 0.71, 0.20, 0.225, 0, 360)),
    "9": ((0.25, 0.34, 0.19, 0.275, 0, 360), (0.12, 0.34, 0.32, 0.60, 0, 85)),
}


def _fill(
    image: npt.NDArray[np.float64],
    across: tuple[float, float],
    down: tuple[float, float],
    colour: tuple[float, float, float],
) -> None:
    """Paint a rectangle by how much of each pixel it covers; pixel edges are whole numbers."""
    columns, x0 = _cover(image.shape[1], *across)
    rows, y0 = _cover(image.shape[0], *down)
    part = image[y0 : y0 + len(rows), x0 : x0 + len(columns)]
    part += (rows[:, None] * columns[None, :])[..., None] * (np.array(colour) - part)


def _add(
    share: npt.NDArray[np.float64], across: tuple[float, float], down: tuple[float, float]
) -> None:
    """Add to `share` (h, w, 1) how much of each pixel a rectangle covers."""
    columns, x0 = _cover(share.shape[1], *across)
    rows, y0 = _cover(share.shape[0], *down)
    share[y0 : y0 + len(rows), x0 : x0 + len(columns), 0] += rows[:, None] * columns[None, :]


def _cover(count: int, low: float, high: float) -> tuple[npt.NDArray[np.float64], int]:
    """Return the covered share of each pixel that [low, high] touches, and the first of them."""
    first, last = max(0, math.floor(low)), min(count, math.ceil(high))
    edges = np.arange(first, max(last, first) + 1, dtype=np.float64)
    return np.clip(np.minimum(edges[1:], high) - np.maximum(edges[:-1], low), 0, 1), first
