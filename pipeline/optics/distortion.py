"""Lens distortion: from ideal normalised points to distorted ones, and back.

The models and the order of their coefficients are OpenCV's, which foxglove and ROS share:

    plumb_bob, rational_polynomial   k1 k2 p1 p2 k3 k4 k5 k6 s1 s2 s3 s4 tx ty, as many as are given
    equidistant, kannala_brandt, fisheye                                                 k1 k2 k3 k4

A polynomial fitted to the picture folds over beyond some radius: there two directions would share a
pixel, and what lies outside has no image. Up to this radius the models are one to one; beyond it
both ways give NaN.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.polynomial.polynomial import polyadd, polyder, polymul, polysub, polyval

from pipeline.optics.arrays import ArrayLike, Floats, floats, quiet

Coefficients = tuple[float, ...]

BROWN_MODELS = ("plumb_bob", "rational_polynomial")
FISHEYE_MODELS = ("equidistant", "kannala_brandt", "fisheye")
DISTORTION_MODELS = ("", "none", *BROWN_MODELS, *FISHEYE_MODELS)

_ITERATIONS = 60
_CONVERGED = 1e-9  # of the radius, or in normalised units: far below a thousandth of a pixel
_STEP = 1e-6  # of the numerical Jacobian
_REAL = 1e-7  # imaginary part of a root that counts as real, relatively
_WIDEST = 1e3  # the largest normalised radius, 89.94 degrees off the axis
_INSIDE = 1 - 1e-9  # of a limit, so that rounding is not beyond a pole


def check_distortion(model: str, coefficients: Coefficients) -> None:
    """Raise ValueError for a model that is not known, or coefficients that it does not have."""
    if model not in DISTORTION_MODELS:
        known = ", ".join((*BROWN_MODELS, *FISHEYE_MODELS))
        raise ValueError(f"distortion model {model!r} is not one of {known}")
    if not all(map(math.isfinite, coefficients)):
        raise ValueError(f"distortion coefficients {coefficients} are not all finite")
    most = 14 if model in BROWN_MODELS else 4
    if model not in ("", "none") and any(coefficients[most:]):
        raise ValueError(
            f"distortion model {model!r} has {most} coefficients, not {len(coefficients)}"
        )


@quiet
def distort(xy: ArrayLike, model: str, coefficients: Coefficients) -> Floats:
    """Return distorted normalised points, (..., 2), of ideal ones, (..., 2)."""
    points = floats(xy)
    if model in FISHEYE_MODELS:
        lens = fisheye_curve(coefficients)
        r = _radius(points)
        theta = np.arctan(r)
        bent = np.where(theta < lens.limit, lens.at(theta), np.nan)
        return points * _over_radius(bent, r)
    if model in BROWN_MODELS and any(coefficients):
        inside = _radius(points) < brown_curve(coefficients).limit
        bent = _with_sensor(_with_tangential(points, coefficients), coefficients)
        return np.where(inside[..., None], bent, np.nan)
    return points


@quiet
def undistort(bent_xy: ArrayLike, model: str, coefficients: Coefficients) -> Floats:
    """Return ideal normalised points, (..., 2), of distorted ones, (..., 2)."""
    bent = floats(bent_xy)
    if model in FISHEYE_MODELS:
        r = _radius(bent)
        return bent * _over_radius(np.tan(_invert(fisheye_curve(coefficients), r)), r)
    if model in BROWN_MODELS and any(coefficients):
        bent = _with_sensor(bent, coefficients, back=True)
        r = _radius(bent)
        xy = bent * _over_radius(_invert(brown_curve(coefficients), r), r)
        _, _, p1, p2, _, _, _, _, *prism, _, _ = _padded(coefficients, 14)
        if any((p1, p2, *prism)):
            xy = _refine(xy.reshape(-1, 2), bent.reshape(-1, 2), coefficients).reshape(xy.shape)
        return xy
    return bent


@dataclass(frozen=True, slots=True)
class Curve:
    """The distorted radius as a function of the ideal one: it rises from 0 to `limit`."""

    at: Callable[[Floats], Floats]
    slope: Callable[[Floats], Floats]
    limit: float


def brown_curve(coefficients: Coefficients) -> Curve:
    """Return Brown's radial term r P(u) / Q(u), u = r^2, over normalised radii.

    Its slope is ((P + 2u P') Q - 2u P Q') / Q^2. The first zero of the slope, or of Q, is the limit.
    """
    k1, k2, _, _, k3, k4, k5, k6 = _padded(coefficients, 8)
    p, q, twice_u = (1.0, k1, k2, k3), (1.0, k4, k5, k6), (0.0, 2.0)
    rises = polymul(polyadd(p, polymul(twice_u, polyder(p))), q)
    above = polysub(rises, polymul(polymul(twice_u, p), polyder(q)))
    limit = math.sqrt(min(_first_positive_root(floats(above)), _first_positive_root(floats(q))))
    return Curve(
        lambda r: floats(r * polyval(r * r, p) / polyval(r * r, q)),
        lambda r: floats(polyval(r * r, above) / polyval(r * r, q) ** 2),
        min(limit * _INSIDE, _WIDEST),
    )


def fisheye_curve(coefficients: Coefficients) -> Curve:
    """Return Kannala and Brandt's theta (1 + k1 theta^2 + ... + k4 theta^8) over angles theta."""
    k = np.array((1.0, *_padded(coefficients, 4)))
    slope = k * np.array((1.0, 3.0, 5.0, 7.0, 9.0))
    limit = math.sqrt(_first_positive_root(slope))
    return Curve(
        lambda theta: theta * polyval(theta * theta, k),
        lambda theta: polyval(theta * theta, slope),
        min(limit * _INSIDE, math.atan(_WIDEST)),
    )


def _invert(curve: Curve, bent: Floats) -> Floats:
    """Return the ideal radii of distorted ones; NaN for what the curve does not reach.

    Newton's method, and bisection where it leaves the bracket or the last step was of no use.
    """
    flat = bent.ravel()
    radius = np.where(flat < curve.at(floats(curve.limit)), np.minimum(flat, curve.limit), np.nan)
    low, high = np.zeros_like(radius), np.full_like(radius, curve.limit)
    last_error = np.full_like(radius, np.inf)
    tolerance = _CONVERGED * np.maximum(flat, 1.0)
    active = np.flatnonzero(~np.isnan(radius))
    for _ in range(_ITERATIONS):
        at = radius[active]
        error = curve.at(at) - flat[active]
        low[active] = np.where(error < 0, at, low[active])
        high[active] = np.where(error > 0, at, high[active])
        newton = at - error / curve.slope(at)
        useful = 2 * np.abs(error) <= last_error[active]
        good = (newton >= low[active]) & (newton <= high[active]) & useful
        done = np.abs(error) <= tolerance[active]  # and after one more step far below it
        middle = np.where(done, at, (low[active] + high[active]) / 2)
        radius[active] = np.where(good, newton, middle)
        last_error[active] = np.abs(error)
        active = active[~done]
        if len(active) == 0:
            break
    missed = np.abs(curve.at(radius) - flat) > tolerance
    return np.where(missed, np.nan, radius).reshape(bent.shape)


def _with_tangential(xy: Floats, coefficients: Coefficients) -> Floats:
    """Brown-Conrady: the radial term, decentring p1 p2 and thin prisms s1..s4."""
    k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4 = _padded(coefficients, 12)
    x, y = xy[..., 0], xy[..., 1]
    r2 = x * x + y * y
    radial = (1 + r2 * (k1 + r2 * (k2 + r2 * k3))) / (1 + r2 * (k4 + r2 * (k5 + r2 * k6)))
    bent_x = x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x) + r2 * (s1 + r2 * s2)
    bent_y = y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y + r2 * (s3 + r2 * s4)
    return np.stack([bent_x, bent_y], axis=-1)


