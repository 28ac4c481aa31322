"""Results as messages: foxglove.ImageAnnotations, foxglove.SceneUpdate, stadimeter.Estimates.

Objects stand in a frame of our own: the point on the ground below the camera, x to the right, y
ahead, z up. It is a child of the camera's frame, so that it never contradicts the transforms of the
recording. Where the pose is unknown, they are in the camera's own frame at their depth.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from foxglove_schemas_protobuf.Color_pb2 import Color
from foxglove_schemas_protobuf.CubePrimitive_pb2 import CubePrimitive
from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
from foxglove_schemas_protobuf.ImageAnnotations_pb2 import ImageAnnotations
from foxglove_schemas_protobuf.PointsAnnotation_pb2 import PointsAnnotation
from foxglove_schemas_protobuf.Pose_pb2 import Pose
from foxglove_schemas_protobuf.Quaternion_pb2 import Quaternion
from foxglove_schemas_protobuf.SceneEntityDeletion_pb2 import SceneEntityDeletion
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate
from foxglove_schemas_protobuf.TextPrimitive_pb2 import TextPrimitive
from foxglove_schemas_protobuf.Vector3_pb2 import Vector3
from scipy.spatial.transform import Rotation

from pipeline.core.camera_row import CameraRow
from pipeline.export.results import FrameResult, Row
from pipeline.mcap_file.writer import timestamp
from schemas.stadimeter_pb2 import Estimate, Estimates

_CORNER_PX = 0.5  # Foxglove counts from the corner of the first pixel, here its centre is (0, 0)
_FONT_PX, _TEXT_M = 14.0, 0.25
_UNKNOWN_HEIGHT_M = 1.0  # of the block that stands for an object of which no height is known
_WIDTH_M = 0.5  # of a block: no width is measured
_NUMBERS = (
    "depth_m",
    "depth_std_m",
    "height_m",
    "height_std_m",
    "height_assumed",
    "range_m",
    "x_m",
    "y_m",
    "quality",
    "score",
)
# Told apart by their lightness too: tracks take them in turn.
_COLOURS = (
    (0.90, 0.62, 0.00),
    (0.34, 0.71, 0.91),
    (0.00, 0.62, 0.45),
    (0.94, 0.89, 0.26),
    (0.84, 0.37, 0.00),
    (0.80, 0.47, 0.65),
)  # Okabe and Ito 2008


class CameraScene:
    """The messages of one camera, and the objects that are shown, to take them away again."""

    def __init__(self, camera: CameraRow) -> None:
        self.name = camera.camera
        self.frame_id = camera.frame_id or camera.camera
        self.ground_id = f"stadimeter/{self.name}/ground"
        self._pose = camera.pose
        self._camera = camera
        self._shown: set[str] = set()

    def ground(self, time_ns: int) -> FrameTransform | None:
        """Return the transform to the ground below the camera; None if the pose is unknown."""
        if self._pose is None:
            return None
        height_m, tilt, roll = self._pose
        # Gravity in the camera's frame: see pipeline.optics.ground_plane.
        down = np.array(
            [math.sin(roll) * math.cos(tilt), math.cos(roll) * math.cos(tilt), math.sin(tilt)]
        )
        ahead = np.array([0.0, 0.0, 1.0]) - down * down[2]
        ahead /= np.linalg.norm(ahead)
        axes = np.stack([np.cross(ahead, -down), ahead, -down], axis=1)
        x, y, z, w = Rotation.from_matrix(axes).as_quat()
        return FrameTransform(
            timestamp=timestamp(time_ns),
            parent_frame_id=self.frame_id,
            child_frame_id=self.ground_id,
            translation=Vector3(**dict(zip("xyz", height_m * down, strict=True))),
            rotation=Quaternion(x=x, y=y, z=z, w=w),
        )

    def estimates(self, frame: FrameResult) -> Estimates:
        """Return all numbers of a frame."""
        message = Estimates(
            timestamp=timestamp(frame.capture_time_ns),
            frame_id=self.frame_id,
            frame_index=frame.frame_index,
        )
        for row in frame.objects:
            message.run_id = row["run_id"] or message.run_id
            message.objects.append(_estimate(row))
        return message

    def boxes(self, frame: FrameResult) -> ImageAnnotations:
        """Return the boxes of a frame, each with its words at the upper left."""
        at = timestamp(frame.capture_time_ns)
        message = ImageAnnotations(timestamp=at)
        for row in frame.objects:
            x0, y0, x1, y1 = (row[n] + _CORNER_PX for n in _EDGES)
            drawn = message.points.add(
                timestamp=at,
                type=PointsAnnotation.LINE_LOOP,
                thickness=2.0,
                outline_color=_colour(row["track_id"]),
            )
            for x, y in ((x0, y0), (x1, y0), (x1, y1), (x0, y1)):
                drawn.points.add(x=x, y=y)
            label = message.texts.add(
                timestamp=at,
                text=words(row),
                font_size=_FONT_PX,
                text_color=Color(r=1, g=1, b=1, a=1),
                background_color=Color(a=0.6),
            )
            label.position.x, label.position.y = x0, y0
        return message

    def scene(self, frame: FrameResult) -> SceneUpdate:
        """Return the objects of a frame in space, and take away those that have gone."""
        at, message, shown = timestamp(frame.capture_time_ns), SceneUpdate(), set[str]()
        for row in frame.objects:
            place = self._place(row)
            if place is None:
                continue
            name = f"{self.name}/{row['track_id']}"
            shown.add(name)
            height_m = row["height_m"] or _UNKNOWN_HEIGHT_M
            x, y, z = place
            up = (0.0, 0.0, height_m / 2) if self._pose is not None else (0.0, 0.0, 0.0)
            size = (
                (_WIDTH_M, _WIDTH_M, height_m)
                if self._pose is not None
                else (_WIDTH_M, height_m, _WIDTH_M)
            )
            message.entities.add(
                timestamp=at,
                frame_id=self.ground_id if self._pose is not None else self.frame_id,
                id=name,
                cubes=[
                    CubePrimitive(
                        pose=_pose(x, y, z + up[2]),
                        size=Vector3(x=size[0], y=size[1], z=size[2]),
                        color=_colour(row["track_id"], 0.7),
                    )
                ],
                texts=[
                    TextPrimitive(
                        pose=_pose(
                            x, y, z + (height_m + _TEXT_M if self._pose is not None else 0.0)
                        ),
                        billboard=True,
                        font_size=_TEXT_M,
                        color=Color(r=1, g=1, b=1, a=1),
                        text=words(row),
                    )
                ],
            )
        for name in sorted(self._shown - shown):
            message.deletions.add(timestamp=at, type=SceneEntityDeletion.MATCHING_ID, id=name)
        self._shown = shown
        return message

    def _place(self, row: Row) -> tuple[float, float, float] | None:
        """Return the position of an object: on the ground, or in the camera's frame at its depth."""
        if self._pose is not None:
            if row["x_m"] is None or row["y_m"] is None:
                return None
            return float(row["x_m"]), float(row["y_m"]), 0.0
        depth_m, lens = row["depth_m"], self._camera.intrinsics
        if depth_m is None or lens is None:
            return None
        x_px = (row["x_min_px"] + row["x_max_px"]) / 2 - lens.cx_px
        y_px = (row["y_min_px"] + row["y_max_px"]) / 2 - lens.cy_px
        return depth_m * x_px / lens.fx_px, depth_m * y_px / lens.fy_px, float(depth_m)


