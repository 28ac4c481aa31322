"""Change of a height and a distance when one assumption is another: the track estimated again.

Each line changes one thing and leaves all others: the whole of pass 2 is run on this one track.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from pipeline.core.records import GroundPlane
from pipeline.estimate.estimate_tracks import Remarks, estimate_tracks
from pipeline.estimate.methods import FUSED
from pipeline.estimate.track_batches import Tracks
from pipeline.estimate.types import Measured
from pipeline.run.stored_camera import StoredCamera
from pipeline.statement.evidence import Evidence
from pipeline.store.database import Store

# What is changed where no deviation is stored: a survey's, and that of a good calibration.
USUAL_HEIGHT_STD = 0.01  # relative
USUAL_ANGLE_STD_RAD = math.radians(0.5)
USUAL_FOCAL_STD = 0.01  # relative
END_PX = 1.0
_OF_POSE = ("height of the camera alone", "tilt alone", "roll alone")


@dataclass(frozen=True, slots=True)
class Change:
    """One assumption, by how much it is changed, and what that does."""

    assumption: str
    by: str
    height_change_m: float
    depth_change_m: float
    of_pose: bool = False  # by a deviation of the pose that is part of the interval


def sensitivities(store: Store, evidence: Evidence) -> list[Change]:
    """Return what each assumption does to the height of a track and its median depth.

    Empty where the pose or the lens is not known, or the track has no height.
    """
    plane, height = evidence.plane, evidence.height
    if plane is None or height is None or evidence.camera.intrinsics is None:
        return []
    tracks = Tracks(
        np.array([evidence.subject.track_id]),
        np.array([evidence.frames[0]["frame_index"]]),
        np.array([evidence.frames[-1]["frame_index"]]),
        np.array([len(evidence.frames)]),
    )
    camera = StoredCamera(store, evidence.subject.recording_id, evidence.camera, plane)
    measured = camera.measured(tracks)
    config = evidence.config.of_camera(evidence.camera.camera)

    def estimated(changed: Measured) -> tuple[float, float]:
        rows = estimate_tracks(changed, config, Remarks(config))
        own = [r for r in rows.track_heights.to_pylist() if r["method"] == FUSED]
        if not own or own[0]["height_m"] is None:
            return math.nan, math.nan
        return float(own[0]["height_m"]), float(own[0]["depth_median_m"])

    base = estimated(measured)
    found = []
    for assumption, by, change in _changes(evidence, plane):
        tall_m, depth_m = estimated(change(measured))
        stated = bool(plane.covariance.any()) and assumption in _OF_POSE
        found.append(Change(assumption, by, tall_m - base[0], depth_m - base[1], stated))
    return found


def _changes(
    evidence: Evidence, plane: GroundPlane
) -> Iterator[tuple[str, str, Callable[[Measured], Measured]]]:
    std = np.sqrt(np.diag(plane.covariance))
    above_m = float(std[0]) or USUAL_HEIGHT_STD * plane.camera_height_m
    tilt, roll = (float(s) or USUAL_ANGLE_STD_RAD for s in std[1:])
    prior = evidence.config.of_camera(evidence.camera.camera).stature
    if plane.source == "walkers" and prior is not None and prior.mean_std_m > 0:
        share = prior.mean_std_m / prior.mean_m
        yield (
            "mean stature of the people here",
            f"+{100 * prior.mean_std_m:.1f} cm",
            _posed(plane, replace(plane, camera_height_m=plane.camera_height_m * (1 + share))),
        )
    higher = replace(plane, camera_height_m=plane.camera_height_m + above_m)
    yield "height of the camera alone", f"+{above_m:.2f} m", _posed(plane, higher)
    steeper = replace(plane, tilt_rad=plane.tilt_rad + tilt)
    yield "tilt alone", f"+{math.degrees(tilt):.2f} degrees", _posed(plane, steeper)
    rolled = replace(plane, roll_rad=plane.roll_rad + roll)
    yield "roll alone", f"+{math.degrees(roll):.2f} degrees", _posed(plane, rolled)
    focal = evidence.pose["focal_std_px"]
    share = focal / evidence.pose["fx_px"] if focal else USUAL_FOCAL_STD
    yield "focal length alone", f"+{share:.1%}", _longer(share)
    yield "heads (upper ends of boxes)", f"{END_PX:.0f} px higher", _moved(1, -END_PX)
    yield "feet (lower ends of boxes)", f"{END_PX:.0f} px lower", _moved(3, END_PX)


def _posed(before: GroundPlane, plane: GroundPlane) -> Callable[[Measured], Measured]:
    return lambda m: replace(m, ground_plane=plane)


def _longer(share: float) -> Callable[[Measured], Measured]:
    def change(m: Measured) -> Measured:
        k = m.intrinsics
        if k is None:
            return m
        return replace(
            m, intrinsics=replace(k, fx_px=k.fx_px * (1 + share), fy_px=k.fy_px * (1 + share))
        )

    return change


def _moved(edge: int, by_px: float) -> Callable[[Measured], Measured]:
    step = np.zeros(4)
    step[edge] = by_px

    def change(m: Measured) -> Measured:
        raw = m.raw_bbox_xyxy_px
        return replace(
            m,
            bbox_xyxy_px=m.bbox_xyxy_px + step,
            raw_bbox_xyxy_px=raw + step if raw is not None else None,
        )

    return change