def _refine(xy: Floats, bent: Floats, coefficients: Coefficients) -> Floats:
    """Invert `_with_tangential` by Newton's method from the inverse of its radial term, (n, 2)."""
    limit, found = brown_curve(coefficients).limit, np.full_like(xy, np.nan)
    active = np.flatnonzero(~np.isnan(xy).any(axis=1))
    for _ in range(_ITERATIONS):
        at = xy[active]
        error = _with_tangential(at, coefficients) - bent[active]
        (a, c), (b, d) = _jacobian(at, coefficients)
        step = np.stack([d * error[:, 0] - b * error[:, 1], a * error[:, 1] - c * error[:, 0]])
        xy[active] = at - (step / (a * d - b * c)).T
        done = (np.abs(error) < _CONVERGED).all(axis=1)
        one_to_one = (a * d - b * c > 0) & (_radius(at) < limit)
        found[active[done & one_to_one]] = xy[active[done & one_to_one]]
        active = active[~done]
        if len(active) == 0:
            break
    return found


def _jacobian(xy: Floats, coefficients: Coefficients) -> tuple[Floats, Floats]:
    """Return d(x, y) of `_with_tangential` by x and by y, each (2, n)."""
    right, down = np.array([_STEP, 0.0]), np.array([0.0, _STEP])
    by_x = _with_tangential(xy + right, coefficients) - _with_tangential(xy - right, coefficients)
    by_y = _with_tangential(xy + down, coefficients) - _with_tangential(xy - down, coefficients)
    return by_x.T / (2 * _STEP), by_y.T / (2 * _STEP)


