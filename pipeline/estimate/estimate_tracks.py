"""Every method on every camera of a recording: observations in, rows of estimates out."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np
import pyarrow as pa

from pipeline.core.config import Config
from pipeline.core.diagnostics import Notes
from pipeline.core.records import Diagnostic, GroundPlane
from pipeline.core.tables import ESTIMATES, OBSERVATION_QUALITY, TRACK_HEIGHTS
from pipeline.estimate.applicability import Classes, not_applicable, outside_calibration
from pipeline.estimate.boxes.geometry import Geometry
from pipeline.estimate.boxes.joint_slopes import log_slopes
from pipeline.estimate.boxes.quality import Quality, assess, with_track
from pipeline.estimate.boxes.reach import with_reach
from pipeline.estimate.cadence import cadences
from pipeline.estimate.fusion import fused
from pipeline.estimate.fusion.one_person import with_doubt
from pipeline.estimate.fusion.smooth_heights import smooth_heights
from pipeline.estimate.gait import as_standing
from pipeline.estimate.methods import FUSED, GROUND, METHODS, defocus, ground
from pipeline.estimate.tables import (
    Rows,
    calibrations_table,
    estimates_table,
    measured_by_camera,
)
from pipeline.estimate.track_heights import track_heights
from pipeline.estimate.turned import as_turned, shares_of, turn_notes
from pipeline.estimate.types import CameraBlur, Estimated, Measured


@dataclass(frozen=True, slots=True)
class Estimates:
    """Rows of the tables that pass 2 makes of a recording."""

    estimates: pa.Table
    track_heights: pa.Table
    calibrations: pa.Table
    quality: pa.Table
    diagnostics: list[Diagnostic]


class Remarks:
    """Diagnostics of a recording and the calibrations that it used, summed over batches of its tracks."""

    def __init__(self, config: Config) -> None:
        self._config = config
        self._notes = Notes()
        self._classes: dict[str, Classes] = {}
        self._used: set[str] = set()

    def add(self, notes: Iterable[Diagnostic]) -> None:
        """Add diagnostics; equal ones become one, and their counts are summed."""
        for note in notes:
            self._notes.add(note)

    def count(self, measured: Measured, made: Iterable[Estimated]) -> None:
        """Count a batch's classes, and keep which calibrations its estimates used."""
        self._classes.setdefault(measured.camera, Classes()).add(measured, self._config)
        for estimated in made:
            self._used |= set(estimated.calibration_id) - {None}

    def diagnostics(self) -> list[Diagnostic]:
        """Return all that is to be said."""
        for camera, classes in self._classes.items():
            self.add(not_applicable(camera, classes, self._config))
        self._classes.clear()
        return list(self._notes)

    def calibrations(self) -> pa.Table:
        """Return the calibrations that were used, as rows of the table."""
        used = {c.calibration_id: c for c in self._config.calibration}
        return calibrations_table([c for key, c in used.items() if key in self._used])


def estimate(
    observations: pa.Table,
    frames: pa.Table,
    cameras: pa.Table,
    poses: Mapping[str, GroundPlane],
    config: Config,
) -> Estimates:
    """Run every method that applies on every camera of a recording, all of it at once.

    Args:
        observations: a recording's rows of this table.
        frames: its rows of this one.
        cameras: and of this.
        poses: the ground plane of each camera whose pose is known.
        config: calibrations and priors.
    """
    remarks = Remarks(config)
    rows = [
        estimate_tracks(measured, config, remarks)
        for measured in measured_by_camera(observations, frames, cameras, poses)
    ]
    return Estimates(
        pa.concat_tables([ESTIMATES.empty_table(), *(r.estimates for r in rows)]),
        pa.concat_tables([TRACK_HEIGHTS.empty_table(), *(r.track_heights for r in rows)]),
        remarks.calibrations(),
        pa.concat_tables([OBSERVATION_QUALITY.empty_table(), *(r.quality for r in rows)]),
        remarks.diagnostics(),
    )


