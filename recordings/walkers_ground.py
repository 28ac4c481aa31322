"""The background of a scene: ground, a row of houses behind it, sky; painted once.

Every pixel's ray is followed to the ground or to the houses' wall, so texture recedes as it should.
Materials are noise in several sizes; sizes finer than a pixel fade out, as a lens averages them.
"""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt

from pipeline.optics.ground_plane import remove_roll
from recordings.walkers_body import Floats
from recordings.walkers_view import View

Image = npt.NDArray[np.uint8]

_TILE = 512
_GRAINS_M = (0.03, 0.12, 0.5, 2.5)  # of the noise
# blue, green, red; how strong each grain is
_MATERIALS = {
    "asphalt": ((98, 98, 96), (0.04, 0.015, 0.0075, 0.02)),
    "old asphalt": ((128, 130, 130), (0.035, 0.015, 0.01, 0.025)),
    "slabs": ((146, 152, 156), (0.02, 0.02, 0.02, 0.025)),
    "bricks": ((92, 104, 138), (0.035, 0.025, 0.02, 0.025)),
    "grass": ((58, 92, 84), (0.065, 0.05, 0.03, 0.03)),
    "gravel": ((122, 136, 144), (0.06, 0.025, 0.015, 0.02)),
}
_LAYOUTS = (
    ("slabs", "asphalt", "slabs"),
    ("grass", "old asphalt", "grass"),
    ("asphalt", "asphalt", "slabs"),
    ("bricks", "bricks", "grass"),
    ("slabs", "slabs", "bricks"),
    ("grass", "gravel", "grass"),
    ("old asphalt", "old asphalt", "old asphalt"),
)


def paint_background(view: View, seed: int) -> Image:
    """Return the empty scene without things, shadows and noise, (h, w, 3)."""
    random = np.random.default_rng(seed)
    columns, rows = np.meshgrid(np.arange(view.width_px), np.arange(view.height_px))
    pixels = np.stack([columns, rows], axis=-1).astype(float)
    x_m, y_m, depth_m = view.ground(pixels)
    behind_m = random.uniform(48.0, 75.0)
    on_ground = np.isfinite(depth_m) & (y_m < behind_m)
    image = np.empty((view.height_px, view.width_px, 3), np.float32)
    image[...] = _distance(view, pixels, behind_m, random)
    image[on_ground] = _ground(view, x_m, y_m, depth_m, random)[on_ground]
    return np.clip(image, 0, 255).astype(np.uint8)


def _ground(
    view: View, x_m: Floats, y_m: Floats, depth_m: Floats, random: np.random.Generator
) -> npt.NDArray[np.float32]:
    tiles = [_noise_tile(random) for _ in _GRAINS_M]
    x, y = np.nan_to_num(x_m), np.nan_to_num(y_m)
    per_px = np.nan_to_num(depth_m, nan=1e3) / view.intrinsics.fx_px
    # along the line of sight a pixel covers more ground than across it
    slant = np.clip(np.hypot(x, y) / view.plane.camera_height_m, 1, None)
    footprint_m = per_px * np.sqrt(slant)
    turn = random.normal(0, 0.3)
    u = x * np.cos(turn) + y * np.sin(turn)
    v = -x * np.sin(turn) + y * np.cos(turn)
    layout = _LAYOUTS[random.integers(len(_LAYOUTS))]
    seen = v[np.isfinite(depth_m) & (depth_m < 40)]
    first, last = np.quantile(seen, [0.02, 0.98])
    edges = np.sort(random.uniform(first, last, 2))
    out = np.zeros((*x.shape, 3), np.float32)
    for number, name in enumerate(layout):
        low = edges[number - 1] if number else -np.inf
        high = edges[number] if number < 2 else np.inf
        share = _step(v - low, footprint_m) * _step(high - v, footprint_m)
        out += share[..., None].astype(np.float32) * _material(name, u, v, footprint_m, tiles)
    for edge in edges:  # a kerb, or a painted line
        line = _step(0.07 - np.abs(v - edge), footprint_m)[..., None]
        out += (line * (np.float32(random.choice([80, 170, 200])) - out) * 0.7).astype(np.float32)
    if random.uniform() < 0.5:  # dashes, or the lines of parking bays
        middle = random.uniform(edges[0], edges[1])
        line = _step(0.06 - np.abs(v - middle), footprint_m)
        line = line * _step(0.9 - np.abs((u % 4.0) - 1.0), footprint_m)
        out += (line[..., None] * (210 - out) * 0.75).astype(np.float32)
    for _ in range(random.integers(3, 12)):  # patches and stains
        at, size = random.uniform(-25, 45, 2), random.uniform(0.3, 2.0, 2)
        spot = ((u - at[0]) / size[0]) ** 2 + ((v - at[1]) / size[1]) ** 2
        out *= (1 - 0.16 * _step(1 - spot, footprint_m * 2))[..., None].astype(np.float32)
    return out


