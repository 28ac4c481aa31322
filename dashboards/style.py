"""Colours, and which method stands for an observation."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from pipeline.records import IntArray, Method

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

# The best method comes first: an observation is drawn by the first that has a depth for it.
METHOD_ORDER = (
    Method.FUSED,
    Method.GROUND,
    Method.APERTURE,
    Method.INVERSE,
    Method.SIZE,
    Method.DEFOCUS,
)
METHOD_COLOURS = {str(method): PALETTE[i] for i, method in enumerate(METHOD_ORDER)}

# rr.Measurements draws one standard deviation to either side; given a variance of (1.96 s)^2 it
# draws the 95 % interval. Whatever sends a variance uses this.
Z_95 = 1.96


def track_colours(first: IntArray, last: IntArray) -> Colours:
    """Return a colour a track, (n, 3): those that are seen together differ, as far as colours last.

    Args:
        first: first frame of each track, (n,).
        last: last frame of each, (n,).
    """
    free_from = np.full(len(PALETTE), -1, dtype=np.int64)
    colours = np.empty((len(first), 3), dtype=np.uint8)
    for track in np.argsort(first, kind="stable"):
        chosen = int(np.argmin(free_from))  # the colour that has been unused for longest
        colours[track] = PALETTE[chosen]
        free_from[chosen] = max(free_from[chosen], last[track]) + 1
    return colours


def tinted(colours: Colours, share: float = 0.55) -> Colours:
    """Return colours mixed with white, for text on dark ground."""
    return (255 - (255 - colours.astype(np.float64)) * (1 - share)).astype(np.uint8)


def packed(colours: Colours) -> npt.NDArray[np.uint32]:
    """Return opaque colours, (n, 3), as Rerun's 0xRRGGBBAA."""
    wide = colours.astype(np.uint32)
    rgb = (wide[:, 0] << 24) | (wide[:, 1] << 16) | (wide[:, 2] << 8)
    return np.asarray(rgb | np.uint32(255))
