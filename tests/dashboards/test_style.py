"""Colours can be told apart, also by colour-blind readers, and on the viewer's dark ground."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest

from dashboards.style import OK, PALETTE, TRUTH, WARNING, slot_colours
from dashboards.timeline.slots import SLOTS

GROUND = np.array([13, 16, 17])  # the viewer's dark theme
# Machado, Oliveira and Fernandes (2009), severity 1.0, on linear RGB.
VISION = {
    "normal": np.eye(3),
    "protanopia": np.array(
        [
            [0.152286, 1.052583, -0.204868],
            [0.114503, 0.786281, 0.099216],
            [-0.003882, -0.048116, 1.051998],
        ]
    ),
    "deuteranopia": np.array(
        [
            [0.367322, 0.860646, -0.227968],
            [0.280085, 0.672501, 0.047413],
            [-0.011820, 0.042940, 0.968881],
        ]
    ),
    "tritanopia": np.array(
        [
            [1.255528, -0.076749, -0.178779],
            [-0.078411, 0.930809, 0.147602],
            [0.004733, 0.691367, 0.303900],
        ]
    ),
}


def linear(colour: np.ndarray) -> np.ndarray:
    share = np.asarray(colour, dtype=float) / 255
    return np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)


def lab(rgb: np.ndarray) -> np.ndarray:
    """CIELAB of linear sRGB under D65."""
    xyz = np.array(
        [[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]]
    ) @ np.clip(rgb, 0, 1)
    f = np.cbrt(xyz / [0.9505, 1.0, 1.089])
    return np.array([116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])])


@pytest.mark.parametrize("vision", VISION)
def test_the_palette_can_be_told_apart(vision: str) -> None:
    seen = [lab(VISION[vision] @ linear(colour)) for colour in [*PALETTE, np.array(TRUTH)]]
    # 2.3 is a just noticeable difference; lines that lie beside each other need several of them.
    assert min(np.linalg.norm(a - b) for a, b in combinations(seen, 2)) > 10


def test_colours_stand_out_from_the_ground() -> None:
    def luminance(colour: np.ndarray) -> float:
        return float(linear(colour) @ [0.2126, 0.7152, 0.0722])

    for colour in [*slot_colours(np.arange(SLOTS)), np.array(WARNING), np.array(OK)]:
        contrast = (luminance(colour) + 0.05) / (luminance(GROUND) + 0.05)
        assert contrast >= 3  # WCAG 2.1, 1.4.11: graphics


def test_slots_have_a_colour_each() -> None:
    assert len({tuple(c) for c in slot_colours(np.arange(SLOTS)).tolist()}) == SLOTS
