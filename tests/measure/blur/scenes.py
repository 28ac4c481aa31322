"""Edges drawn for the blur estimator: steps behind discs, without the simulator of the recordings."""

from __future__ import annotations

import numpy as np

from pipeline.core.lens import Lens
from pipeline.core.records import Boxes
from pipeline.optics.defocus import edge_spread
from pipeline.optics.exposure import linear_to_srgb

FAST = Lens(1.8, 50.0, np.inf, 20.0, 20.0)  # blurs by 1.25 mm per dioptre: 35 px at a metre
SURVEILLANCE = Lens(2.0, 4.0, np.inf, 2.9, 2.9)
BOX = np.array([80.0, 70.0, 220.0, 230.0])


def square(
    sigma_px: float,
    *,
    floor_px: float = 0.6,
    box: np.ndarray = BOX,
    size: tuple[int, int] = (300, 300),
    light: float = 0.6,
    dark: float = 0.1,
    noise: float = 0.0,
    sideways_px: float | None = None,
    turn: float = 0.1,
) -> np.ndarray:
    """Return a square as wide as a box, turned, whose edges have a spread, as a BGR picture."""
    wide = sideways_px or sigma_px
    share = [max(0.0, 1 - (floor_px / s) ** 2) for s in (wide, sigma_px)]
    y, x = np.mgrid[: size[1], : size[0]].astype(float)
    u, v = x - (box[0] + box[2]) / 2, y - (box[1] + box[3]) / 2
    u, v = u * np.cos(turn) + v * np.sin(turn), v * np.cos(turn) - u * np.sin(turn)
    half_u = (box[2] - box[0]) / 2 / (np.cos(turn) + np.sin(turn))
    half_v = (box[3] - box[1]) / 2 / (np.cos(turn) + np.sin(turn))
    across = edge_spread((half_u - np.abs(u)) / wide, share[0])
    down = edge_spread((half_v - np.abs(v)) / sigma_px, share[1])
    value = dark + (light - dark) * across * down
    value += np.random.default_rng(5).normal(0, noise, value.shape) if noise else 0.0
    grey = np.rint(255 * linear_to_srgb(np.clip(value, 0, 1))).astype(np.uint8)
    return np.repeat(grey[..., None], 3, axis=2)


def boxes(*rows: np.ndarray, name: str = "board") -> Boxes:
    """Return boxes of one class."""
    n = len(rows)
    return Boxes(
        np.array(rows).reshape(-1, 4), np.ones(n), (name,) * n, np.ones((n, 4)), (None,) * n
    )