_EDGES = ("x_min_px", "y_min_px", "x_max_px", "y_max_px")


def words(row: Row) -> str:
    """Return the label of an object: its class and track, its depth and height with intervals."""
    parts = [f"{row['class_name']} {row['track_id']}" if row["track_id"] else row["class_name"]]
    if row["depth_m"] is not None:
        parts.append(_with_interval(row["depth_m"], row["depth_std_m"], 1))
    if row["height_m"] is not None:
        assumed = " assumed" if row["height_assumed"] else ""
        parts.append(f"{_with_interval(row['height_m'], row['height_std_m'], 2)} tall{assumed}")
    return ", ".join(parts)


def _with_interval(value: float, std: float | None, digits: int) -> str:
    half = "" if std is None else f" ± {1.96 * std:.{digits}f}"
    return f"{value:.{digits}f}{half} m"


def _estimate(row: Row) -> Estimate:
    stated = {name: row[name] for name in _NUMBERS if row[name] is not None}
    message = Estimate(class_name=row["class_name"], method=row["method"] or "", **stated)
    if row["track_id"] is not None and row["track_id"] >= 0:
        message.track_id = row["track_id"]
    for name in _EDGES:
        setattr(message.box, name, row[name])
    return message


def _pose(x: float, y: float, z: float) -> Pose:
    return Pose(position=Vector3(x=x, y=y, z=z), orientation=Quaternion(w=1.0))


def _colour(track_id: int | None, alpha: float = 1.0) -> Color:
    colours: Sequence[tuple[float, float, float]] = _COLOURS
    r, g, b = colours[(track_id or 0) % len(colours)]
    return Color(r=r, g=g, b=b, a=alpha)
