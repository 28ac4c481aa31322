"""The blur of single edges: a step of light behind a disc and the camera's floor, fitted.

The edge-spread function of ISO 12233, with its form known (`optics.defocus.edge_spread`), so that width,
place and both levels of light are all there is to find: least squares over all edges at once.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from pipeline.core.arrays import BoolArray, FloatArray, IntArray
from pipeline.measure.blur.edges import REACH_PX, Edges
from pipeline.optics.defocus import edge_spread

# What a level is asked for, in its pixels; narrower blur is seen better at the level before, and wider
# at the next. The stored picture has none before it.
WIDTHS_PX = (0.85, 1.9)
# Where the next level shows no straight edges any more, up to this: a profile then holds little of the
# light on either side, and what slopes there passes for blur, or takes some away.
WIDEST_PX = 2.7
MIN_WIDTH_PX = 0.25
# Only this much of a profile is believed to be one edge: beyond, another may begin.
WINDOW = 3.0  # standard deviations
STEPS = 12
# An edge departs from its fit by its noise, and by no more than this share of its contrast.
MAX_MISFIT = 0.03
MIN_CONTRAST_TO_NOISE = 8.0
# A disc passes details finer than itself with at most 13 % of their contrast, the side lobe of
# 2 J1(w) / w, and as edges narrower than its own: what is weaker than this share of the light's span is
# not taken for an edge.
MIN_CONTRAST_OF_SPAN = 0.2
MAX_RELATIVE_STD = 0.25


@dataclass(frozen=True, slots=True)
class Widths:
    """The blur of edges: standard deviations of a step's spread, in pixels of the stored picture."""

    sigma_px: FloatArray
    std_px: FloatArray  # by the residuals of the fit
    at_px: FloatArray  # (n, 2)
    normal: FloatArray  # (n, 2)
    length_px: FloatArray  # how much of an edge each stands for
    cramped: BoolArray  # wider than its level is made for

    def take(self, keep: BoolArray) -> Widths:
        """Return some of them."""
        return Widths(*(getattr(self, f.name)[keep] for f in fields(Widths)))

    @staticmethod
    def join(parts: Sequence[Widths]) -> Widths:
        """Return the widths of several levels as one."""
        nothing, places = np.empty(0), np.empty((0, 2))
        none = Widths(nothing, nothing, places, places, nothing, np.empty(0, np.bool_))
        columns = (
            np.concatenate([getattr(p, f.name) for p in [none, *parts]]) for f in fields(none)
        )
        return Widths(*columns)


def widths_of(edges: Edges, floor_px: float) -> Widths:
    """Return the widths of the edges that are steps, and as blurred as their level is made for.

    Args:
        edges: of one level.
        floor_px: what the camera does to a sharp edge; only its share in the form is taken from it.
    """
    good, sigma, std = fitted(edges, floor_px)
    return in_stored_pixels(edges, good, sigma, sigma * std)


def fitted(edges: Edges, floor_px: float) -> tuple[IntArray, FloatArray, FloatArray]:
    """Return which edges are steps, widths in pixels of the level, and deviations of their logarithms."""
    scale = 2.0**edges.level
    floor = np.sqrt(floor_px**2 + _halving_px2(edges)) / scale
    lowest = WIDTHS_PX[0] if edges.level else MIN_WIDTH_PX
    start = _start(edges.profile)
    likely = (start[:, 3] > np.log(lowest / 2)) & (start[:, 3] < np.log(WIDEST_PX * 2))
    least = max(MIN_CONTRAST_TO_NOISE * edges.noise, MIN_CONTRAST_OF_SPAN * edges.span)
    likely &= np.abs(start[:, 1]) > least / 2
    fit, std, misfit = _fit(edges.profile[likely], start[likely], floor, edges.noise)
    sigma, contrast = np.exp(fit[:, 3]), np.abs(fit[:, 1])
    good = (sigma > lowest) & (sigma < WIDEST_PX) & (np.abs(fit[:, 2]) < 1.5)
    good &= contrast > least
    good &= misfit < np.hypot(1.5 * edges.noise, MAX_MISFIT * contrast)
    good &= std < MAX_RELATIVE_STD
    return np.flatnonzero(likely)[good], sigma[good], std[good]


def in_stored_pixels(edges: Edges, rows: IntArray, sigma: FloatArray, std: FloatArray) -> Widths:
    """Return widths that were measured in a level's pixels, less what halving the picture added."""
    scale = 2.0**edges.level
    stored = np.sqrt(np.maximum(sigma**2 * scale**2 - _halving_px2(edges), 1e-4))
    return Widths(
        stored,
        std * sigma * scale**2 / stored,
        edges.at_px[rows],
        edges.normal[rows],
        np.full(len(rows), scale),
        sigma > WIDTHS_PX[1],
    )


def _halving_px2(edges: Edges) -> float:
    """Return the variance of the mean of 2^l by 2^l pixels, less that of the one that is in the floor."""
    return (4.0**edges.level - 1) / 12