def _material(
    name: str, u: Floats, v: Floats, footprint_m: Floats, tiles: list[npt.NDArray[np.float32]]
) -> npt.NDArray[np.float32]:
    colour, strengths = _MATERIALS[name]
    value = np.ones(u.shape, np.float32)
    for grain_m, strength, tile in zip(_GRAINS_M, strengths, tiles, strict=True):
        fade = np.clip(0.4 * grain_m / np.maximum(footprint_m, 1e-6), 0, 1).astype(np.float32)
        value += np.float32(strength) * fade * _sample(tile, u / grain_m, v / grain_m)
    if name in ("slabs", "bricks"):
        side = np.array([0.5, 0.5] if name == "slabs" else [0.21, 0.11])
        joint_m = 0.012
        shifted = u + (np.floor(v / side[1]) % 2) * side[0] / 2
        for place, length in ((shifted, side[0]), (v, side[1])):
            away = np.abs((place + length / 2) % length - length / 2)
            blur_m = np.maximum(footprint_m, 1e-3)
            dark = np.clip((joint_m + blur_m - away) / (2 * blur_m), 0, 1)
            dark *= np.clip(2 * joint_m / blur_m, 0, 1) * np.clip(length / (3 * blur_m), 0, 1)
            value *= (1 - 0.28 * dark).astype(np.float32)
        cell = np.sin(np.floor(shifted / side[0]) * 12.9898 + np.floor(v / side[1]) * 78.233)
        tone = (cell * 43758.5453) % 1.0 - 0.5
        value += (0.12 * tone * np.clip(side[0] / (2 * footprint_m + 1e-6), 0, 1)).astype(
            np.float32
        )
    return np.asarray(value[..., None] * np.array(colour, np.float32))


def _distance(
    view: View, pixels: Floats, behind_m: float, random: np.random.Generator
) -> npt.NDArray[np.float32]:
    """Return the houses, on a wall at a distance ahead, and the sky over them."""
    seen = remove_roll(view.camera.normalize(pixels), view.plane.roll_rad)
    tilt = view.plane.tilt_rad
    ahead = np.cos(tilt) - seen[..., 1] * np.sin(tilt)
    up = -(seen[..., 1] * np.cos(tilt) + np.sin(tilt))
    scale = behind_m / np.maximum(ahead, 1e-3)
    x = np.nan_to_num(seen[..., 0]) * scale
    z = view.plane.camera_height_m + np.nan_to_num(up) * scale
    blur_m = behind_m / view.intrinsics.fx_px
    out = np.empty((*x.shape, 3), np.float32)
    out[...] = np.array([224, 212, 200], np.float32)
    house_m, street = random.uniform(9, 22), int(random.integers(1 << 30))
    number = np.floor(x / house_m).astype(int)
    for n in np.unique(number):
        random_n = np.random.default_rng((street, abs(int(n)), int(n > 0)))
        mine = number == n
        wall = (
            np.array([120, 132, 146]) * random_n.uniform(0.55, 1.35) * random_n.normal(1, 0.06, 3)
        )
        high_m, floor_m = random_n.uniform(6, 16), random_n.uniform(2.9, 3.6)
        window = _step(0.55 - np.abs((x % 2.4) - 1.2), blur_m) * _step(
            0.7 - np.abs((z % floor_m) - 1.7), blur_m
        )
        face = wall * (1 - 0.55 * window[..., None])
        share = _step(high_m - z, blur_m)[..., None]
        out[mine] = (out * (1 - share) + face * share)[mine]
    grain = np.where(z < 17, 0.03, 0.008) * _sample(_noise_tile(random), x / 0.6, z / 0.6)
    return np.asarray(out * (1 + grain[..., None]), np.float32)


def _noise_tile(random: np.random.Generator) -> npt.NDArray[np.float32]:
    """Return smooth noise of deviation 1 that repeats without a seam."""
    rough = random.standard_normal((_TILE, _TILE)).astype(np.float32)
    tiled = cv2.GaussianBlur(np.tile(rough, (3, 3)), (0, 0), 1.0)
    smooth = tiled[_TILE : 2 * _TILE, _TILE : 2 * _TILE]
    return np.asarray(smooth / smooth.std(), np.float32)


def _sample(tile: npt.NDArray[np.float32], x: Floats, y: Floats) -> npt.NDArray[np.float32]:
    # noise has two samples a grain, so that it is not seen as squares
    at_x, at_y = ((2 * x) % _TILE).astype(np.float32), ((2 * y) % _TILE).astype(np.float32)
    return np.asarray(cv2.remap(tile, at_x, at_y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_WRAP))


def _step(inside_m: Floats, blur_m: Floats | float) -> Floats:
    """Return 1 inside, 0 outside, and a slope over a pixel between."""
    return np.asarray(np.clip(inside_m / np.maximum(blur_m, 1e-6) + 0.5, 0, 1))
