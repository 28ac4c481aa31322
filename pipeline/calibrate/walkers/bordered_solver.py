"""Least squares of few unknowns that all residuals share, and one of each person that only theirs do.

A person's own unknown, their stature, takes from their residuals what lies along its slopes. With the
shared slopes projected across those, statures are eliminated (Schur's complement): what is left is least
squares of eight unknowns, and to leave somebody out is to leave out their rows.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.optimize import OptimizeResult
from scipy.sparse import csr_matrix

from pipeline.calibrate.walkers.model import PEOPLE, Sample
from pipeline.core.arrays import FloatArray
from pipeline.optics.arrays import quiet

ROBUST = 1.5  # deviations beyond which a residual counts less than its square, by `soft_l1`
# Of the cost, relative: of a hundred residuals, 50, that is a hundredth of a standard error.
SAME_COST = 1e-6
MAX_STEPS = 50
FIRST_DAMPING, MAX_DAMPING = 1e-4, 1e6  # of the squares of the slopes
WORSE, BETTER = 4.0, 1 / 16  # what damping is multiplied by after a step
AHEAD = 0.1  # of a step, where its bend is looked for


@dataclass(frozen=True, slots=True)
class Bordered:
    """A Jacobian of `walkers_model`, with or without a focal length as the last unknown."""

    whole: FloatArray  # (n, k) the shared slopes: those of the pose, and of the focal length
    own: FloatArray  # (m,) the slopes of the first rows, which are somebody's, by their stature
    person: npt.NDArray[np.intp]  # (m,)
    sharp: FloatArray  # (p,) the sum of squares of `own`
    shared: FloatArray  # (n, k) `whole` across the slopes of statures

    @classmethod
    def of(
        cls,
        jacobian: csr_matrix | FloatArray,
        sample: Sample,
        per_row: FloatArray | None = None,
    ) -> Bordered:
        """Return it by a Jacobian whose first rows are those of the heads, then of the statures.

        `per_row`, (n,), scales it.
        """
        dense = jacobian.toarray() if hasattr(jacobian, "toarray") else np.asarray(jacobian)
        if per_row is not None:
            dense = dense * per_row[:, None]
        people = sample.people
        person = np.concatenate([sample.track, np.arange(people)])
        own = dense[np.arange(len(person)), PEOPLE + person]
        whole = np.delete(dense, slice(PEOPLE, PEOPLE + people), axis=1)
        sharp = by_person(own**2, person, people)
        along = by_person(whole[: len(own)] * own[:, None], person, people) / sharp[:, None]
        shared = whole.copy()
        shared[: len(own)] -= own[:, None] * along[person]
        return cls(whole, own, person, sharp, shared)

    def step(self, off: FloatArray, damping: float) -> FloatArray:
        """Return the step of all unknowns against residuals.

        Damping adds so many times their diagonal to the normal equations; statures that are held so
        take less from the others.
        """
        held = damping / (1.0 + damping)
        free, all_in = self.shared.T @ self.shared, self.whole.T @ self.whole
        square = free + held * (all_in - free) + damping * np.diag(np.diag(all_in))
        pull, all_pull = self.shared.T @ off, self.whole.T @ off
        step = -inverse_of(square) @ (pull + held * (all_pull - pull))
        rows = len(self.own)
        left = off[:rows] + self.whole[:rows] @ step
        along = by_person(self.own * left, self.person, len(self.sharp))
        follow = -along / (self.sharp * (1.0 + damping))
        return np.concatenate([step[:PEOPLE], follow, step[PEOPLE:]])


def by_person(values: FloatArray, person: npt.NDArray[np.intp], people: int) -> FloatArray:
    """Return the sums over the rows of each person, (p, ...), of values, (n, ...)."""
    flat = values.reshape(len(values), -1)
    sums = [np.bincount(person, column, people) for column in flat.T]
    return np.stack(sums, axis=-1).astype(np.float64).reshape(people, *values.shape[1:])


def inverse_of(square: FloatArray) -> FloatArray:
    """Return the inverse of normal equations, (..., k, k); nought along what nothing determines."""
    size = np.sqrt(np.maximum(np.einsum("...ii->...i", square), 0.0))
    size = np.where(size > 0, size, 1.0)
    both = size[..., :, None] * size[..., None, :]
    return np.asarray(np.linalg.pinv(square / both, rcond=1e-12, hermitian=True) / both)


@quiet
def settle(
    residuals: Callable[[FloatArray], FloatArray],
    jacobian: Callable[[FloatArray], csr_matrix],
    start: FloatArray,
    bounds: tuple[FloatArray, FloatArray],
    sample: Sample,
) -> OptimizeResult:
    """Return the optimum that is near a start, as `least_squares` with the loss `soft_l1` would.

    Steps are those of Levenberg and Marquardt, bent as the residuals curve along them (Transtrum and
    Sethna 2012, arXiv:1201.5885): where one unknown trades for another along a curved valley, as focal
    length does for tilt, that takes a tenth of the steps.
    """
    x, damping = start, FIRST_DAMPING
    off = residuals(x)
    cost = _cost(off)
    for _ in range(MAX_STEPS):
        before, slopes, steep = cost, jacobian(x), steepness_of(off)
        bordered = Bordered.of(slopes, sample, steep)
        while damping < MAX_DAMPING:
            step = bordered.step(robust_pull(off), damping)
            ahead = residuals(x + AHEAD * step)
            curve = ((ahead - off) / AHEAD - slopes @ step) * 2 / AHEAD
            bend = bordered.step(steep * curve, damping) / 2
            trial = np.clip(x + step + bend, *bounds)
            there = residuals(trial)
            if _cost(there) < cost:
                x, off, cost = trial, there, _cost(there)
                damping *= BETTER
                break
            damping *= WORSE
        if before - cost <= SAME_COST * before:
            break
    scaled = csr_matrix(jacobian(x).multiply(steepness_of(off)[:, None]))
    return OptimizeResult(x=x, fun=off, jac=scaled, cost=cost)


def robust_pull(off: FloatArray) -> FloatArray:
    """Return residuals so that with the Jacobian of `least_squares` they give the loss's gradient."""
    return np.asarray(off * (1.0 + (off / ROBUST) ** 2) ** 0.25)


def steepness_of(off: FloatArray) -> FloatArray:
    """Return by what the loss scales the rows of the Jacobian.

    So its square is the second derivative of the loss (Triggs et al. 2000, Bundle Adjustment, section
    4.3), as in `least_squares`.
    """
    return np.asarray((1.0 + (off / ROBUST) ** 2) ** -0.75)


def _cost(off: FloatArray) -> float:
    """Return half the sum of the losses."""
    return float(ROBUST**2 * (np.sqrt(1.0 + (off / ROBUST) ** 2) - 1.0).sum())
