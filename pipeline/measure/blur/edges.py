"""Straight edges of an object and the light across them, at the size of picture that suits the blur.

A blur of one pixel and one of fifty are measured alike: the picture is halved until an edge is a few
pixels wide. Halving by the mean of two by two pixels is a convolution, whose variance is known.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from pipeline.core.arrays import FloatArray
from pipeline.images.decode import Image, luminance_tables

Plane = npt.NDArray[np.float32]

# How far a profile reaches to either side, in pixels of its level: three times the widest blur that a
# level is asked for.
REACH_PX = 8
# A profile is the mean over this many pixels to either side along the edge: the noise of one row is
# halved, and a circle of 20 pixels' radius departs from its tangent by a tenth of one.
ALONG_PX = 2
# The narrowest object at a level: an edge needs its reach on the object's side of it.
MIN_SIDE_PX = 8
MAX_LEVELS = 6
# At most one edge is taken from each cell of this many pixels, and so many from a level.
CELL_PX = 4
MAX_EDGES = 200
# How much stronger than noise a gradient must be. Of 1e5 pixels of noise, one reaches 4.5.
MIN_GRADIENT_TO_NOISE = 5.0
# The slope of the widest edge of the least contrast that `spread.py` takes, after a blur of one pixel:
# 0.2 / (sqrt(2 pi) 2.7).
MIN_GRADIENT_OF_SPAN = 0.03
# A gradient along one direction only: 1 on a straight edge, about a half on a corner.
MIN_COHERENCE = 0.9
# Values of a channel at which a sensor or a tone curve has nothing more to say.
CLIPPED_LOW, CLIPPED_HIGH = 1, 253


@dataclass(frozen=True, slots=True)
class Edges:
    """Edges of one level: places in pixels of the stored picture, profiles in linear light."""

    level: int  # pixels are 2^level stored ones wide
    at_px: FloatArray  # (n, 2)
    normal: FloatArray  # (n, 2), towards the light
    profile: FloatArray  # (n, 2 * REACH_PX + 1), along the normal, a level's pixel apart
    noise: float  # standard deviation of a profile's values by chance
    span: float  # of light in and about the box


def edges_of(
    bgr: Image, box: FloatArray, covers: FloatArray, origin: FloatArray
) -> Iterator[Edges]:
    """Yield the edges of the object in a box, level by level, from the stored size upwards.

    Args:
        bgr: a part of the stored picture around the box.
        box: (4,) outer edges in pixels of the stored picture.
        covers: (k, 4) boxes of what is in front of it; edges near them may be theirs.
        origin: (2,) the place of the part's first pixel in the stored picture.
    """
    tables = luminance_tables().astype(np.float32)
    light = cv2.transform(cv2.LUT(bgr, tables[None]), np.ones((1, 3), np.float32))
    brightest = cv2.max(cv2.max(bgr[..., 0], bgr[..., 1]), bgr[..., 2])
    inside = cv2.inRange(brightest, CLIPPED_LOW + 1, CLIPPED_HIGH - 1)
    clipped = np.float32(1) - inside * np.float32(1 / 255)
    side = float(min(box[2] - box[0], box[3] - box[1]))
    span = _span(light, box - np.tile(origin, 2))
    for level in range(MAX_LEVELS):
        if level:
            size = (light.shape[1] // 2, light.shape[0] // 2)
            if min(size) < 2 * REACH_PX + 4 or side / 2**level < MIN_SIDE_PX:
                return
            even = (slice(0, 2 * size[1]), slice(0, 2 * size[0]))
            light = cv2.resize(light[even], size, interpolation=cv2.INTER_AREA)
            clipped = cv2.resize(clipped[even], size, interpolation=cv2.INTER_AREA)
        if min(light.shape) >= 2 * REACH_PX + 4:
            yield _edges_at(level, light, clipped, box, covers, origin, span)


def _edges_at(
    level: int,
    light: Plane,
    clipped: Plane,
    box: FloatArray,
    covers: FloatArray,
    origin: FloatArray,
    span: float,
) -> Edges:
    scale = 2.0**level
    noise = _noise(light)
    # The derivative of a Gaussian of one pixel: its noise is that of the picture / (2 sqrt(2 pi)).
    soft = cv2.GaussianBlur(light, (0, 0), 1.0)
    gx = cv2.Sobel(soft, cv2.CV_32F, 1, 0, ksize=1, scale=0.5)
    gy = cv2.Sobel(soft, cv2.CV_32F, 0, 1, ksize=1, scale=0.5)
    strength = np.sqrt(gx * gx + gy * gy)
    least = max(MIN_GRADIENT_TO_NOISE * 0.2 * noise, MIN_GRADIENT_OF_SPAN * span)
    x, y = _places(strength, gx, gy, least)
    at = np.stack([x, y], axis=1).astype(np.float64)
    stored = origin - 0.5 + (at + 0.5) * scale
    own = np.flatnonzero(_of_object(stored, box, covers, scale) & _within(at, light.shape))
    own = own[:: 1 + len(own) // MAX_EDGES]
    x, y, at, stored = x[own], y[own], at[own], stored[own]
    normal, coherence = _direction(gx, gy, x, y)
    profile, clip = _profiles(light, clipped, at, normal)
    keep = (coherence > MIN_COHERENCE) & (clip < 0.02)
    by_chance = noise / np.sqrt(2 * ALONG_PX + 1)
    return Edges(level, stored[keep], normal[keep], profile[keep], float(by_chance), span)


def _span(light: Plane, box: FloatArray) -> float:
    """Return how far the light reaches in a box and a tenth of it around, but for its extremes."""
    dx, dy = 0.1 * (box[2] - box[0]), 0.1 * (box[3] - box[1])
    x0, y0, x1, y1 = np.rint(box + np.array([-dx, -dy, dx, dy])).astype(int)
    step = max(1, round(min(x1 - x0, y1 - y0) / 64))
    part = light[max(y0, 0) : y1 : step, max(x0, 0) : x1 : step]
    low, high = np.percentile(part, [3, 97]) if part.size else (0.0, 0.0)
    return float(high - low)


def _noise(light: Plane) -> float:
    """Return the noise of a picture from what no smooth picture has (Immerkaer 1996), by the median."""
    kernel = np.array([[1, -2, 1], [-2, 4, -2], [1, -2, 1]], np.float32) / 6
    step = 1 + light.size // 65536
    rough = np.abs(cv2.filter2D(light, -1, kernel).ravel()[::step])
    return max(float(np.median(rough)) / 0.6745, 1e-6)


def _places(
    strength: Plane, gx: Plane, gy: Plane, least: float
) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.intp]]:
    """Return where a gradient is the strongest across its edge and in its cell."""
    height, width = strength.shape
    height, width = height - height % CELL_PX, width - width % CELL_PX
    strong = strength[:height, :width]
    cells = strong.reshape(height // CELL_PX, CELL_PX, width // CELL_PX, CELL_PX)
    flat = cells.transpose(0, 2, 1, 3).reshape(-1, CELL_PX * CELL_PX)
    best = flat.argmax(axis=1)
    rows, columns = np.divmod(np.arange(len(flat)), width // CELL_PX)
    y, x = rows * CELL_PX + best // CELL_PX, columns * CELL_PX + best % CELL_PX
    inside = (x > 0) & (y > 0) & (x < width - 1) & (y < height - 1) & (strong[y, x] > least)
    x, y = x[inside], y[inside]
    # The strongest of its cell need not be the crest of its edge: that is higher than both sides.
    length = np.maximum(strength[y, x], 1e-12)
    sx = np.rint(gx[y, x] / length).astype(np.intp)
    sy = np.rint(gy[y, x] / length).astype(np.intp)
    crest = (strength[y, x] >= strength[y + sy, x + sx]) & (
        strength[y, x] >= strength[y - sy, x - sx]
    )
    x, y = x[crest], y[crest]
    return x, y


def _of_object(at: FloatArray, box: FloatArray, covers: FloatArray, scale: float) -> np.ndarray:
    """Return which places belong to the box: inside it or on its outline, and not at what covers it."""
    slack = 1.5 * scale + 1.0
    x, y = at.T
    keep = (x > box[0] - slack) & (x < box[2] + slack) & (y > box[1] - slack) & (y < box[3] + slack)
    for x0, y0, x1, y1 in covers:
        keep &= ~((x > x0 - slack) & (x < x1 + slack) & (y > y0 - slack) & (y < y1 + slack))
    return np.asarray(keep)


def _within(at: FloatArray, shape: tuple[int, ...]) -> np.ndarray:
    border = REACH_PX + ALONG_PX
    x, y = at.T
    return np.asarray(
        (x >= border) & (y >= border) & (x < shape[1] - border) & (y < shape[0] - border)
    )


def _direction(
    gx: Plane, gy: Plane, x: npt.NDArray[np.intp], y: npt.NDArray[np.intp]
) -> tuple[FloatArray, FloatArray]:
    """Return the edges' normals by the structure tensor, (n, 2), and its coherence, (n,)."""
    xx, yy, xy = (cv2.GaussianBlur(a * b, (0, 0), 1.5) for a, b in ((gx, gx), (gy, gy), (gx, gy)))
    xx, yy, xy = (a[y, x].astype(np.float64) for a in (xx, yy, xy))
    angle = 0.5 * np.arctan2(2 * xy, xx - yy)
    spread = np.hypot(xx - yy, 2 * xy)
    normal = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    uphill = normal[:, 0] * gx[y, x] + normal[:, 1] * gy[y, x]
    normal *= np.where(uphill < 0, -1.0, 1.0)[:, None]
    return normal, spread / np.maximum(xx + yy, 1e-30)


def _profiles(
    light: Plane, clipped: Plane, at: FloatArray, normal: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the light across each edge, and how much of what it passes is clipped."""
    if not len(at):
        return np.empty((0, 2 * REACH_PX + 1)), np.empty(0)
    t = np.arange(-REACH_PX, REACH_PX + 1.0)[None, :, None]
    s = np.arange(-ALONG_PX, ALONG_PX + 1.0)[None, None, :]
    nx, ny = normal[:, 0, None, None], normal[:, 1, None, None]
    x = (at[:, 0, None, None] + t * nx - s * ny).astype(np.float32)
    y = (at[:, 1, None, None] + t * ny + s * nx).astype(np.float32)
    shape = x.shape
    # OpenCV maps at most 32767 rows; a row an edge is far below.
    x, y = x.reshape(shape[0], -1), y.reshape(shape[0], -1)
    values = cv2.remap(light, x, y, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)
    clip = cv2.remap(clipped, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    profile = values.reshape(shape).mean(axis=2, dtype=np.float64)
    return profile, clip.mean(axis=1, dtype=np.float64)