def estimate_tracks(measured: Measured, config: Config, remarks: Remarks) -> Rows:
    """Run every method that applies on whole tracks of a camera.

    A track's rows do not depend on which other tracks come with it, as long as the boxes of those that
    do not are among `measured.others`, and what the blur of all of them says is `measured.camera_blur`.

    Args:
        measured: the tracks.
        config: calibrations and priors.
        remarks: takes what is to be said of them.
    """
    quality, geometry = _judged(measured, config)
    made = _run(geometry, {}, config, remarks, asks_others=False)
    made = _run(geometry.after(made), made, config, remarks, asks_others=True)
    if made:
        best, made, quality = fuse(geometry, made, quality, config)
        made = {
            name: as_standing(measured, e, best.speed_m_s, e.height_assumed)
            for name, e in made.items()
        }
        made[FUSED] = best
    share = shares_of(measured, config.estimate)
    made = {name: as_turned(e, share) for name, e in made.items()}
    remarks.add(turn_notes(measured, made.values(), config.estimate))
    remarks.count(measured, made.values())
    for name, estimated in made.items():
        remarks.add(outside_calibration(measured, estimated, name))
    joint = None if measured.ground_plane is None else measured.ground_plane.joint
    slopes = None if joint is None else log_slopes(geometry, joint)[1]
    heights = [
        track_heights(
            measured,
            e,
            name,
            config.size_prior,
            slopes if name in (GROUND, FUSED) else None,
            config.camera_named(measured.camera).known_person if name == FUSED else (),
        )
        for name, e in made.items()
    ]
    if FUSED in made:
        made[FUSED] = smooth_heights(measured, made[FUSED], fused.lasts_s(geometry))
    rows = [estimates_table(measured, e, name) for name, e in made.items()]
    return Rows(
        pa.concat_tables([ESTIMATES.empty_table(), *rows]),
        pa.concat_tables([TRACK_HEIGHTS.empty_table(), *heights]),
        quality.table(measured),
        cadences(measured, made[FUSED].speed_m_s if FUSED in made else None),
    )


def fuse(
    geometry: Geometry, made: Mapping[str, Estimated], quality: Quality, config: Config
) -> tuple[Estimated, dict[str, Estimated], Quality]:
    """Return the best of all methods, what each of them says then, and how good the boxes are.

    What the ground says of tracks that may be no one person is widened, and boxes that do not go with
    their track are marked.
    """
    members = dict(made)
    by_ground = members.get(GROUND)
    if by_ground is None:
        return fused.estimate(geometry, members), members, quality
    track = fused.beside_track(geometry, by_ground, quality)
    members[GROUND] = with_doubt(geometry, by_ground, track, config.size_prior)
    best = fused.estimate(geometry, members, track)
    best = replace(best, height_doubt_m=members[GROUND].height_doubt_m)
    return best, members, with_track(quality, track)


def camera_blur(measured: Measured, config: Config) -> CameraBlur:
    """Return what the blur of a camera says, by a fair sample of its tracks."""
    _, geometry = _judged(measured, config)
    made = _run(geometry, {}, config, Remarks(config), asks_others=False)
    return defocus.learn(geometry.after(made), config)


def _judged(measured: Measured, config: Config) -> tuple[Quality, Geometry]:
    """Return how good the boxes are, and their geometry with deviations that tell it."""
    quality = assess(measured)
    return quality, ground.with_scatter(with_reach(quality.applied(measured)), config)


def _run(
    geometry: Geometry,
    made: Mapping[str, Estimated],
    config: Config,
    remarks: Remarks,
    *,
    asks_others: bool,
) -> dict[str, Estimated]:
    """Return what is made already, and what each method of one kind makes of the boxes by itself.

    A method that has no depth is left out; but where the pose is known it says something of every
    track that there is none by the ground, so this is kept.
    """
    m, found = geometry.measured, dict(made)
    posed = m.ground_plane is not None and m.intrinsics is not None
    for method in METHODS:
        if method.estimate is None or method.asks_others is not asks_others:
            continue
        estimated = method.estimate(geometry, config)
        remarks.add(estimated.notes)
        if np.isfinite(estimated.depth_m).any() or (posed and method.name == GROUND):
            found[method.name] = estimated
    return found
