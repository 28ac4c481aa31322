"""Calibrations, which turn a size in the picture into a depth."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from pipeline.core.arrays import NAN, FloatArray


class CalibratedMethod(StrEnum):
    """Methods that a calibration can be for; the table of all methods is `pipeline.estimate.methods`."""

    APERTURE = "aperture"
    SIZE = "size"
    INVERSE = "inverse"

    def __repr__(self) -> str:
        """Return the text that `calibration_id` was made of in databases of earlier versions."""
        return f"<Method.{self.name}: {self.value!r}>"


class Dimension(StrEnum):
    """Side of the box that a size or a calibration speaks of."""

    WIDTH = "width"
    HEIGHT = "height"


@dataclass(frozen=True, slots=True)
class Parameter:
    """One fitted number; `f_number` where it holds for one aperture only (the paper's k)."""

    name: str
    value: float
    std_error: float = NAN
    f_number: float = NAN


@dataclass(frozen=True, slots=True)
class Calibration:
    """Numbers that turn a size in the picture into a depth, for one camera, class and dimension.

    A calibration of the paper's kind is an object size in disguise (k = O / (10 a_R), with O the size),
    so it belongs to what it was made on. Empty `camera` means any camera.

    Parameters by method: `aperture` has one `k` an f-number (Eq. 16); `inverse` has `b0_m` and
    `b1_m_mm` (Eq. 17: depth = b0 + b1 / size on the sensor); `size` has `object_size_m`.
    """

    method: CalibratedMethod
    object_class: str
    dimension: Dimension
    parameters: tuple[Parameter, ...]
    camera: str = ""
    residual_std_m: float = NAN  # spread of depth about the fit
    observation_count: int = 0
    depth_min_m: float = NAN  # the range in which it was fitted
    depth_max_m: float = NAN
    fit_rmse_m: float = NAN
    loo_rmse_m: float = NAN
    kfold_rmse_m: float = NAN
    source: str = ""

    @property
    def calibration_id(self) -> str:
        """Return a name that changes when any number of the calibration changes."""
        return hashlib.sha256(repr(self).encode()).hexdigest()[:12]

    def value(self, name: str) -> float:
        """Return a parameter that does not depend on the aperture; NaN if there is none."""
        return next((p.value for p in self.parameters if p.name == name), NAN)

    def std_error(self, name: str) -> float:
        """Return the standard error of a parameter that does not depend on the aperture."""
        return next((p.std_error for p in self.parameters if p.name == name), NAN)

    def by_f_number(self, name: str) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return f-numbers, values and standard errors, (n,) each, by rising f-number."""
        rows = sorted((p.f_number, p.value, p.std_error) for p in self.parameters if p.name == name)
        table = np.array(rows, dtype=np.float64).reshape(-1, 3)
        return table[:, 0], table[:, 1], table[:, 2]
