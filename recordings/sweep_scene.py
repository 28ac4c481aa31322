"""Pictures of flat targets before a wall through a lens out of focus, drawn by the thin-lens model.

Every target is blurred by the disc that its own depth gives it, cover and colour alike, and laid over
what is behind it: at its outline the picture fades from target to background as widely as the target
is blurred, whatever the background's own blur. On top of that come the lens's own softness, the Airy
pattern of its aperture, the pixel's area, photons, read noise, the mosaic of filters, tone curve and
JPEG. Nothing here uses the estimator's formulas of edges.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import cv2
import numpy as np
import numpy.typing as npt
from scipy.special import j1

from pipeline.optics.exposure import linear_to_srgb
from pipeline.optics.thin_lens import blur_radius_um, image_distance_mm

Light = npt.NDArray[np.float32]
Box = tuple[float, float, float, float]

FINE = 4  # drawn and blurred on this many points a pixel, unless the blur is wide
WIDE_BLUR_PX = (
    6.0  # from here on the grid of a pixel adds under a thousandth to the blur's variance
)
WAVELENGTH_UM = 0.55
READ_NOISE_ELECTRONS = 3.0
ELECTRONS_PER_UM2 = 1000.0  # full well at ISO 100; in proportion to the pixel's area
CONVERTER_BITS = 14


@dataclass(frozen=True, slots=True)
class Lens:
    """A camera as it is, which need not be as its recording states."""

    focal_length_mm: float = 50.0
    f_number: float = 2.8
    focus_distance_m: float = math.inf
    pixel_pitch_um: float = 26.0
    width_px: int = 900
    height_px: int = 600
    softness_px: float = 0.35  # sigma of what is neither pixel, diffraction nor focus
    exposure_time_s: float = 0.01
    iso_speed: float = 400.0
    mosaic: bool = False  # whether a pixel sees one colour, and the others are interpolated
    jpeg_quality: int = 90

    @property
    def focal_px(self) -> float:
        """The image distance in pixels: magnification is this over depth."""
        v_mm = float(image_distance_mm(self.focus_distance_m, self.focal_length_mm))
        return v_mm * 1e3 / self.pixel_pitch_um

    def blur_radius_px(self, depth_m: float) -> float:
        """Return the radius of the blur circle."""
        radius_um = blur_radius_um(
            depth_m, self.focal_length_mm, self.f_number, self.focus_distance_m
        )
        return float(radius_um) / self.pixel_pitch_um

    @property
    def floor_sigma_px(self) -> float:
        """Softness and pixel together, without diffraction and mosaic."""
        return math.sqrt(self.softness_px**2 + 1 / 12)


@dataclass(frozen=True, slots=True)
class Target:
    """A flat thing across the axis; colours are reflectances in the order blue, green, red."""

    object_id: str
    depth_m: float
    x_m: float
    y_m: float
    width_m: float
    height_m: float
    pattern: str = "plain"  # plain, bars, checks, blocks
    pieces: int = 3  # of the pattern, across
    outline: str = "rectangle"  # or ellipse
    turn_rad: float = 0.0
    colour: tuple[float, float, float] = (0.75, 0.75, 0.75)
    other: tuple[float, float, float] = (0.06, 0.06, 0.06)
    seed: int = 0

    def box_px(self, lens: Lens) -> Box:
        """Return the outer edges in the picture; the centre of the first pixel is (0, 0)."""
        cos, sin = abs(math.cos(self.turn_rad)), abs(math.sin(self.turn_rad))
        if self.outline == "ellipse":
            half_x = math.hypot(self.width_m * cos, self.height_m * sin) / 2
            half_y = math.hypot(self.width_m * sin, self.height_m * cos) / 2
        else:
            half_x = (self.width_m * cos + self.height_m * sin) / 2
            half_y = (self.width_m * sin + self.height_m * cos) / 2
        scale = lens.focal_px / self.depth_m
        x = (lens.width_px - 1) / 2 + self.x_m * scale
        y = (lens.height_px - 1) / 2 + self.y_m * scale
        return (x - half_x * scale, y - half_y * scale, x + half_x * scale, y + half_y * scale)


@dataclass(frozen=True, slots=True)
class Scene:
    """Targets before a wall, and the light on them."""

    targets: tuple[Target, ...]
    wall_depth_m: float = 7.0
    wall_colour: tuple[float, float, float] = (0.25, 0.28, 0.30)
    wall_contrast: float = 0.25
    wall_grain_m: float = 0.02  # size of the finest of its stains
    illuminance_lux: float = 300.0
    seed: int = 0


def photograph(
    scene: Scene, lens: Lens, seed: int, speeds_px: Sequence[tuple[float, float]] = ()
) -> npt.NDArray[np.uint8]:
    """Return the developed picture, (h, w, 3) BGR.

    `speeds_px` says how far each target moves in the picture while the shutter is open.
    """
    light = _wall(scene, lens)
    moves = dict(zip((t.object_id for t in scene.targets), speeds_px, strict=False))
    for target in sorted(scene.targets, key=lambda t: -t.depth_m):
        _put(light, target, lens, moves.get(target.object_id, (0.0, 0.0)))
    return _develop(light, scene, lens, seed)


def jpeg(picture: npt.NDArray[np.uint8], quality: int) -> bytes:
    """Return the picture as JPEG."""
    _, data = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, quality])
    return data.tobytes()


def _wall(scene: Scene, lens: Lens) -> Light:
    """Return the wall, stained at every size, out of focus."""
    radius = lens.blur_radius_px(scene.wall_depth_m)
    border = math.ceil(radius) + 4
    size = (lens.width_px + 2 * border, lens.height_px + 2 * border)
    chance = np.random.default_rng((2021, scene.seed))
    stains = np.zeros((size[1], size[0]), np.float32)
    grain_px = max(scene.wall_grain_m * lens.focal_px / scene.wall_depth_m, 1.0)
    octaves = max(1, round(math.log2(max(size) / grain_px)))
    for octave in range(octaves):
        cells = [max(2, round(s / (grain_px * 2**octave))) for s in size]
        coarse = chance.standard_normal((cells[1], cells[0]), np.float32)
        stains += cv2.resize(coarse, size, interpolation=cv2.INTER_CUBIC)
    stains *= scene.wall_contrast / math.sqrt(octaves)
    wall = np.clip(1 + stains, 0.05, 3.0)
    soft = _soften(wall, radius, lens, 1)[border:-border, border:-border]
    return np.asarray(soft[..., None] * np.float32(scene.wall_colour), np.float32)


def _put(light: Light, target: Target, lens: Lens, move_px: tuple[float, float]) -> None:
    """Draw a target, blur its cover and colours, and lay it over the picture."""
    radius = lens.blur_radius_px(target.depth_m)
    fine = 1 if radius > WIDE_BLUR_PX else FINE
    x0, y0, x1, y1 = target.box_px(lens)
    border = math.ceil(radius + 6 + max(map(abs, move_px)))
    left, top = math.floor(x0) - border, math.floor(y0) - border
    width, height = math.ceil(x1) + border + 1 - left, math.ceil(y1) + border + 1 - top
    x = left - 0.5 + (np.arange(width * fine) + 0.5) / fine
    y = top - 0.5 + (np.arange(height * fine) + 0.5) / fine
    cover, first = _draw(target, lens, x, y, 4 if fine == 1 else 2)
    soft = [_soften(_moved(p, move_px, fine), radius, lens, fine) for p in (cover, first)]
    share = [cv2.resize(p, (width, height), interpolation=cv2.INTER_AREA) for p in soft]
    rows = slice(max(top, 0), min(top + height, light.shape[0]))
    columns = slice(max(left, 0), min(left + width, light.shape[1]))
    if rows.start >= rows.stop or columns.start >= columns.stop:
        return
    inside = (
        slice(rows.start - top, rows.stop - top),
        slice(columns.start - left, columns.stop - left),
    )
    cover, first = (p[inside][..., None] for p in share)
    light[rows, columns] *= 1 - cover
    light[rows, columns] += first * np.float32(target.colour)
    light[rows, columns] += (cover - first) * np.float32(target.other)


def _draw(
    target: Target, lens: Lens, x: npt.NDArray[np.float64], y: npt.NDArray[np.float64], part: int
) -> tuple[Light, Light]:
    """Return cover and the share of the first colour, each point the mean of part x part ones."""
    step = x[1] - x[0]
    offsets = ((np.arange(part) + 0.5) / part - 0.5) * step
    x = (x[:, None] + offsets).ravel()
    y = (y[:, None] + offsets).ravel()
    scale = lens.focal_px / target.depth_m
    across = (x - (lens.width_px - 1) / 2) / scale - target.x_m
    down = (y - (lens.height_px - 1) / 2) / scale - target.y_m
    cos, sin = np.float32(math.cos(target.turn_rad)), np.float32(math.sin(target.turn_rad))
    a, d = across.astype(np.float32)[None, :], down.astype(np.float32)[:, None]
    u = (a * cos + d * sin) / np.float32(target.width_m) + np.float32(0.5)
    v = (d * cos - a * sin) / np.float32(target.height_m) + np.float32(0.5)
    if target.outline == "ellipse":
        inside = (u - 0.5) ** 2 + (v - 0.5) ** 2 <= 0.25
    else:
        inside = (u >= 0) & (u < 1) & (v >= 0) & (v < 1)
    cover = inside.astype(np.float32)
    first = cover * _pattern(target, u, v)
    size = (len(x) // part, len(y) // part)
    return (
        cv2.resize(cover, size, interpolation=cv2.INTER_AREA),
        cv2.resize(first, size, interpolation=cv2.INTER_AREA),
    )


def _pattern(target: Target, u: Light, v: Light) -> Light:
    """Return 1 where the first colour is."""
    n = target.pieces
    tall = max(1, round(n * target.height_m / target.width_m))
    across = np.clip(np.floor(u * n), 0, n - 1).astype(np.intp)
    down = np.clip(np.floor(v * tall), 0, tall - 1).astype(np.intp)
    if target.pattern == "bars":
        return (across % 2 == 0).astype(np.float32)
    if target.pattern == "checks":
        return ((across + down) % 2 == 0).astype(np.float32)
    if target.pattern == "blocks":
        chance = np.random.default_rng((595, target.seed))
        return chance.integers(0, 2, (tall, n)).astype(np.float32)[down, across]
    return np.ones_like(u)


def _moved(plane: Light, move_px: tuple[float, float], fine: int) -> Light:
    """Return what a shutter sees that stays open while the target moves."""
    length = math.hypot(*move_px) * fine
    if length < 0.5:
        return plane
    count = math.ceil(length) * 2 + 1
    total = np.zeros_like(plane)
    for share in np.linspace(-0.5, 0.5, count):
        shift = np.float32([[1, 0, share * move_px[0] * fine], [0, 1, share * move_px[1] * fine]])
        total += cv2.warpAffine(plane, shift, plane.shape[::-1], flags=cv2.INTER_LINEAR)
    return np.asarray(total / count, np.float32)


def _soften(plane: Light, radius_px: float, lens: Lens, fine: int) -> Light:
    """Blur by the disc, the Airy pattern and the lens's softness, on a grid of 1 / fine pixels."""
    if radius_px * fine > 0.5:
        plane = cv2.filter2D(plane, -1, _disc(radius_px * fine), borderType=cv2.BORDER_REPLICATE)
    airy_px = WAVELENGTH_UM * lens.f_number / lens.pixel_pitch_um  # lambda N
    if airy_px * fine > 0.5 and radius_px < 20 * airy_px:
        kernel = _airy(airy_px * fine)
        plane = cv2.filter2D(plane, -1, kernel, borderType=cv2.BORDER_REPLICATE)
    sigma = lens.softness_px * fine
    if sigma > 0.2:
        plane = cv2.GaussianBlur(plane, (0, 0), sigma, borderType=cv2.BORDER_REPLICATE)
    return np.asarray(plane, np.float32)


