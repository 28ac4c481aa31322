"""All methods on all cameras of a recording: stored tables in, estimates in long form out."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute

from pipeline.core.arrays import FloatArray
from pipeline.core.calibration import Calibration, Method
from pipeline.core.config import Config
from pipeline.core.diagnostics import Notes
from pipeline.core.records import Diagnostic, GroundPlane, Intrinsics
from pipeline.core.tables import CALIBRATIONS, ESTIMATES, OBSERVATION_QUALITY, TRACK_HEIGHTS
from pipeline.estimate.applicability import Classes, not_applicable, outside_calibration
from pipeline.estimate.boxes.geometry import Geometry
from pipeline.estimate.boxes.quality import Quality, assess, with_track
from pipeline.estimate.boxes.reach import with_reach
from pipeline.estimate.fusion import fused
from pipeline.estimate.fusion.one_person import with_doubt
from pipeline.estimate.fusion.smooth_heights import smooth_heights
from pipeline.estimate.gait import as_standing
from pipeline.estimate.methods import aperture, defocus, ground, inverse, size
from pipeline.estimate.track_heights import track_heights
from pipeline.estimate.types import Boxes, Estimated, Measured

METHODS: Mapping[Method, Callable[[Geometry, Config], Estimated]] = {
    Method.APERTURE: aperture.estimate,
    Method.INVERSE: inverse.estimate,
    Method.SIZE: size.estimate,
    Method.GROUND: lambda geometry, config: ground.estimate(geometry),
}


@dataclass(frozen=True, slots=True)
class Estimates:
    """What pass 2 makes of a recording."""

    estimates: pa.Table
    track_heights: pa.Table
    calibrations: pa.Table
    quality: pa.Table
    diagnostics: list[Diagnostic]


@dataclass(frozen=True, slots=True)
class Rows:
    """What pass 2 makes of some tracks of a camera, as rows of the tables."""

    estimates: pa.Table
    track_heights: pa.Table
    quality: pa.Table

    def by_table(self) -> dict[str, pa.Table]:
        """Return them by the name of their table."""
        return {
            "estimates": self.estimates,
            "track_heights": self.track_heights,
            "observation_quality": self.quality,
        }


class Said:
    """What is to be said of a recording besides its rows, summed over batches of its tracks."""

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
    said = Said(config)
    rows = [
        estimate_tracks(measured, config, said)
        for measured in measured_by_camera(observations, frames, cameras, poses)
    ]
    return Estimates(
        pa.concat_tables([ESTIMATES.empty_table(), *(r.estimates for r in rows)]),
        pa.concat_tables([TRACK_HEIGHTS.empty_table(), *(r.track_heights for r in rows)]),
        said.calibrations(),
        pa.concat_tables([OBSERVATION_QUALITY.empty_table(), *(r.quality for r in rows)]),
        said.diagnostics(),
    )


def estimate_tracks(
    measured: Measured, config: Config, said: Said, blur: defocus.CameraBlur | None = None
) -> Rows:
    """Run every method that applies on whole tracks of a camera.

    A track's rows do not depend on which other tracks come with it, as long as the boxes of those that
    do not are among `measured.others`.

    Args:
        measured: the tracks.
        config: calibrations and priors.
        said: takes what is to be said of them.
        blur: what the blur of all of the camera says, where these are some of its tracks.
    """
    quality, geometry, made = _apart(measured, config)
    by_blur, notes = defocus.estimate(geometry, config, made, blur)
    said.add(notes)
    if np.isfinite(by_blur.depth_m).any():
        made[Method.DEFOCUS] = by_blur
    if made:
        best, quality = fuse(geometry, made, quality, config)
        for member in made.values():
            as_standing(measured, member, best.speed_m_s, member.height_assumed)
        made[Method.FUSED] = best
    said.count(measured, made.values())
    for method, estimated in made.items():
        said.add(outside_calibration(measured, estimated, method))
    heights = [track_heights(measured, e, m, config.size_prior) for m, e in made.items()]
    if Method.FUSED in made:
        smooth_heights(measured, made[Method.FUSED], fused.lasts_s(geometry))
    rows = [_long(measured, e, method) for method, e in made.items()]
    return Rows(
        pa.concat_tables([ESTIMATES.empty_table(), *rows]),
        pa.concat_tables([TRACK_HEIGHTS.empty_table(), *heights]),
        quality.table(measured),
    )


def fuse(
    geometry: Geometry, made: dict[Method, Estimated], quality: Quality, config: Config
) -> tuple[Estimated, Quality]:
    """Return the best of all methods, and how good the boxes are beside their tracks.

    What the ground says of tracks that may be no one person is widened in place.
    """
    by_ground = made.get(Method.GROUND)
    if by_ground is None:
        return fused.estimate(geometry, made), quality
    track = fused.beside_track(geometry, by_ground, quality)
    with_doubt(geometry, by_ground, track, config.size_prior)
    best = fused.estimate(geometry, made, track)
    best.height_doubt_m = by_ground.height_doubt_m
    return best, with_track(quality, track)


def camera_blur(measured: Measured, config: Config) -> defocus.CameraBlur:
    """Return what the blur of a camera says, by a fair sample of its tracks."""
    _, geometry, made = _apart(measured, config)
    return defocus.learn(geometry, config, made)


def _apart(measured: Measured, config: Config) -> tuple[Quality, Geometry, dict[Method, Estimated]]:
    """Return how good the boxes are, their geometry, and what each method makes of them by itself.

    A method that has no depth is left out; but where the pose is known it says something of every
    track that there is none by the ground, so this is kept.
    """
    quality = assess(measured)
    geometry = ground.with_scatter(with_reach(quality.applied(measured)))
    made = {method: run(geometry, config) for method, run in METHODS.items()}
    posed = measured.ground_plane is not None and measured.intrinsics is not None
    kept = {Method.GROUND} if posed else set()
    made = {m: e for m, e in made.items() if m in kept or np.isfinite(e.depth_m).any()}
    return quality, geometry, made


def measured_by_camera(
    observations: pa.Table,
    frames: pa.Table,
    cameras: pa.Table,
    poses: Mapping[str, GroundPlane],
) -> list[Measured]:
    """Return the observations of each camera, joined with their frames, as arrays."""
    lens = frames.select(
        [
            "camera",
            "frame_index",
            "capture_time_ns",
            "exposure_time_s",
            "f_number",
            "focal_length_mm",
            "focus_distance_m",
            "pixel_pitch_x_um",
            "pixel_pitch_y_um",
        ]
    )
    joined = observations.join(lens, ["camera", "frame_index"], join_type="inner")
    joined = joined.sort_by("observation_index")
    result = []
    for camera in cameras.to_pylist():
        name = camera["camera"]
        mine = joined.filter(pa.compute.equal(joined["camera"], name))
        if mine.num_rows:
            result.append(measured_of(mine, camera, poses.get(name)))
    return result


def measured_of(
    table: pa.Table,
    camera: Mapping[str, Any],
    plane: GroundPlane | None,
    others: pa.Table | None = None,
) -> Measured:
    """Return observations of one camera, joined with their frames, as arrays.

    Args:
        table: the observations, in the order of their number.
        camera: the camera's row of the table `cameras`.
        plane: its pose, where it is known.
        others: index, frame and box of what else is in their frames.
    """

    def number(name: str) -> FloatArray:
        return np.asarray(table[name].to_numpy(), dtype=np.float64)

    sides = ("x_min", "y_min", "x_max", "y_max")
    names = table["class_name"].combine_chunks().dictionary_encode("encode")
    cuts = ("left", "top", "right", "bottom")
    return Measured(
        camera=camera["camera"],
        observation_index=table["observation_index"].to_numpy(),
        frame_index=table["frame_index"].to_numpy(),
        capture_time_ns=table["capture_time_ns"].to_numpy(),
        track_id=table["track_id"].to_numpy(),
        class_name=np.array(names.dictionary.to_pylist(), dtype=np.object_)[
            names.indices.to_numpy()
        ],
        bbox_xyxy_px=np.stack([number(f"{s}_px") for s in sides], axis=1),
        std_xyxy_px=np.nan_to_num(np.stack([number(f"{s}_std_px") for s in sides], axis=1)),
        truncated=np.stack(
            [table[f"truncated_{c}"].to_numpy().astype(np.bool_) for c in cuts], axis=1
        ),
        occlusion=np.nan_to_num(number("occlusion")),
        f_number=number("f_number"),
        focal_length_mm=number("focal_length_mm"),
        focus_distance_m=number("focus_distance_m"),
        pixel_pitch_x_um=number("pixel_pitch_x_um"),
        pixel_pitch_y_um=number("pixel_pitch_y_um"),
        intrinsics=_intrinsics(camera),
        ground_plane=plane,
        exposure_time_s=number("exposure_time_s"),
        blur_sigma_px=number("blur_sigma_px"),
        blur_std_px=number("blur_std_px"),
        others=None if others is None or not others.num_rows else _boxes(others),
    )


def _boxes(table: pa.Table) -> Boxes:
    sides = [table[f"{s}_px"].to_numpy() for s in ("x_min", "y_min", "x_max", "y_max")]
    return Boxes(
        table["observation_index"].to_numpy(),
        table["frame_index"].to_numpy(),
        np.stack(sides, axis=1).astype(np.float64),
    )


def _intrinsics(camera: Mapping[str, Any]) -> Intrinsics | None:
    if camera["fx_px"] is None:
        return None
    numbers = {k: camera[k] for k in ("width_px", "height_px", "fx_px", "fy_px", "cx_px", "cy_px")}
    return Intrinsics(
        **numbers,
        distortion_model=str(camera["distortion_model"] or ""),
        distortion=tuple(camera["distortion"] or ()),
    )


def _long(measured: Measured, estimated: Estimated, method: Method) -> pa.Table:
    """Return the rows of a method that have a depth, in the schema of the table `estimates`."""
    known = np.isfinite(estimated.depth_m)
    in_range = estimated.in_calibrated_range
    columns: dict[str, object] = {
        name: getattr(estimated, name)[known]
        for name in ESTIMATES.names
        if hasattr(estimated, name) and name != "in_calibrated_range"
    }
    columns["observation_index"] = measured.observation_index[known]
    columns["method"] = pa.repeat(
        pa.scalar(str(method), ESTIMATES.field("method").type), int(known.sum())
    )
    columns["in_calibrated_range"] = pa.array(in_range[known] > 0, mask=np.isnan(in_range[known]))
    arrays = [pa.array(columns[f.name], type=f.type, from_pandas=True) for f in ESTIMATES]
    return pa.Table.from_arrays(arrays, schema=ESTIMATES)


def calibrations_table(calibrations: list[Calibration]) -> pa.Table:
    """Return calibrations as rows of the table `calibrations`, one a parameter."""
    pairs = [(c, p) for c in calibrations for p in c.parameters]
    columns: dict[str, list[object]] = {
        "parameter": [p.name for _, p in pairs],
        "f_number": [p.f_number for _, p in pairs],
        "value": [p.value for _, p in pairs],
        "std_error": [p.std_error for _, p in pairs],
    }
    for name in CALIBRATIONS.names:
        if name not in columns:
            columns[name] = [_plain(getattr(c, name)) for c, _ in pairs]
    arrays = [pa.array(columns[f.name], type=f.type, from_pandas=True) for f in CALIBRATIONS]
    return pa.Table.from_arrays(arrays, schema=CALIBRATIONS)


def _plain(value: object) -> object:
    return str(value) if isinstance(value, str) else value
