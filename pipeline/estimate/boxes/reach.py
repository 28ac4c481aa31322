"""Distance from a person's axis to the lower end of the silhouette, by the way they walk.

Formulas: `optics.silhouette`.
"""

from __future__ import annotations

import numpy as np

from pipeline.core.arrays import FloatArray
from pipeline.core.records import GroundPlane
from pipeline.estimate.boxes.error_correlation import independent_share
from pipeline.estimate.boxes.geometry import Geometry
from pipeline.estimate.by_track import median_by
from pipeline.estimate.fusion.smoother import smooth_tracks
from pipeline.estimate.gait import WALKER
from pipeline.estimate.types import Measured
from pipeline.optics.ground_plane import foot_depth_m, ground_position_m, height_m
from pipeline.optics.silhouette import REACH_STD, UNKNOWN_REACH_STD, mean_reach, steepness

# Who stands shifts their weight at about this speed; of them no direction is known.
STANDING_M_S = 0.2
ODD_HEIGHT = 0.1  # of the track's: two deviations of what a stride and a box make in a steep view
ACROSS_STD_M = 0.1  # of the middle of a box about the person


def with_reach(measured: Measured) -> Geometry:
    """Return the geometry of boxes around bodies; where the pose is unknown, of lines."""
    plane = measured.ground_plane
    if plane is None or measured.intrinsics is None:
        return Geometry.of(measured)
    lines = Geometry.of(measured)
    reach, std = _reach(lines, plane)
    return lines.with_reach(reach, std)


def reach_of(m: Measured, plane: GroundPlane) -> tuple[FloatArray, FloatArray]:
    """Return the reach of each person, NaN of what is none, and its deviation from frame to frame."""
    return _reach(Geometry.of(m), plane)


def _reach(lines: Geometry, plane: GroundPlane) -> tuple[FloatArray, FloatArray]:
    m = lines.measured
    person = m.class_name == WALKER
    steep, _ = steepness(lines.head[:, 1], plane.tilt_rad)
    average = np.where(person, mean_reach(steep), np.nan)
    if not person.any():
        return average, np.full(len(m), UNKNOWN_REACH_STD)
    velocity, variance = _velocity(lines.with_reach(average), plane)
    across, ahead = velocity.T
    squared = across**2 + ahead**2
    # Of a direction that is not known well: the mean over what it may be.
    total = squared + 2 * variance
    reach = mean_reach(steep, -ahead / np.sqrt(total), (ahead**2 + variance) / total)
    sure = squared / total
    std = np.sqrt(sure * REACH_STD**2 + (1 - sure) * UNKNOWN_REACH_STD**2)
    known = person & np.isfinite(reach)
    return np.where(known, reach, average), np.where(known, std, UNKNOWN_REACH_STD)


def _velocity(geometry: Geometry, plane: GroundPlane) -> tuple[FloatArray, FloatArray]:
    """Return velocities on the ground, (n, 2), and the variance of each component, (n,)."""
    m, foot = geometry.measured, geometry.foot
    depth_m = foot_depth_m(plane.camera_height_m, plane.tilt_rad, foot[:, 1])
    x_m, y_m = ground_position_m(depth_m, foot[:, 0], foot[:, 1], plane.tilt_rad)
    slope = foot[:, 1] * np.cos(plane.tilt_rad) + np.sin(plane.tilt_rad)
    noise_m = depth_m / np.where(slope > 0, slope, np.nan) * geometry.foot_std
    covariance = np.zeros((len(m), 2, 2))
    covariance[:, 0, 0] = ACROSS_STD_M**2
    covariance[:, 1, 1] = noise_m**2 + ACROSS_STD_M**2 + (UNKNOWN_REACH_STD * geometry.reach_m) ** 2
    covariance /= independent_share(m)[:, None, None]
    seen = np.column_stack([x_m, y_m])
    # Whose feet are hidden seems far away and short: that is no way they went.
    tall_m = height_m(depth_m, foot[:, 1], geometry.head[:, 1], plane.tilt_rad)
    usual_m = median_by(m.track_id, tall_m)
    odd = np.abs(tall_m / usual_m - 1) > ODD_HEIGHT
    seen[m.truncated[:, 3] | odd] = np.nan
    time_s = (m.capture_time_ns - m.capture_time_ns.min(initial=0)) / 1e9
    smoothed = smooth_tracks(m.track_id, time_s, seen, covariance)
    return smoothed.velocity_m_s, smoothed.velocity_variance + STANDING_M_S**2
