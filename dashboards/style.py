"""Colours of tracks, methods and states."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from pipeline.core.arrays import IntArray
from pipeline.estimate.methods import METHODS

Colours = npt.NDArray[np.uint8]

# The palette of Okabe and Ito (2008), which colour-blind readers tell apart. Black is left out: the
# panels are dark. White is kept for the truth, which no track may look like.
PALETTE: Colours = np.array(
    [
        [230, 159, 0],  # orange
        [86, 180, 233],  # sky blue
        [0, 158, 115],  # bluish green
        [240, 228, 66],  # yellow
        [0, 114, 178],  # blue
        [213, 94, 0],  # vermilion
        [204, 121, 167],  # reddish purple
    ],
    dtype=np.uint8,
)
TRUTH = (255, 255, 255)
NEUTRAL = (200, 200, 200)
# States that are not of one track: never told by colour alone, each has its text.
OK, WARNING, ERROR, DIM = (60, 110, 140), (230, 159, 0), (213, 94, 0), (70, 70, 70)

METHOD_COLOURS: dict[str, Colours] = {
    method.name: np.array(list(bytes.fromhex(method.colour[1:])), dtype=np.uint8)
    for method in METHODS
}
# What is brighter than this (relative luminance of WCAG 2.2) a white page swallows.
BRIGHT = 0.6

# rr.Measurements draws one standard deviation to either side; given a variance of (1.96 s)^2 it
# draws the 95 % interval. Whatever sends a variance uses this.
Z_95 = 1.96


def slot_colours(slot: IntArray) -> Colours:
    """Return the colour of each slot, (n, 3): the palette, then the palette in lighter tints."""
    both = np.concatenate([PALETTE, tinted(PALETTE, 0.5)])
    return np.asarray(both[slot % len(both)])


def tinted(colours: Colours, share: float = 0.55) -> Colours:
    """Return colours mixed with white, for text on dark ground."""
    return (255 - (255 - colours.astype(np.float64)) * (1 - share)).astype(np.uint8)


def on_white(colour: Colours) -> str:
    """Return a colour as #RRGGBB, darker where a white page would swallow it."""
    share = colour / 255
    linear = np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)
    bright = float(linear @ (0.2126, 0.7152, 0.0722)) > BRIGHT
    shown = (colour * 0.7).astype(np.uint8) if bright else colour
    return "#" + bytes(shown).hex().upper()


def packed(colours: Colours, opacity: int = 255) -> npt.NDArray[np.uint32]:
    """Return colours, (n, 3), as Rerun's 0xRRGGBBAA."""
    wide = colours.astype(np.uint32)
    rgb = (wide[:, 0] << 24) | (wide[:, 1] << 16) | (wide[:, 2] << 8)
    return np.asarray(rgb | np.uint32(opacity))
