"""The note of what the scale of distances and heights rests on, for `diagnostics`."""

from __future__ import annotations

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from pipeline.calibrate.walkers.segments import Segments
from pipeline.core.camera_row import CameraRow
from pipeline.core.config import ADULT, Config, SizePrior
from pipeline.core.records import Diagnostic, GroundPlane, Severity

CONTRADICTED = 3.0  # standard deviations: of 370 true lengths one is so far off


def scale_notes(
    camera: str, plane: GroundPlane | None, tracks: pa.Table, config: Config
) -> list[Diagnostic]:
    """Return a note if the scale rests on how tall people are taken to be.

    Args:
        camera: its name.
        plane: its pose, None if unknown; one from a survey or a known length has a scale of its own.
        tracks: the camera's rows of `Store.tracks_of`, for the class of those who walk.
        config: the configuration of this camera (`Config.of_camera`).
    """
    prior, entry = config.stature, config.camera_named(camera)
    people = int(pc.sum(pc.greater(tracks["class_count"], 0)).as_py() or 0)
    surveyed = plane is not None and plane.source != "walkers"
    if prior is None or not people or surveyed:
        return []
    if plane is not None and (entry.known_person or entry.known_length):
        count = len(entry.known_person) + len(entry.known_length)
        lengths = "length" if count == 1 else "lengths"
        percent = 100 * float(np.sqrt(plane.covariance[0, 0])) / plane.camera_height_m
        return [
            Diagnostic(
                Severity.INFO,
                "scale_from_known_lengths",
                f"all distances and heights rest on {count} known {lengths} and on the mean "
                f"stature "
                f"of the people here; the camera's height is known to {percent:.1f} % by them (one "
                "standard error)",
                camera=camera,
            )
        ]
    percent = 100 * prior.mean_uncertainty_m / prior.mean_m
    advice = "a known height or length, or a surveyed pose, replaces it"
    if prior == ADULT:
        advice = f'`country = "GB"` (or another) in the camera file narrows it; {advice}'
    return [
        Diagnostic(
            Severity.INFO,
            "scale_from_statures",
            f"all distances and heights rest on the mean stature of the people here, taken to be "
            f"{prior.mean_m:.2f} \u00b1 {prior.mean_uncertainty_m:.2f} m (one standard error; "
            f"{prior.source or 'the size_prior of the camera file'}): they are off by the same "
            f"{percent:.1f} % together; {advice}",
            camera=camera,
        )
    ]


def length_notes(row: CameraRow, plane: GroundPlane | None, config: Config) -> list[Diagnostic]:
    """Return a note for every known length of a camera that its pose contradicts, or that is of no use.

    Args:
        row: the camera, with its lens.
        plane: its pose, None if unknown.
        config: with the camera's known lengths.
    """
    known = config.camera_named(row.camera).known_length
    if not known:
        return []
    if plane is None or row.intrinsics is None:
        return [
            Diagnostic(
                Severity.WARNING,
                "known_length_unused",
                f"{len(known)} known lengths of the camera file are not used, since no pose "
                f"was found: "
                "they fix the scale of a pose, and not its tilt; give camera_height_m and "
                "tilt_deg, or a "
                "recording with people who walk",
                camera=row.camera,
            )
        ]
    pose = plane.camera_height_m, plane.tilt_rad, plane.roll_rad
    segments = Segments.of(known, row.intrinsics, plane)
    slopes = segments.off_jacobian(*pose)
    to_log = np.diag([1 / plane.camera_height_m, 1.0, 1.0])
    of_pose = np.einsum("di,ij,dj->d", slopes, to_log @ plane.covariance @ to_log, slopes)
    off = segments.off(*pose) / np.sqrt(1.0 + of_pose)
    return [
        Diagnostic(
            Severity.WARNING,
            "known_length_contradicted",
            f"the known length of {length.length_m:g} m at {list(length.points_px)} is "
            f"{found_m:.2f} m "
            f"by the camera's pose, {abs(z):.1f} standard deviations off: check the points, "
            f"the length, "
            "and that they are on the ground (or upright on it)",
            camera=row.camera,
        )
        for length, found_m, z in zip(known, segments.found_m(*pose), off, strict=True)
        if abs(z) > CONTRADICTED
    ]


def unlike_prior(camera: str, mean_ratio: float, prior: SizePrior) -> list[Diagnostic]:
    """Return a note if known lengths make the people here unlike those that are expected.

    Args:
        camera: its name.
        mean_ratio: the mean stature here over that of the population.
        prior: the population.
    """
    off = float(np.log(mean_ratio)) * prior.mean_m / prior.mean_uncertainty_m
    if abs(off) <= CONTRADICTED:
        return []
    return [
        Diagnostic(
            Severity.WARNING,
            "people_unlike_prior",
            f"by the known lengths the people here are {mean_ratio * prior.mean_m:.2f} m tall "
            f"in the "
            f"mean, {abs(off):.1f} standard deviations from the {prior.mean_m:.2f} m that are "
            f"expected: "
            "are they children, or is a length wrong? A size_prior in the camera file states "
            "who passes",
            camera=camera,
        )
    ]
