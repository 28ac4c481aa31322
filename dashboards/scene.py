"""The scene in metres: the camera, people at their size where they stand, their trails, the truth.

The world is x right, y ahead, z up. Its origin is on the ground below the camera, or in the camera
where the pose is unknown.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import pyarrow as pa
import rerun as rr

from dashboards.columns import BoolArray, CameraRows
from dashboards.names import path
from dashboards.stream import send_sets
from dashboards.style import TRUTH, packed, tinted
from pipeline.records import FloatArray, IntArray

# A trail fades in steps: the same line in three entities, each showing an age, in frames, and dimmer.
TRAILS = {"recent": (0, 30, 1.0), "older": (30, 75, 0.6), "oldest": (75, 150, 0.3)}
# A track that was away for longer has no line from where it left to where it came back.
LONGEST_GAP_FRAMES = 8
# Depth of a body along the line of sight cannot be seen; a person's is about this.
DEEPEST_M = 0.3


@dataclass(frozen=True, slots=True)
class Pose:
    """A camera above the ground."""

    height_m: float
    tilt_rad: float
    roll_rad: float
    known: bool

    @classmethod
    def of(cls, camera: Mapping[str, Any]) -> Pose:
        """Return the pose of a row of the table `cameras`; unknown is level, at the origin."""
        height_m = camera["camera_height_m"]
        if height_m is None or not math.isfinite(height_m):
            return cls(0.0, 0.0, 0.0, False)
        return cls(float(height_m), camera["tilt_rad"] or 0.0, camera["roll_rad"] or 0.0, True)

    def world_from_camera(self) -> FloatArray:
        """Return the rotation (3, 3) of camera axes (x right, y down, z ahead) into the world."""
        cos, sin = math.cos(self.tilt_rad), math.sin(self.tilt_rad)
        tilt = np.array([[1, 0, 0], [0, -sin, cos], [0, -cos, -sin]])
        c, s = math.cos(self.roll_rad), math.sin(self.roll_rad)
        return np.asarray(tilt @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]))


def log_camera(stream: rr.RecordingStream, rows: CameraRows, frustum_m: float) -> None:
    """Log where the camera is and how it sees; lens distortion is not drawn."""
    camera, pose = rows.camera, Pose.of(rows.camera)
    world = path("cameras", rows.name)
    stream.log(world, rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    if not lens_known(camera):
        return
    stream.log(
        path("cameras", rows.name, "camera"),
        rr.Transform3D(translation=[0, 0, pose.height_m], mat3x3=pose.world_from_camera()),
        rr.Pinhole(
            image_from_camera=[
                [camera["fx_px"], 0, camera["cx_px"] + 0.5],
                [0, camera["fy_px"], camera["cy_px"] + 0.5],
                [0, 0, 1],
            ],
            resolution=[camera["width_px"], camera["height_px"]],
            camera_xyz=rr.ViewCoordinates.RDF,
            image_plane_distance=frustum_m,
        ),
        static=True,
    )


def lens_known(camera: Mapping[str, Any]) -> bool:
    """Return whether the camera can be drawn in the scene."""
    return all(camera[name] for name in ("fx_px", "fy_px", "width_px", "height_px"))


def log_people(stream: rr.RecordingStream, rows: CameraRows) -> None:
    """Log each object where it stands, at its size, with its trail and its truth."""
    if not lens_known(rows.camera):
        return
    best, seen = rows.best, rows.observations
    placed = np.isfinite(best.x_m) & np.isfinite(best.y_m)
    width_px = seen.bbox_xyxy_px[:, 2] - seen.bbox_xyxy_px[:, 0]
    width_m = width_px * best.depth_m / rows.camera["fx_px"]
    height_m = np.where(np.isfinite(best.height_m), best.height_m, 0.0)
    standing = Pose.of(rows.camera).known
    centre, half = _blocks(best.x_m, best.y_m, width_m, height_m, standing)
    centre, half, track = centre[placed], half[placed], seen.track[placed]
    colour = packed(rows.tracks.colour)[track]
    names = np.array([f"#{i}" for i in rows.tracks.track_id.tolist()], dtype=object)
    send_sets(
        stream,
        path("cameras", rows.name, "people"),
        rows.frames,
        seen.row[placed],
        lambda part: rr.Boxes3D.columns(
            centers=centre[part],
            half_sizes=half[part],
            colors=colour[part],
        ),
    )
    feet = centre - half * [0.0, 0.0, 1.0]
    text_colour = packed(tinted(rows.tracks.colour))[track]
    send_sets(
        stream,
        path("cameras", rows.name, "numbers"),
        rows.frames,
        seen.row[placed],
        lambda part: rr.Points3D.columns(
            positions=feet[part],
            colors=text_colour[part],
            radii=np.zeros(len(track[part]), dtype=np.float32),
            labels=names[track[part]].tolist(),
            show_labels=np.ones(len(track[part]), dtype=np.bool_),
        ),
    )
    if not rows.is_series_of_pictures:
        _log_trails(stream, rows, seen.row[placed], track, feet)
    _log_truth(stream, rows, (width_m, height_m), standing)


def _blocks(
    x_m: FloatArray, y_m: FloatArray, width_m: FloatArray, height_m: FloatArray, standing: bool
) -> tuple[FloatArray, FloatArray]:
    """Return centre and half size of blocks, (n, 3), on the ground or around the optical axis."""
    thick_m = np.minimum(width_m, DEEPEST_M)
    half = np.column_stack([width_m, thick_m, height_m]) / 2
    centre = np.column_stack([x_m, y_m, half[:, 2] if standing else np.zeros(len(x_m))])
    return centre, half


def _log_trails(
    stream: rr.RecordingStream, rows: CameraRows, row: IntArray, track: IntArray, feet: FloatArray
) -> None:
    """Log the step that each track made to be where it is; the view shows those of some time back."""
    here, before = _steps(row, track)
    steps = np.stack([feet[before], feet[here]], axis=1)
    for age, (_, _, share) in TRAILS.items():
        colour = packed((rows.tracks.colour * share).astype(np.uint8))[track[here]]
        send_sets(
            stream,
            path("cameras", rows.name, "trails", age),
            rows.frames,
            row[here],
            lambda part, colour=colour: rr.LineStrips3D.columns(  # type: ignore[misc]
                strips=_strips(steps[part]), colors=colour[part]
            ),
        )


def _steps(row: IntArray, track: IntArray) -> tuple[IntArray, IntArray]:
    """Return which points follow which: (m,) each, in the order of the frames."""
    order = np.lexsort((row, track))
    follows = (np.diff(track[order]) == 0) & (np.diff(row[order]) <= LONGEST_GAP_FRAMES)
    here, before = order[1:][follows], order[:-1][follows]
    by_frame = np.argsort(here, kind="stable")
    return here[by_frame], before[by_frame]


def _strips(steps: FloatArray) -> pa.Array:
    """Return lines of two points, (n, 2, 3), as Rerun stores them; its own way is a loop."""
    kind = rr.components.LineStrip3DBatch._ARROW_DATATYPE
    points = pa.FixedSizeListArray.from_arrays(
        pa.array(steps.astype(np.float32).ravel()), type=kind.value_type
    )
    ends = np.arange(0, 2 * len(steps) + 1, 2, dtype=np.int32)
    return pa.ListArray.from_arrays(pa.array(ends), points, type=kind)


def _log_truth(
    stream: rr.RecordingStream,
    rows: CameraRows,
    seen_size_m: tuple[FloatArray, FloatArray],
    standing: bool,
) -> None:
    """Log blocks where things truly were: surveyed, or in the direction of what was matched.

    A side that is not known is that of what was seen there, or nothing.
    """
    truth, width_m, height_m = rows.truth, np.full(1, DEEPEST_M), np.zeros(1)
    if not _known(truth.x_m, truth.y_m).any() and rows.matched is not None:
        truth, (width_m, height_m) = rows.matched, seen_size_m
    placed = _known(truth.x_m, truth.y_m)
    width_m = np.where(np.isfinite(truth.width_m), truth.width_m, width_m)
    height_m = np.where(np.isfinite(truth.height_m), truth.height_m, height_m)
    centre, half = _blocks(truth.x_m, truth.y_m, width_m, height_m, standing)
    centre, half = centre[placed], half[placed]
    send_sets(
        stream,
        path("cameras", rows.name, "truth"),
        rows.frames,
        truth.row[placed],
        lambda part: rr.Boxes3D.columns(
            centers=centre[part],
            half_sizes=half[part],
            colors=[TRUTH] * len(centre[part]),
        ),
    )


def _known(x_m: FloatArray, y_m: FloatArray) -> BoolArray:
    known: npt.NDArray[np.bool_] = np.isfinite(x_m) & np.isfinite(y_m)
    return known
