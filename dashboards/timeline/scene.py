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

from dashboards.style import DIM, NEUTRAL, TRUTH, Colours, packed, tinted
from dashboards.timeline.columns import BoolArray, CameraRows
from dashboards.timeline.names import path
from dashboards.timeline.slots import LONGEST_GAP_FRAMES
from dashboards.timeline.stream import send_sets
from pipeline.core.arrays import FloatArray, IntArray

# A trail fades in steps: the same line in three entities, each showing an age, in frames, and dimmer.
TRAILS = {"recent": (0, 30, 1.0), "older": (30, 75, 0.6), "oldest": (75, 150, 0.3)}
# A body is drawn round, no wider than people are: arms and strides widen a box, not a body.
WIDEST_M = 0.5
# How bodies look: their fill, and how opaque it is.
SOLID, OUTLINE = ("solid", 255), ("majorwireframe", 255)
# Distances along the ground that are written beside it, in metres.
TICKS_M = (0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0)
TICKS = 6


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
    camera, pose, scale = rows.camera, Pose.of(rows.camera), rows.scale
    world = path("cameras", rows.name)
    stream.log(world, rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    if not lens_known(camera):
        return
    stream.log(
        path("cameras", rows.name, "camera"),
        rr.Transform3D(translation=[0, 0, pose.height_m], mat3x3=pose.world_from_camera()),
        rr.Pinhole(
            image_from_camera=[
                [camera["fx_px"] * scale, 0, (camera["cx_px"] + 0.5) * scale],
                [0, camera["fy_px"] * scale, (camera["cy_px"] + 0.5) * scale],
                [0, 0, 1],
            ],
            resolution=[camera["width_px"] * scale, camera["height_px"] * scale],
            camera_xyz=rr.ViewCoordinates.RDF,
            image_plane_distance=frustum_m,
        ),
        static=True,
    )


def log_ground(stream: rr.RecordingStream, rows: CameraRows, right_m: float, far_m: float) -> None:
    """Log what of the ground is in the picture, and a ruler of metres ahead to the right of people.

    The picture's corners are taken to the ground without the lens's distortion; rays that do not
    meet the ground before `far_m` end there.
    """
    pose = Pose.of(rows.camera)
    if not lens_known(rows.camera):
        return
    step_m = next((t for t in TICKS_M if far_m / t <= TICKS), TICKS_M[-1])
    ahead_m = np.arange(1, int(far_m / step_m) + 1) * step_m
    stream.log(
        path("cameras", rows.name, "ground", "distance"),
        rr.Points3D(
            np.column_stack([np.full(len(ahead_m), right_m), ahead_m, np.zeros(len(ahead_m))]),
            labels=[f"{value:g} m" for value in ahead_m],
            colors=[NEUTRAL] * len(ahead_m),
            radii=-2.0,
            show_labels=True,
        ),
        rr.LineStrips3D([[[right_m, 0, 0], [right_m, far_m, 0]]], colors=[DIM], radii=-0.75),
        static=True,
    )
    if pose.known:
        stream.log(
            path("cameras", rows.name, "ground", "seen"),
            rr.LineStrips3D([seen_ground(rows.camera, far_m)], colors=[DIM], radii=-1.0),
            static=True,
        )


def seen_ground(camera: Mapping[str, Any], far_m: float) -> FloatArray:
    """Return the corners of the ground that is in the picture, a closed line, (m, 3)."""
    pose = Pose.of(camera)
    side = np.linspace(0.0, 1.0, 9)
    # Down the left side, along the bottom, up the right side; the top is beyond the horizon or far.
    u = np.concatenate([np.zeros(9), side, np.ones(9)]) * camera["width_px"]
    v = np.concatenate([side, np.ones(9), side[::-1]]) * camera["height_px"]
    rays = np.column_stack(
        [
            (u - camera["cx_px"]) / camera["fx_px"],
            (v - camera["cy_px"]) / camera["fy_px"],
            np.ones(len(u)),
        ]
    )
    x, y, z = (rays @ pose.world_from_camera().T).T
    down = np.maximum(-z, 1e-9)
    reach = np.minimum(pose.height_m / down, far_m / np.maximum(np.hypot(x, y), 1e-9))
    corners = np.column_stack([x * reach, y * reach, np.zeros(len(x))])
    return np.asarray(np.vstack([corners, corners[:1]]))


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
    bodies = Bodies.of(best.x_m, best.y_m, width_m, height_m, standing=standing).take(placed)
    track = seen.track[placed]
    _log_bodies(
        stream,
        path("cameras", rows.name, "people"),
        rows,
        seen.row[placed],
        bodies,
        (rows.tracks.colour[track], SOLID),
    )
    names = np.array([f"#{i}" for i in rows.tracks.track_id.tolist()], dtype=object)
    text_colour = packed(tinted(rows.tracks.colour))[track]
    send_sets(
        stream,
        path("cameras", rows.name, "numbers"),
        rows.frames,
        seen.row[placed],
        lambda part: rr.Points3D.columns(
            positions=bodies.feet[part],
            colors=text_colour[part],
            radii=np.zeros(len(track[part]), dtype=np.float32),
            labels=names[track[part]].tolist(),
            show_labels=np.ones(len(track[part]), dtype=np.bool_),
        ),
    )
    if not rows.is_series_of_pictures:
        _log_trails(stream, rows, seen.row[placed], track, bodies.feet)
    _log_truth(stream, rows, (width_m, height_m), standing)


@dataclass(frozen=True, slots=True)
class Bodies:
    """Upright things where they stand, (n,) each: capsules as tall and as wide as they are."""

    feet: FloatArray  # (n, 3)
    radius_m: FloatArray
    height_m: FloatArray

    @classmethod
    def of(
        cls,
        x_m: FloatArray,
        y_m: FloatArray,
        width_m: FloatArray,
        height_m: FloatArray,
        *,
        standing: bool,
    ) -> Bodies:
        """Return bodies on the ground; around the optical axis where there is none."""
        radius_m = np.minimum(width_m, WIDEST_M) / 2
        radius_m = np.minimum(np.nan_to_num(radius_m), np.maximum(height_m, 0.02) / 2)
        below = np.zeros(len(x_m)) if standing else -height_m / 2
        return cls(np.column_stack([x_m, y_m, below]), radius_m, height_m)

    def take(self, which: BoolArray) -> Bodies:
        """Return some of them."""
        return Bodies(self.feet[which], self.radius_m[which], self.height_m[which])


def _log_bodies(
    stream: rr.RecordingStream,
    entity: str,
    rows: CameraRows,
    row: IntArray,
    bodies: Bodies,
    look: tuple[Colours, tuple[str, int]],
) -> None:
    """Log bodies; what is estimated is solid, what is true an outline."""
    colours, (fill, opacity) = look
    length_m = np.maximum(bodies.height_m - 2 * bodies.radius_m, 0.0).astype(np.float32)
    radius_m = bodies.radius_m.astype(np.float32)
    lowest = (bodies.feet + np.column_stack([np.zeros((len(row), 2)), radius_m])).astype(np.float32)
    colour = packed(colours, opacity)
    send_sets(
        stream,
        entity,
        rows.frames,
        row,
        lambda part: rr.Capsules3D.columns(
            lengths=length_m[part],
            radii=radius_m[part],
            translations=lowest[part],
            colors=colour[part],
        ),
        rr.Capsules3D.from_fields(fill_mode=fill, line_radii=-0.6),
    )


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
    truth, width_m, height_m = rows.truth, np.full(1, WIDEST_M), np.zeros(1)
    if not _known(truth.x_m, truth.y_m).any() and rows.matched is not None:
        truth, (width_m, height_m) = rows.matched, seen_size_m
    placed = _known(truth.x_m, truth.y_m)
    width_m = np.where(np.isfinite(truth.width_m), truth.width_m, width_m)
    height_m = np.where(np.isfinite(truth.height_m), truth.height_m, height_m)
    bodies = Bodies.of(truth.x_m, truth.y_m, width_m, height_m, standing=standing).take(placed)
    colours = np.tile(np.array(TRUTH, dtype=np.uint8), (int(placed.sum()), 1))
    _log_bodies(
        stream,
        path("cameras", rows.name, "truth"),
        rows,
        truth.row[placed],
        bodies,
        (colours, OUTLINE),
    )


def _known(x_m: FloatArray, y_m: FloatArray) -> BoolArray:
    known: npt.NDArray[np.bool_] = np.isfinite(x_m) & np.isfinite(y_m)
    return known
