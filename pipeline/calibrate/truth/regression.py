"""Linear fits with standard errors, robust if asked, and their errors out of sample."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pipeline.core.arrays import FloatArray, IntArray
from pipeline.core.robust import MAD_TO_STD

Rows = npt.NDArray[np.bool_]
# Fits to a mask of rows, and gives what predicts a mask of rows.
Fitter = Callable[[Rows], Callable[[Rows], FloatArray]]

# Tukey's bisquare: 95 % efficient for normal errors, no weight beyond 4.685 scales.
BISQUARE = 4.685
_ITERATIONS = 200
_CONVERGED = 1e-12


@dataclass(frozen=True, slots=True)
class Fit:
    """Coefficients of y = X b with their covariance, and the spread about the fit."""

    coefficients: FloatArray  # (p,)
    covariance: FloatArray  # (p, p); NaN without degrees of freedom
    residual_std: float  # of sqrt(weight) (y - X b); the robust scale of a robust fit
    freedom: int  # n - p

    @property
    def std_errors(self) -> FloatArray:
        """Standard errors of the coefficients, (p,)."""
        return np.asarray(np.sqrt(np.diag(self.covariance)))


def fit_linear(
    design: FloatArray,
    y: FloatArray,
    weights: FloatArray | None = None,
    *,
    robust: bool = False,
    groups: IntArray | None = None,
) -> Fit:
    """Return the least-squares or bisquare fit of y = X b.

    With groups, rows of one group may share their error (frames of one object), and the covariance
    is that of cluster sums (Liang and Zeger 1986, with G / (G - 1) (n - 1) / (n - p)). It needs
    more groups than coefficients, else the rows count as independent. The robust covariance of
    single rows is Huber's (Robust Statistics, 1981, Eq. 7.6.3).

    Args:
        design: X, (n, p), of full column rank.
        y: (n,).
        weights: (n,), in inverse proportion to the variances.
        robust: bisquare by iterated reweighting from the least-squares fit.
        groups: (n,), equal where rows belong together.

    Raises:
        ValueError: fewer rows than coefficients, or columns that depend on each other.
    """
    root = np.ones(len(y)) if weights is None else np.sqrt(weights)
    x: FloatArray = np.asarray(design * root[:, None], dtype=np.float64)
    target: FloatArray = np.asarray(y * root, dtype=np.float64)
    n, p = x.shape
    if n < p or np.linalg.matrix_rank(x) < p:
        raise ValueError(f"{n} rows do not determine {p} coefficients")
    b: FloatArray = np.asarray(np.linalg.lstsq(x, target, rcond=None)[0], dtype=np.float64)
    freedom = n - p
    residual = target - x @ b
    scale = float(np.sqrt(residual @ residual / freedom)) if freedom else np.nan
    if robust and freedom:
        b, scale = _bisquare(x, target, b)
        residual = target - x @ b
    if freedom == 0:
        return Fit(b, np.full((p, p), np.nan), np.nan, 0)
    if scale == 0:
        return Fit(b, np.zeros((p, p)), 0.0, freedom)
    psi, slope = _psi(residual / scale) if robust else (residual / scale, None)
    if groups is not None and p < len(np.unique(groups)) < n:
        covariance = _clustered(x, psi * scale, slope, groups)
    else:
        covariance = _independent(x, psi, slope, scale)
    return Fit(b, covariance, scale, freedom)


def _bisquare(x: FloatArray, y: FloatArray, b: FloatArray) -> tuple[FloatArray, float]:
    """Return the bisquare coefficients and the scale, the residuals' median deviation from zero."""
    for _ in range(_ITERATIONS):
        residual = y - x @ b
        scale = MAD_TO_STD * float(np.median(np.abs(residual)))
        if scale <= _CONVERGED * float(np.abs(y).max(initial=0.0)):
            return b, 0.0
        u = residual / (BISQUARE * scale)
        root = np.where(np.abs(u) < 1, 1 - u**2, 0.0)  # the square root of the weight
        step = np.linalg.lstsq(x * root[:, None], y * root, rcond=None)[0] - b
        b = b + step
        if np.abs(step).max() <= _CONVERGED * np.abs(b).max():
            break
    return b, MAD_TO_STD * float(np.median(np.abs(y - x @ b)))


def _psi(r: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the bisquare's influence function and its derivative at standardised residuals."""
    u2 = (r / BISQUARE) ** 2
    inside = u2 < 1
    return (
        np.where(inside, r * (1 - u2) ** 2, 0.0),
        np.where(inside, (1 - u2) * (1 - 5 * u2), 0.0),
    )


def _independent(
    x: FloatArray, psi: FloatArray, slope: FloatArray | None, scale: float
) -> FloatArray:
    n, p = x.shape
    inverse = np.linalg.inv(x.T @ x)
    variance = scale**2 * float(psi @ psi) / (n - p)
    if slope is None:
        return np.asarray(inverse * variance)
    mean = float(slope.mean())
    correction = 1 + p / n * float(slope.var()) / mean**2
    return np.asarray(inverse * variance * correction**2 / mean**2)


def _clustered(
    x: FloatArray, score: FloatArray, slope: FloatArray | None, groups: IntArray
) -> FloatArray:
    n, p = x.shape
    _, index = np.unique(groups, return_inverse=True)
    count = int(index.max()) + 1
    sums = np.zeros((count, p))
    np.add.at(sums, index, x * score[:, None])
    bread = np.linalg.inv((x if slope is None else x * slope[:, None]).T @ x)
    correction = count / (count - 1) * (n - 1) / (n - p)
    return np.asarray(correction * bread @ (sums.T @ sums) @ bread)


def rmse(error: FloatArray) -> float:
    """Return the root of the mean square of what is known; NaN of nothing."""
    known = error[np.isfinite(error)]
    return float(np.sqrt(np.mean(known**2))) if len(known) else float("nan")


def held_out(fitter: Fitter, folds: IntArray) -> FloatArray:
    """Return the prediction of every row by a fit to the rows of the other folds, (n,).

    NaN where a fit is not determined without the fold.
    """
    out = np.full(len(folds), np.nan)
    for fold in np.unique(folds):
        left = folds == fold
        try:
            out[left] = fitter(~left)(left)
        except ValueError:
            continue
    return out


def leave_one_out(groups: IntArray, limit: int = 1000) -> IntArray:
    """Return folds of one group each; of one row each where all rows are one group.

    Beyond `limit` groups several share a fold: a thousandth left out is as good as one of many.
    """
    folds = np.unique(groups, return_inverse=True)[1].astype(np.int64)
    if len(folds) == 0 or folds.max() == 0:
        folds = np.arange(len(groups))
    return folds % limit


def k_folds(groups: IntArray, folds: int, seed: int) -> IntArray:
    """Return seeded folds of about equal numbers of groups, groups kept together."""
    single = leave_one_out(groups, limit=max(len(groups), 1))
    count = int(single.max()) + 1 if len(single) else 0
    order = np.random.default_rng(seed).permutation(count)
    return np.asarray((order % folds)[single], dtype=np.int64)
