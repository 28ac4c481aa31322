"""The note of what the scale of distances and heights rests on, for `diagnostics`."""

from __future__ import annotations

import pyarrow as pa
import pyarrow.compute as pc

from pipeline.core.config import ADULT, Config
from pipeline.core.records import Diagnostic, GroundPlane, Severity


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
    prior = config.stature
    people = int(pc.sum(pc.greater(tracks["class_count"], 0)).as_py() or 0)
    surveyed = plane is not None and plane.source != "walkers"
    if prior is None or not people or surveyed:
        return []
    percent = 100 * prior.mean_uncertainty_m / prior.mean_m
    advice = "a known height or distance, or a surveyed pose, replaces it"
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