@cache
def _disc(radius: float) -> Light:
    """Return a uniform disc, each point the part of it that is inside."""
    half = math.ceil(radius + 0.5)
    part = 16 if radius < 30 else 8
    at = (np.arange((2 * half + 1) * part) + 0.5) / part - half - 0.5
    inside = (at[:, None] ** 2 + at[None, :] ** 2 <= radius**2).astype(np.float32)
    kernel = cv2.resize(inside, (2 * half + 1, 2 * half + 1), interpolation=cv2.INTER_AREA)
    return np.asarray(kernel / kernel.sum(), np.float32)


@cache
def _airy(scale: float) -> Light:
    """Return (2 J1(w) / w)^2, w = pi distance / (lambda N), out to its fifth dark ring."""
    half = math.ceil(5.24 * scale)
    at = np.arange(-half, half + 1)
    w = np.maximum(np.pi * np.hypot(at[:, None], at[None, :]) / scale, 1e-6)
    kernel = (2 * j1(w) / w) ** 2
    return np.asarray(kernel / kernel.sum(), np.float32)


def _develop(light: Light, scene: Scene, lens: Lens, seed: int) -> npt.NDArray[np.uint8]:
    """Return what sensor, converter, mosaic and tone curve make of reflected light."""
    luminance = scene.illuminance_lux / math.pi
    # Eq. 15, with the saturation of ISO 12232: a pixel is full at 78 N^2 / (0.65 t ISO) cd/m^2.
    full = 78.0 * lens.f_number**2 / (0.65 * lens.exposure_time_s * lens.iso_speed)
    value = light * np.float32(luminance / full)
    electrons = ELECTRONS_PER_UM2 * lens.pixel_pitch_um**2 * 100.0 / lens.iso_speed
    chance = np.random.default_rng((12232, scene.seed, seed))
    variance = np.maximum(value, 0) / electrons + (READ_NOISE_ELECTRONS / electrons) ** 2
    value += np.sqrt(variance) * chance.standard_normal(value.shape, np.float32)
    top = (1 << CONVERTER_BITS) - 1
    raw = np.clip(np.rint(value * top), 0, top).astype(np.uint16)
    if lens.mosaic:
        raw = cv2.demosaicing(_bayer(raw), cv2.COLOR_BayerRG2BGR)
    return _tone_curve()[raw]


def _bayer(raw: npt.NDArray[np.uint16]) -> npt.NDArray[np.uint16]:
    """Return one colour for each pixel; OpenCV names the pattern by its second row and column."""
    mosaic = raw[..., 1].copy()
    mosaic[0::2, 0::2] = raw[0::2, 0::2, 0]
    mosaic[1::2, 1::2] = raw[1::2, 1::2, 2]
    return mosaic


@cache
def _tone_curve() -> npt.NDArray[np.uint8]:
    linear = np.arange(1 << CONVERTER_BITS) / ((1 << CONVERTER_BITS) - 1)
    return np.rint(linear_to_srgb(linear) * 255).astype(np.uint8)