def _with_sensor(xy: Floats, coefficients: Coefficients, *, back: bool = False) -> Floats:
    """Project onto a sensor tilted by tx about x, then ty about y (Scheimpflug), or back from it."""
    *_, tx, ty = _padded(coefficients, 14)
    if not (tx or ty):
        return xy
    cos_x, sin_x, cos_y, sin_y = math.cos(tx), math.sin(tx), math.cos(ty), math.sin(ty)
    about_x = np.array([[1, 0, 0], [0, cos_x, sin_x], [0, -sin_x, cos_x]])
    about_y = np.array([[cos_y, 0, -sin_y], [0, 1, 0], [sin_y, 0, cos_y]])
    turn = about_y @ about_x
    onto = np.array([[turn[2, 2], 0, -turn[0, 2]], [0, turn[2, 2], -turn[1, 2]], [0, 0, 1]]) @ turn
    if back:
        onto = np.linalg.inv(onto)
    seen = xy @ onto[:, :2].T + onto[:, 2]
    return np.asarray(seen[..., :2] / seen[..., 2:])


def _radius(xy: Floats) -> Floats:
    return np.asarray(np.hypot(xy[..., 0], xy[..., 1]))


def _over_radius(new_radius: Floats, radius: Floats) -> Floats:
    """Return the factor for points, (..., 1), that gives them a new radius; one at the centre."""
    return np.where(radius > 0, new_radius / radius, 1.0)[..., None]


def _first_positive_root(ascending: Floats) -> float:
    """Return the smallest positive real root of 1 + c1 u + c2 u^2 ..., infinity if it has none.

    Read backwards the coefficients are those of the polynomial in 1/u, which is monic: no division
    by a small leading coefficient. Coefficients too large to multiply have a root at once: zero.
    """
    if not np.isfinite(ascending).all():
        return 0.0
    inverse = np.roots(ascending)
    real = inverse.real[(np.abs(inverse.imag) <= _REAL * np.abs(inverse)) & (inverse.real > 0)]
    largest = float(real.max(initial=0.0))
    return 1.0 / largest if largest > 0 else math.inf


def _padded(coefficients: Coefficients, length: int) -> Coefficients:
    return (*coefficients, *(0.0,) * length)[:length]
