"""Depth from how far out of focus an object is (the paper's Eqs. 3-10, for any focus distance).

The blur that pass 1 measured, less the camera's own softness in quadrature, is that of a disc of radius
r = a v u, where u = |1/s - 1/d| is how far the object is from the plane of focus, in 1/m. So u has an
error of its own, which is even where depth's is not, and 1/d = 1/s + u in front of that plane and
1/s - u behind it; focused at infinity there is only the first, and it is Eq. 10.

Where the aperture changes while an object stands still, the variance of its blur is a straight line over
(a v)^2: its slope is u^2, and where it begins is the camera's softness, which need not be known then
(`sweep.py`). Which side of focus an object is on is found in `branch.py`. Where the blur contradicts the
stated lens all over a camera (an autofocus that says "infinity"), there is no estimate.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from pipeline.core.arrays import FloatArray
from pipeline.core.config import CameraConfig, Config
from pipeline.core.records import Diagnostic, Severity
from pipeline.estimate.boxes.geometry import Geometry
from pipeline.estimate.methods.defocus_branch import Sides, choose
from pipeline.estimate.methods.defocus_sweep import Sweeps, solve
from pipeline.estimate.methods.scaling import with_heights, with_positions
from pipeline.estimate.types import BoolArray, CameraBlur, Estimated, Measured
from pipeline.measure.blur.expected import FLOOR_PX, FLOOR_STD_PX
from pipeline.optics.defocus import diffraction_sigma_um, dioptres, radius_per_dioptre_um

# One sigma of a v beside what the lens says. Apertures are named by rounded numbers (f/1.8 is 1.78,
# f/5.6 is 5.66, f/11 is 11.3), focal lengths to a per cent.
LENS_STD = 0.02
# Of 1/s: of the focus scale, and of its zero.
FOCUS_STD, FOCUS_ZERO_STD_PER_M = 0.01, 0.003
# Blur counts where its variance is above the floor by this many times what is not known of either.
RESOLVED = 2.5
# Motion during the exposure may add this share of the variance; more, and there is no estimate.
MOTION_SHARE = 0.1
# Blur and size contradict each other from here on; where most of a camera's observations do, it is the
# lens data that are wrong, and not the objects.
CONTRADICTION, CONTRADICTED_SHARE, CONTRADICTED_LEAST = 4.0, 0.5, 5


@dataclass(frozen=True, slots=True)
class Vergence:
    """Distance from the plane of focus, u = |1/s - 1/d| in 1/m, (n,) each; NaN where not resolved."""

    u: FloatArray
    noise: FloatArray  # standard deviation, of the frame's own blur
    common: FloatArray  # and of what the frames of a track share: floor and lens


def learn(geometry: Geometry, config: Config) -> CameraBlur:
    """Return what cannot be told of a few tracks alone; arguments as those of `estimate`."""
    m = geometry.measured
    if m.blur_sigma_px is None or not np.isfinite(m.blur_sigma_px).any():
        return CameraBlur()
    blur = BlurVariance.of(geometry, config.camera_named(m.camera))
    contradicted = _contradiction(blur, m, geometry.earlier)
    if contradicted:
        return CameraBlur(contradicted)
    _, sweeps = _vergence(blur.without(_moving(blur, m)), m, None)
    return CameraBlur(floor=sweeps.rounds if sweeps else None)


def estimate(geometry: Geometry, config: Config) -> Estimated:
    """Return depths by the blur of edges, with notes on those that have none.

    Args:
        geometry: the boxes and their blur. The estimates of earlier methods tell the side of focus and
            whether the lens data can be believed; they do not move the depth. `measured.camera_blur`
            is what all of the camera says, where these are some of its tracks.
        config: the camera's softness, where it was calibrated.
    """
    m, others, camera = geometry.measured, geometry.earlier, geometry.measured.camera_blur
    estimated = Estimated.unknown(len(m))
    if m.blur_sigma_px is None or not np.isfinite(m.blur_sigma_px).any():
        return estimated
    blur = BlurVariance.of(geometry, config.camera_named(m.camera))
    notes = []
    contradicted = camera.contradicted if camera else _contradiction(blur, m, others)
    if contradicted:
        return estimated if camera else replace(estimated, notes=(contradicted,))
    moving = _moving(blur, m)
    if moving.any():
        text = "blur may be motion: the object moves too far while the shutter is open; no depth"
        notes.append(_note(m, "blur_by_motion", text, int(moving.sum())))
    blur = blur.without(moving)
    vergence, sweeps = _vergence(blur, m, camera)
    if sweeps is not None and sweeps.count:
        text = (
            "the camera's own blur, from objects that stood still while the aperture changed: "
            f"{np.sqrt(max(sweeps.floor_px2, 0.0)):.2f} +- {max(sweeps.floor_px_std, 0.01):.2f} px"
        )
        notes.append(_note(m, "blur_floor_from_sweep", text, sweeps.count))
    sides = _sides(vergence, m)
    branch = choose(sides, geometry, others)
    unknown = np.isfinite(vergence.u) & (branch == 0)
    if unknown.any():
        text = (
            "the blur fits a depth before the plane of focus and one behind it, and neither size nor "
            "ground nor the track decides between them: no depth"
        )
        notes.append(_note(m, "branch_unknown", text, int(unknown.sum())))
    far = branch < 0
    near = branch > 0
    depth_m = np.where(near, sides.near_m, np.where(far, sides.far_m, np.nan))
    known = np.isfinite(depth_m)
    noise_m = depth_m**2 * vergence.noise
    common_m = depth_m**2 * np.hypot(vergence.common, focus_std_per_m(m.focus_distance_m))
    side = np.full(len(m), None, dtype=np.object_)
    side[known & near], side[known & far] = "near", "far"
    estimated = replace(
        estimated,
        depth_m=depth_m,
        depth_std_m=np.hypot(noise_m, common_m),
        depth_common_std_m=np.where(known, common_m, 0.0),
        branch=side,
        notes=tuple(notes),
    )
    return with_positions(_with_heights(estimated, geometry), geometry)


@dataclass(frozen=True, slots=True)
class BlurVariance:
    """Variances in square pixels of the stored picture, (n,) each."""

    variance: FloatArray
    std: FloatArray  # of the variance
    floor: FloatArray  # the camera's softness and diffraction
    diffraction: FloatArray
    floor_std: FloatArray
    per_dioptre2: FloatArray  # what u = 1/m adds: (a v / (2 p))^2

    @staticmethod
    def of(geometry: Geometry, camera: CameraConfig) -> BlurVariance:
        """Return them for all observations of a camera; NaN where blur or lens is not known."""
        m = geometry.measured
        sigma = np.asarray(m.blur_sigma_px, dtype=np.float64)
        std = np.asarray(m.blur_std_px, dtype=np.float64)
        pitch_um = np.sqrt(m.pixel_pitch_x_um * m.pixel_pitch_y_um)
        diffraction = (diffraction_sigma_um(m.f_number) / pitch_um) ** 2
        floor_px, floor_std_px = camera.blur_floor_px, camera.blur_floor_std_px
        if np.isnan(floor_px):
            floor_px, floor_std_px = FLOOR_PX, FLOOR_STD_PX
        per_um = radius_per_dioptre_um(m.focal_length_mm, m.f_number, m.focus_distance_m)
        per_px2 = (per_um / (2 * pitch_um)) ** 2
        known = np.isfinite(per_px2) & ~np.isnan(m.focus_distance_m)
        return BlurVariance(
            np.where(known, sigma**2, np.nan),
            2 * sigma * std,
            floor_px**2 + diffraction,
            diffraction,
            # Half of diffraction is not known either: it is never quite that of an Airy pattern.
            np.hypot(2 * floor_px * floor_std_px, diffraction / 2),
            per_px2,
        )

    def without(self, rows: BoolArray) -> BlurVariance:
        """Return the same with the blur of some observations forgotten."""
        return BlurVariance(
            np.where(rows, np.nan, self.variance),
            self.std,
            self.floor,
            self.diffraction,
            self.floor_std,
            self.per_dioptre2,
        )


def _vergence(
    blur: BlurVariance, m: Measured, camera: CameraBlur | None
) -> tuple[Vergence, Sweeps | None]:
    """Return u of every observation: by its own blur, or by the sweep that it belongs to."""
    floor, floor_std = blur.floor, blur.floor_std
    before, known = (floor - blur.diffraction, floor_std), camera.floor if camera else None
    sweeps = None
    if camera is None or known:
        variance = blur.variance - blur.diffraction
        sweeps = solve(m, variance, blur.std, blur.per_dioptre2, before, known)
    if sweeps is not None:
        floor = sweeps.floor_px2 + blur.diffraction
        floor_std = np.hypot(sweeps.floor_px2_std, blur.diffraction / 2)
    excess = blur.variance - floor
    unsure = np.hypot(blur.std, floor_std)
    u2 = excess / blur.per_dioptre2
    noise2, common2 = blur.std / blur.per_dioptre2, floor_std / blur.per_dioptre2
    resolved = excess > RESOLVED * unsure
    if sweeps is not None:
        by_sweep = np.isfinite(sweeps.u2)
        u2 = np.where(by_sweep, sweeps.u2, u2)
        # All frames of a sweep have the one depth that they made together.
        noise2 = np.where(by_sweep, 0.0, noise2)
        common2 = np.where(by_sweep, sweeps.u2_std, common2)
        resolved = np.where(by_sweep, sweeps.u2 > RESOLVED * sweeps.u2_std, resolved)
    with np.errstate(invalid="ignore", divide="ignore"):
        u = np.where(resolved, np.sqrt(u2), np.nan)
        noise, common = noise2 / (2 * u), common2 / (2 * u)
    return Vergence(u, noise, np.hypot(common, u * LENS_STD)), sweeps


def _sides(vergence: Vergence, m: Measured) -> Sides:
    """Return the depths on both sides of the plane of focus; the far one may not exist."""
    at_focus = dioptres(m.focus_distance_m)
    std = np.sqrt(vergence.noise**2 + vergence.common**2 + focus_std_per_m(m.focus_distance_m) ** 2)
    behind = at_focus - vergence.u
    with np.errstate(invalid="ignore", divide="ignore"):
        near_m = 1 / (at_focus + vergence.u)
        far_m = np.where(behind > 0, 1 / behind, np.nan)
    return Sides(near_m, far_m, std, behind < -2 * std)


def focus_std_per_m(focus_distance_m: FloatArray) -> FloatArray:
    """Return the standard deviation of 1 / focus distance."""
    return np.hypot(dioptres(focus_distance_m) * FOCUS_STD, FOCUS_ZERO_STD_PER_M)


def _moving(blur: BlurVariance, m: Measured) -> BoolArray:
    """Return which objects move so far during the exposure that it shows: L^2 / 12 of the variance.

    The speed in the picture is the track's, over the observations before and after.
    """
    if m.exposure_time_s is None:
        return np.zeros(len(m), dtype=np.bool_)
    middle = (m.bbox_xyxy_px[:, :2] + m.bbox_xyxy_px[:, 2:]) / 2
    frame = pd.DataFrame(
        {"track": m.track_id, "t": m.capture_time_ns / 1e9, "x": middle[:, 0], "y": middle[:, 1]}
    ).sort_values(["track", "t"])
    steps = frame.groupby("track")[["t", "x", "y"]].diff()
    speed = np.hypot(steps["x"], steps["y"]) / steps["t"].where(steps["t"] > 0)
    after = speed.groupby(frame["track"]).shift(-1)
    fastest = pd.concat([speed, after], axis=1).min(axis=1).reindex(np.arange(len(m)))
    length_px = fastest.to_numpy(dtype=np.float64) * m.exposure_time_s
    excess = np.maximum(blur.variance - blur.floor, blur.std)
    with np.errstate(invalid="ignore"):
        return np.asarray(length_px**2 / 12 > MOTION_SHARE * excess)


def _contradiction(
    blur: BlurVariance, m: Measured, others: Mapping[str, Estimated]
) -> Diagnostic | None:
    """Return a complaint where most blur of a camera is not what the stated lens gives there.

    Blur is compared at the depths of the surest other method, with that depth's own uncertainty; one
    number a track, the median, so that one object that stays long is one witness.
    """
    depth_m, std_m = surest(others, len(m))
    u = np.abs(dioptres(m.focus_distance_m) - 1 / depth_m)
    u_std = np.hypot(std_m / depth_m**2, focus_std_per_m(m.focus_distance_m))
    expected = blur.floor + blur.per_dioptre2 * u**2
    with np.errstate(invalid="ignore", divide="ignore"):
        # Of the square root, which is even on both sides of a wide interval.
        wide = np.sqrt(blur.per_dioptre2) * (u_std + u * LENS_STD)
        off = np.sqrt(np.maximum(blur.variance - blur.floor, 0.0)) - np.sqrt(
            np.maximum(expected - blur.floor, 0.0)
        )
        unsure = np.sqrt(wide**2 + blur.floor_std + blur.std**2 / (4 * blur.variance))
        z = np.abs(off) / unsure
    by_track = pd.Series(z).groupby(m.track_id).median().dropna()
    against = by_track > CONTRADICTION
    if len(by_track) < CONTRADICTED_LEAST or against.mean() <= CONTRADICTED_SHARE:
        return None
    ratio = np.nanmedian(np.sqrt(blur.variance / expected))
    text = (
        f"blur is {ratio:.2g} times what f-number and focus distance give at the distances that other "
        f"methods tell, in {int(against.sum())} of {len(by_track)} tracks: the stated focus distance "
        "or f-number is not that of the pictures; no depth from defocus"
    )
    return _note(m, "blur_contradicts_lens", text, int(against.sum()), Severity.WARNING)


def surest(others: Mapping[str, Estimated], count: int) -> tuple[FloatArray, FloatArray]:
    """Return the depth of the other method that is surest of each observation, and its deviation."""
    if not others:
        return np.full(count, np.nan), np.full(count, np.nan)
    depth = np.stack([e.depth_m for e in others.values()])
    std = np.stack([e.depth_std_m for e in others.values()])
    best = np.where(np.isfinite(depth) & (std > 0), std, np.inf).argmin(axis=0)
    columns = np.arange(count)
    return depth[best, columns], std[best, columns]


def _with_heights(estimated: Estimated, geometry: Geometry) -> Estimated:
    """Return estimates with heights.

    Without a pose H = o d / v: here the focus distance is a fact, infinity too.
    """
    m = geometry.measured
    if m.ground_plane is not None and m.intrinsics is not None:
        return with_heights(estimated, geometry)
    o_mm, v_mm = geometry.height_on_sensor_mm, geometry.image_distance_mm
    with np.errstate(invalid="ignore", divide="ignore"):
        tall_m = o_mm * estimated.depth_m / v_mm
        by_box_m = tall_m * geometry.height_std_mm / o_mm
    by_depth = o_mm / v_mm
    noise_m = estimated.depth_noise_m
    common_m = np.hypot(by_depth * estimated.depth_common_std_m, tall_m * 0.01)  # focal length
    unknown = np.isnan(tall_m)
    return replace(
        estimated,
        height_m=tall_m,
        height_std_m=np.sqrt((by_depth * noise_m) ** 2 + by_box_m**2 + common_m**2),
        height_common_std_m=np.where(unknown, 0.0, common_m),
    )


def _note(
    m: Measured, code: str, message: str, count: int, severity: Severity = Severity.INFO
) -> Diagnostic:
    return Diagnostic(severity, code, message, camera=m.camera, count=count)
