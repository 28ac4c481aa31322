"""Models of the lens and of the crop that might explain the rest of the paper's errors, each fitted.

All give depth_m from the size on the sensor o_mm, the f-number n and coefficients b; f = 50 mm. W is
the object's size in metres where it is the first coefficient.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.optimize import least_squares

Floats = npt.NDArray[np.float64]
F_MM = 50.0
F_M = F_MM * 1e-3


@dataclass(frozen=True, slots=True)
class LensModel:
    """A model of depth, with where its coefficients start."""

    name: str
    formula: str
    depth_m: Callable[[Floats, Floats, Floats], Floats]  # (b, o_mm, n)
    start: tuple[float, ...]

    def fit(self, o_mm: Floats, n: Floats, depth_m: Floats) -> Floats:
        """Return the coefficients that make the relative errors of depth least."""
        found = least_squares(
            lambda b: self.depth_m(b, o_mm, n) / depth_m - 1,
            self.start,
            x_scale="jac",
            **dict.fromkeys(("ftol", "xtol", "gtol"), 1e-12),
        )
        return np.asarray(found.x)

    def held_out(self, o_mm: Floats, n: Floats, depth_m: Floats, folds: Floats) -> Floats:
        """Return every depth by the model fitted to the other folds."""
        out = np.empty(len(depth_m))
        for fold in np.unique(folds):
            left = folds == fold
            b = self.fit(o_mm[~left], n[~left], depth_m[~left])
            out[left] = self.depth_m(b, o_mm[left], n[left])
        return out


ONE_SIZE = LensModel(
    "one size W, focus at infinity", "d = f W / o", lambda b, o, n: F_MM * b[0] / o, (0.06,)
)
MODELS = (
    ONE_SIZE,
    LensModel(
        "autofocus: v = f d / (d - f)",
        "d = f + f W / o",
        lambda b, o, n: F_M + F_MM * b[0] / o,
        (0.06,),
    ),
    LensModel(
        "principal plane offset c",
        "d = c + f W / o",
        lambda b, o, n: b[1] + F_MM * b[0] / o,
        (0.06, 0.0),
    ),
    LensModel(
        "focus breathing: v = f (1 + c / d)",
        "d = (x + sqrt(x^2 + 4 c x)) / 2, x = f W / o",
        lambda b, o, n: _breathing(F_MM * b[0] / o, b[1]),
        (0.06, 0.0),
    ),
    LensModel(
        "autofocus, crop wider than the staff by c",
        "d = f + f W / (o - c)",
        lambda b, o, n: F_M + F_MM * b[0] / (o - b[1]),
        (0.06, 0.0),
    ),
    LensModel(
        "crop wider than the staff by c",
        "d = f W / (o - c)",
        lambda b, o, n: F_MM * b[0] / (o - b[1]),
        (0.06, 0.0),
    ),
    LensModel(
        "blur widens the crop: by c / N",
        "d = f W / (o - c / N)",
        lambda b, o, n: F_MM * b[0] / (o - b[1] / n),
        (0.06, 0.0),
    ),
    LensModel(
        "size drifts with the aperture",
        "d = f W N^p / o",
        lambda b, o, n: F_MM * b[0] * n ** b[1] / o,
        (0.06, 0.0),
    ),
    LensModel(
        "power of the size",
        "d = b / o^p",
        lambda b, o, n: b[0] / o ** b[1],
        (3.0, 1.0),
    ),
    LensModel(
        "offset and blur",
        "d = c + f W / (o - e / N)",
        lambda b, o, n: b[1] + F_MM * b[0] / (o - b[2] / n),
        (0.06, 0.0, 0.0),
    ),
)


def _breathing(x_m: Floats, c_m: float) -> Floats:
    """Solve d = v W / o with v = f (1 + c / d): d^2 - x d - c x = 0, x = f W / o."""
    return np.asarray((x_m + np.sqrt(np.maximum(x_m**2 + 4 * c_m * x_m, 0.0))) / 2)
