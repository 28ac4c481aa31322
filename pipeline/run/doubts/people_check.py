"""People as evidence: whether a pose and a lens show people of possible stature.

A pose of a camera file or of transforms is a claim like any other: a map at sea level, a frame of the
body, boxes of another picture or a wrong lens make people of 98 m, or of 40 cm.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from pipeline.calibrate.walkers.tilt import Tilt
from pipeline.core.camera_row import CameraRow
from pipeline.core.config import POPULATION_MEAN_M, Config, SizePrior
from pipeline.core.records import Diagnostic, GroundPlane, Severity
from pipeline.estimate.boxes.ends import Directions, Ends
from pipeline.estimate.types import Measured
from pipeline.optics.ground_plane import foot_depth_m, height_m

# The median person of any place where not only children or only giants pass, in shares of the mean
# stature of adults: 1.2 m (a school of ten-year-olds is taller) to 2.2 m.
MEDIAN_SHARES = 1.2 / POPULATION_MEAN_M, 2.2 / POPULATION_MEAN_M
# One or two people may be a child alone: these are the shortest and the tallest on record.
ANYBODY_SHARES = 0.55 / POPULATION_MEAN_M, 2.72 / POPULATION_MEAN_M
FEW = 3
# Deviations of the mean stature: a lens within the first is possible, beyond the second it is not.
POSSIBLE, IMPOSSIBLE = 2.0, 3.0
# Two lenses that differ by less give depths within the intervals of most cameras.
MATTERS = 0.05


@dataclass(frozen=True, slots=True)
class People:
    """Statures of the people that a pose and a lens show."""

    median_m: float  # NaN where most of them stand nowhere on the ground
    count: int  # of tracks

    def impossible(self, prior: SizePrior) -> str | None:
        """Return why these cannot be people, or None."""
        if not self.count:
            return None
        if math.isnan(self.median_m):
            return f"most of {self.count} people would have their feet above the horizon"
        low, high = MEDIAN_SHARES if self.count >= FEW else ANYBODY_SHARES
        if low * prior.mean_m <= self.median_m <= high * prior.mean_m:
            return None
        return f"the median of {self.count} people would be {self.median_m:.2f} m tall"

    def deviation(self, prior: SizePrior) -> float:
        """Return how far the median is from the mean stature, in its standard deviations."""
        if math.isnan(self.median_m):
            return math.inf
        std_m = math.hypot(prior.mean_uncertainty_m, prior.std_m / math.sqrt(max(self.count, 1)))
        return abs(self.median_m - prior.mean_m) / std_m


def people_of(measured: Measured, plane: GroundPlane, prior: SizePrior) -> People:
    """Return the statures of people under a pose: the median of the medians of their tracks."""
    rows = (measured.class_name == prior.object_class) & ~measured.height_cut
    seen = replace(measured.take(np.asarray(rows)), ground_plane=plane, others=None)
    if not len(seen) or seen.intrinsics is None:
        return People(math.nan, 0)
    foot, head = Ends(Directions(seen)).both
    depth_m = foot_depth_m(plane.camera_height_m, plane.tilt_rad, foot[:, 1])
    tall_m = np.asarray(height_m(depth_m, foot[:, 1], head[:, 1], plane.tilt_rad))
    statures = np.array([_median(tall_m[seen.track_id == t]) for t in np.unique(seen.track_id)])
    return People(_median(statures), len(statures))


def _median(values_m: np.ndarray) -> float:
    """Return the median; NaN where most are unknown, as who stands nowhere has no stature."""
    known = np.isfinite(values_m)
    return float(np.median(values_m[known])) if 2 * known.sum() > len(values_m) else math.nan


def refused_pose(camera: str, plane: GroundPlane, reason: str) -> Diagnostic:
    """Return what is told of a pose under which people are impossible."""
    source = "the camera file" if plane.source == "given" else "the transforms of the recording"
    return Diagnostic(
        Severity.WARNING,
        "impossible_people",
        f"the pose by {source} ({plane.camera_height_m:.2f} m high, tilt "
        f"{math.degrees(plane.tilt_rad):.1f} degrees) is not used: {reason}. Check the camera's "
        "height above the ground that people walk on (a map may lie at sea level: [ingest] "
        "ground_frame names another frame), its frame (optical: x right, y down, z ahead), the "
        "lens, "
        "and that boxes are in pixels of the stored picture. Other people than adults need a "
        "[[size_prior]]",
        camera=camera,
    )


def lens_by_people(
    row: CameraRow, measured: Measured, plane: GroundPlane | None, prior: SizePrior
) -> tuple[CameraRow, Diagnostic | None]:
    """Return a camera with the lens of raw or of rectified pictures, as people tell.

    Args:
        row: the camera, whose topic does not tell which they are (`rectified` is known).
        measured: people, with the lens of raw pictures.
        plane: the pose, given or by transforms; None if unknown: then people cannot tell.
        prior: of their stature.
    """
    other = row.rectified
    if other is None or row.fx_px is None or row.intrinsics_source != "recording":
        return row, None
    changed = row.with_lens(other, "recording")
    if plane is not None:
        raw = people_of(measured, plane, prior)
        flat = people_of(replace(measured, intrinsics=other), plane, prior)
        told = (
            f"with K and its distortion the median of {raw.count} people is {raw.median_m:.2f} m "
        )
        told += f"tall, with P and none {flat.median_m:.2f} m"
        if raw.count and raw.deviation(prior) > IMPOSSIBLE and flat.deviation(prior) < POSSIBLE:
            return changed, _told(row.camera, f"the pictures are taken as rectified: {told}")
        if raw.count and flat.deviation(prior) > IMPOSSIBLE and raw.deviation(prior) < POSSIBLE:
            return row, None
    if abs(other.fx_px / row.fx_px - 1) < MATTERS:
        return row, None
    text = (
        f"whether the pictures are rectified is not known: K with its distortion is used "
        f"({row.fx_px:.0f} px); if they are, P holds ({other.fx_px:.0f} px, no distortion): say so "
        "with fx_px in a camera file, and distances change by about as much"
    )
    return row, _told(row.camera, text)


def _told(camera: str, text: str) -> Diagnostic:
    return Diagnostic(Severity.WARNING, "rectified_pictures", text, camera=camera)


def with_tilt(config: Config, camera: str, tilt: Tilt) -> tuple[Config, list[Diagnostic]]:
    """Return the configuration with a camera's tilt by its people, and a note of it.

    A tilt that the camera file states stays.

    Args:
        config: the configuration.
        camera: the camera's name.
        tilt: as `walkers.tilt.tilt_of_people` gives it.
    """
    entry = config.camera_named(camera)
    if math.isfinite(entry.tilt_deg):
        return config, []
    tilt_deg, std_deg = math.degrees(tilt.tilt_rad), math.degrees(tilt.std_rad)
    found = replace(entry, tilt_deg=tilt_deg, tilt_std_deg=std_deg)
    others = tuple(c for c in config.camera if c.name != camera)
    note = Diagnostic(
        Severity.INFO,
        "tilt_from_people",
        f"tilt by the people, who fix no pose: {tilt_deg:.1f} \u00b1 {std_deg:.1f} degrees "
        f"(one standard "
        "error); distances from their sizes allow for it. tilt_deg in a camera file replaces it",
        camera=camera,
    )
    return replace(config, camera=(*others, found)), [note]
