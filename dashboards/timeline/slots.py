"""Slots: a few lines of a plot that many tracks share, one after another.

Whoever is in the picture at the same time is in different slots; a slot is a line in the plots, a
lane and a colour. So an hour with thousands of tracks has as many of them as a minute with ten, and
every track has its curve.
"""

from __future__ import annotations

from collections import defaultdict

import numpy as np
import numpy.typing as npt

from pipeline.core.arrays import IntArray

# As many as there are colours to tell apart: the palette and its lighter tints.
SLOTS = 14
# A line is drawn across a gap of so many frames; a longer one breaks it.
LONGEST_GAP_FRAMES = 8
NAMES_SHOWN = 6


def slots(first: IntArray, last: IntArray, alone: npt.NDArray[np.bool_] | None = None) -> IntArray:
    """Return a slot for each track, (n,); -1 for those that find none free.

    Args:
        first: first frame of each track, (n,).
        last: last frame of each, (n,).
        alone: which share their slot with no other, (n,).
    """
    free_from = np.full(SLOTS, -1, dtype=np.int64)
    taken = np.full(len(first), -1, dtype=np.int64)
    if alone is not None:
        ours = np.flatnonzero(alone)[:SLOTS]
        taken[ours] = np.arange(len(ours))
        free_from[: len(ours)] = np.iinfo(np.int64).max
    for track in np.lexsort(
        (first - last, first)
    ).tolist():  # of those that begin together, long first
        if taken[track] >= 0:
            continue
        slot = int(np.argmin(free_from))  # the one that has been unused for longest
        if free_from[slot] <= first[track]:
            taken[track] = slot
            free_from[slot] = last[track] + 2  # a frame between, so that lines do not touch
    return taken


def slot_names(slot: IntArray, names: list[str]) -> list[str]:
    """Return the name of each slot: those of its tracks, the first few."""
    members: dict[int, list[str]] = defaultdict(list)
    for number, name in zip(slot.tolist(), names, strict=True):
        members[number].append(name)
    titles = []
    for number in range(int(slot.max(initial=-1)) + 1):
        named = members[number]
        more = f" and {len(named) - NAMES_SHOWN} more" if len(named) > NAMES_SHOWN else ""
        titles.append(", ".join(named[:NAMES_SHOWN]) + more)
    return titles
