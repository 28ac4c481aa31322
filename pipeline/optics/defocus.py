"""Model of a blurred edge: the image of a step of light out of focus, and the depth that follows from it.

A point out of focus is a uniform disc of radius r (`thin_lens.blur_radius_um`, the paper's Figs. 2-3).
Everything else that softens a picture (the pixel's own area, demosaicing, diffraction, aberrations) is
the camera's *floor*, close to a Gaussian. Convolution adds second moments, whatever the shapes, so
blur is kept as the standard deviation across an edge: sigma^2 = (r / 2)^2 + floor^2.

Along any line the disc's spread is a semicircle, 2 sqrt(r^2 - x^2) / (pi r^2); its standard deviation
is r / 2. Depth follows from r by 1/d = 1/s +- r / (a v): + in front of the plane of focus, - behind it.
"""

from __future__ import annotations

from functools import cache
from math import erf, sqrt

import numpy as np

from pipeline.optics.arrays import ArrayLike, Floats, floats, positive, quiet
from pipeline.optics.thin_lens import aperture_radius_mm, image_distance_mm

# Green light, where eye, Bayer filter and Eq. 15 have most of their weight.
WAVELENGTH_UM = 0.55

# The grid of `edge_spread`: x / sigma, and which share of the variance is the disc's.
_REACH = 6.0
_STEPS_PER_SIGMA = 40
_SHARES = 33
# A disc alone has kinks that no grid holds; the last share is as much disc as any camera shows.
_MOST_DISC = 0.998


@quiet
def disc_sigma(radius: ArrayLike) -> Floats:
    """Return r / 2: the standard deviation across an edge of a disc of this radius."""
    return np.asarray(floats(radius) / 2.0)


@quiet
def disc_edge_spread(x_over_radius: ArrayLike) -> Floats:
    """Return the step's edge behind a disc, 0..1: 1/2 + (u sqrt(1 - u^2) + asin u) / pi."""
    u = np.clip(floats(x_over_radius), -1.0, 1.0)
    return np.asarray(0.5 + (u * np.sqrt(1.0 - u * u) + np.arcsin(u)) / np.pi)


@quiet
def edge_spread(x_over_sigma: ArrayLike, disc_share: ArrayLike) -> Floats:
    """Return the edge of a unit step behind a disc and a Gaussian, of unit variance together.

    Args:
        x_over_sigma: distance across the edge over the standard deviation of the whole blur.
        disc_share: the disc's part of the variance, 0 (a Gaussian) to 1 (a disc).
    """
    x, share = np.broadcast_arrays(floats(x_over_sigma), floats(disc_share))
    unknown = np.isnan(x) | np.isnan(share)
    x, share = np.where(unknown, 0.0, x), np.where(unknown, 0.0, share)
    table = _edge_table()
    at = np.clip((x + _REACH) * _STEPS_PER_SIGMA, 0.0, table.shape[1] - 1.000001)
    of = np.clip(share / _MOST_DISC * (_SHARES - 1), 0.0, _SHARES - 1.000001)
    column, row = at.astype(np.intp), of.astype(np.intp)
    right, below = at - column, of - row
    flat, width = table.ravel(), table.shape[1]
    first = row * width + column
    upper = flat[first] * (1 - right) + flat[first + 1] * right
    lower = flat[first + width] * (1 - right) + flat[first + width + 1] * right
    return np.where(unknown, np.nan, upper * (1 - below) + lower * below)


@cache
def _edge_table() -> Floats:
    """Return `edge_spread` on its grid, (shares, steps): the Gaussian's edge averaged over the disc.

    With x = r cos t the semicircle's weight is 2 sin^2 t / pi, and the midpoint rule in t converges
    faster than any power.
    """
    x = np.linspace(-_REACH, _REACH, round(2 * _REACH * _STEPS_PER_SIGMA) + 1)
    share = np.linspace(0.0, _MOST_DISC, _SHARES)
    t = (np.arange(256) + 0.5) * np.pi / 256
    weight = 2.0 * np.sin(t) ** 2 / 256
    radius, sigma = 2.0 * np.sqrt(share), np.sqrt(1.0 - share)
    z = (x[None, :, None] - radius[:, None, None] * np.cos(t)) / sigma[:, None, None]
    return np.asarray(_normal(z) @ weight)


def _normal(z: Floats) -> Floats:
    """Return the normal distribution, by a table that is exact to 1e-6."""
    at = np.linspace(-8.0, 8.0, 4001)
    table = np.array([0.5 * (1.0 + erf(x / sqrt(2.0))) for x in at])
    return np.interp(z, at, table)


@quiet
def diffraction_sigma_um(f_number: ArrayLike, wavelength_um: float = WAVELENGTH_UM) -> Floats:
    """Return the Gaussian whose edge is as steep as the Airy pattern's: 0.470 lambda N.

    The Airy pattern has no second moment; its edge has a slope. That is twice the integral of the
    modulation transfer function of a round pupil, 2 (4 / (3 pi)) / (lambda N) (Goodman, Introduction to
    Fourier Optics, 6.4), and a Gaussian's is 1 / (sqrt(2 pi) sigma).
    """
    slope = 8.0 / (3.0 * np.pi) / (wavelength_um * positive(f_number))
    return np.asarray(1.0 / (np.sqrt(2.0 * np.pi) * slope))


@quiet
def radius_per_dioptre_um(
    focal_length_mm: ArrayLike, f_number: ArrayLike, focus_distance_m: ArrayLike = np.inf
) -> Floats:
    """Return a v: how much the blur's radius grows for each 1/m that 1/d is away from 1/s."""
    a_mm = aperture_radius_mm(focal_length_mm, f_number)
    return np.asarray(a_mm * image_distance_mm(focus_distance_m, focal_length_mm))


@quiet
def dioptres(distance_m: ArrayLike) -> Floats:
    """Return 1 / distance in 1/m: zero for an infinite one."""
    return np.asarray(1.0 / floats(distance_m))


@quiet
def resolvable_radius(floor_sigma: ArrayLike, floor_std: ArrayLike, factor: float = 2.0) -> Floats:
    """Return the blur radius whose variance is `factor` times what is not known of the floor's.

    Below it a soft lens and a lens out of focus look the same: r^2 / 4 = factor 2 sigma_0 delta_0.
    """
    return np.asarray(2.0 * np.sqrt(factor * 2.0 * floats(floor_sigma) * floats(floor_std)))
