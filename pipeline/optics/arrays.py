"""Conventions of all functions of the optics: float64 arrays, and no warnings about unknowns."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
ArrayLike = npt.ArrayLike

# A decorator. Unknown is NaN here, so what arithmetic says of NaN, zero and infinity is no news.
quiet = np.errstate(all="ignore")


def floats(value: ArrayLike) -> Floats:
    """Return an array of float64."""
    return np.asarray(value, dtype=np.float64)


def positive(value: ArrayLike) -> Floats:
    """Return what is positive; the rest, which no lens or exposure can have, as NaN."""
    array = floats(value)
    return np.where(array > 0, array, np.nan)