def _start(profile: FloatArray) -> FloatArray:
    """Return low, contrast, place, log width to start from, (n, 4): by the ends and the slope."""
    low = profile[:, :3].mean(axis=1)
    contrast = profile[:, -3:].mean(axis=1) - low
    slope = np.diff(profile, axis=1)[:, REACH_PX - 3 : REACH_PX + 3].max(axis=1, initial=0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        width = np.abs(contrast) / (np.sqrt(2 * np.pi) * slope)
        log_width = np.log(np.clip(np.nan_to_num(width, nan=100.0), 1e-3, 100.0))
    return np.stack([low, contrast, np.zeros(len(low)), log_width], axis=1)


def _fit(
    profile: FloatArray, start: FloatArray, floor: float, noise: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the parameters, (n, 4), the deviation of the log width, and the residuals' size, (n,)."""
    n = len(profile)
    if n == 0:
        return np.empty((0, 4)), np.empty(0), np.empty(0)
    t = np.arange(-REACH_PX, REACH_PX + 1.0)
    p = start.copy()
    damping = np.full(n, 1e-2)
    weight = _window(t, p)
    model, jacobian = _model(t, p, floor)
    cost = _cost(profile - model, weight)
    for step in range(STEPS):
        if step == STEPS // 2:  # the width is known by now
            weight = _window(t, p)
            cost = _cost(profile - model, weight)
        weighted = jacobian * weight[:, None, :]
        normal = np.einsum("nik,njk->nij", weighted, jacobian)
        right = np.einsum("nik,nk->ni", weighted, profile - model)
        diagonal = np.einsum("nii->ni", normal)
        damped = normal + _diagonal(damping[:, None] * diagonal + 1e-12)
        change = _solve(damped, right[:, :, None])[:, :, 0]
        tried = p + np.clip(change, [-np.inf, -np.inf, -1.0, -0.5], [np.inf, np.inf, 1.0, 0.5])
        tried[:, 3] = np.clip(tried[:, 3], np.log(0.1), np.log(6.0))
        tried[:, 2] = np.clip(tried[:, 2], -3.0, 3.0)
        new_model, new_jacobian = _model(t, tried, floor)
        new_cost = _cost(profile - new_model, weight)
        better = new_cost <= cost
        damping = np.where(better, damping * 0.3, damping * 5.0)
        p[better], model[better], jacobian[better] = (
            tried[better],
            new_model[better],
            new_jacobian[better],
        )
        cost = np.where(better, new_cost, cost)
    count = weight.sum(axis=1)
    misfit = np.sqrt(cost / np.maximum(count - 4, 1))
    weighted = jacobian * weight[:, None, :]
    normal = np.einsum("nik,njk->nij", weighted, jacobian) + np.eye(4) * 1e-12
    last = np.zeros((n, 4, 1))
    last[:, 3] = 1.0
    of_width = _solve(normal, last)[:, 3, 0]
    std = np.sqrt(np.maximum(of_width, 0.0)) * np.maximum(misfit, noise)
    return p, std, misfit


def _model(t: FloatArray, p: FloatArray, floor: float) -> tuple[FloatArray, FloatArray]:
    """Return the edges at t, (n, k), and their derivatives by the parameters, (n, 4, k)."""
    small = 1e-3
    step = _spread(t, p[:, 2], p[:, 3], floor)
    contrast = p[:, 1, None]
    by_place = (_spread(t, p[:, 2] + small, p[:, 3], floor) - step) / small
    by_width = (_spread(t, p[:, 2], p[:, 3] + small, floor) - step) / small
    jacobian = np.stack(
        [np.ones_like(step), step, contrast * by_place, contrast * by_width], axis=1
    )
    return p[:, 0, None] + contrast * step, jacobian


def _spread(t: FloatArray, place: FloatArray, log_width: FloatArray, floor: float) -> FloatArray:
    sigma = np.exp(log_width)[:, None]
    share = np.maximum(1.0 - (floor / sigma) ** 2, 0.0)
    return edge_spread((t[None, :] - place[:, None]) / sigma, share)


def _window(t: FloatArray, p: FloatArray) -> FloatArray:
    reach = np.clip(WINDOW * np.exp(p[:, 3]) + 1.0, 3.0, float(REACH_PX))
    return (np.abs(t[None, :] - p[:, 2, None]) <= reach[:, None]).astype(np.float64)


def _cost(residual: FloatArray, weight: FloatArray) -> FloatArray:
    return np.asarray((weight * residual**2).sum(axis=1))


def _diagonal(values: FloatArray) -> FloatArray:
    return np.asarray(values[:, :, None] * np.eye(values.shape[1]))


def _solve(matrix: FloatArray, right: FloatArray) -> FloatArray:
    """Solve many small positive definite systems, (n, k, k) and (n, k, m), by elimination.

    LAPACK would be called once a system, and locks: threads wait for each other at every call.
    """
    a = np.concatenate([matrix, right], axis=2)
    size = matrix.shape[1]
    for i in range(size):
        a[:, i] /= np.maximum(a[:, i, i], 1e-30)[:, None]
        for j in range(size):
            if j != i:
                a[:, j] -= a[:, j, i, None] * a[:, i]
    return np.asarray(a[:, :, size:])
