"""The pose of a camera above the ground, by the transforms in a recording.

A camera's frame is optical, as ROS (REP 103) and foxglove.CameraCalibration define it: x to the right
of the picture, y down, z ahead. The chain of parents is followed up to a frame whose plane z = 0 is
the ground: by name of a convention (REP 105, REP 120), or as the camera file says.

With R the rotation from the camera's frame to that of the ground, gravity in the camera's frame is
g = -R[2] (the third row), and by `pipeline.optics.ground_plane`

    tilt = asin(g_z)        roll = atan2(g_x, g_y)        height = the translation's z
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from pipeline.core.arrays import FloatArray
from pipeline.messages.content import Transform

# By convention on the ground, the likeliest first.
GROUND_FRAMES = ("base_footprint", "ground", "ground_plane", "floor", "map", "world", "odom")
MAX_FRAMES = 4096
MAX_CHAIN = 64
# A camera that looks more steeply than this has no tilt and roll to speak of, and one whose axis
# points so far up is hardly in an optical frame.
_STEEPEST_RAD = math.radians(89.0)
_HIGHEST_M = 10_000.0
# A camera that looks up by more than this sees no ground below its horizon, unless its lens is very wide:
# its frame is that of its body (REP 103: x ahead, y left, z up) if that looks ahead and is level.
_UP_RAD, _LEVEL_RAD = math.radians(-30.0), math.radians(60.0)
# The axes of an optical frame (x right, y down, z ahead) in that of the body.
_OPTICAL_IN_BODY = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
BODY_FRAME = (
    "the frame of the pictures is turned as that of a body (x ahead, y left, z up), not as an optical "
    "one (x right, y down, z ahead): it is taken as such; name the optical frame in the pictures' "
    "header, or give the pose in a camera file"
)
MOVING = (
    "the camera moves, by the transforms: it has no one pose, and none is used, so that there are no "
    "distances by the ground; cut the recording where the camera stands still, or give the pose in a "
    "camera file if it does not move"
)
# What a fixed camera may move by rounding and jitter.
MOVED_M, MOVED_RAD = 0.05, math.radians(0.5)


class CameraPose(NamedTuple):
    """Position of a camera above the ground, and the frame that was taken for the ground."""

    height_m: float
    tilt_rad: float
    roll_rad: float
    ground_frame: str
    is_of_body: bool = False  # whether its frame was not an optical one

    def moved_from(self, other: CameraPose) -> bool:
        """Return whether this is another pose than `other`, beyond jitter."""
        return (
            abs(self.height_m - other.height_m) > MOVED_M
            or abs(self.tilt_rad - other.tilt_rad) > MOVED_RAD
            or abs(self.roll_rad - other.roll_rad) > MOVED_RAD
        )


class UnusablePose(ValueError):
    """The transforms do not give a pose; the text says why."""


class TransformTree:
    """The latest transform of each frame."""

    def __init__(self, ground_frame: str = "") -> None:
        self.ground_frame = ground_frame
        self.version = 0  # rises whenever a transform changes
        self._parents: dict[str, Transform] = {}

    def __len__(self) -> int:
        return len(self._parents)

    def add(self, transforms: Iterable[Transform]) -> None:
        """Take transforms; a later one of the same frame replaces the one before."""
        for transform in transforms:
            if self._parents.get(transform.child) == transform:
                continue
            if transform.child in self._parents or len(self._parents) < MAX_FRAMES:
                self._parents[transform.child] = transform
                self.version += 1

    def pose(self, camera_frame: str) -> CameraPose | None:
        """Return the pose of a camera; None where its frame is in no transform.

        Raises:
            UnusablePose: no frame above it is the ground, or what comes out is no pose.
        """
        chain = self._chain(camera_frame)
        if not chain:
            return None
        steps = self._up_to_ground(camera_frame, chain)
        rotation, position = np.eye(3), np.zeros(3)
        for step in steps:
            turn = rotation_matrix(step.rotation_xyzw)
            rotation = turn @ rotation
            position = turn @ position + np.asarray(step.translation_m)
        tilt, roll = _tilt_and_roll(rotation)
        body = _tilt_and_roll(rotation @ _OPTICAL_IN_BODY)
        named = "optical" in camera_frame.lower()
        of_body = not named and tilt < _UP_RAD < body[0] and abs(body[1]) < _LEVEL_RAD
        tilt, roll = body if of_body else (tilt, roll)
        height_m, ground = float(position[2]), steps[-1].parent
        if not 0 < height_m < _HIGHEST_M or abs(tilt) > _STEEPEST_RAD:
            raise UnusablePose(
                f"by the transforms {camera_frame!r} is {height_m:.2f} m above {ground!r} and looks "
                f"{math.degrees(tilt):.1f} degrees below the horizon, which is no camera over "
                "ground (its frame must be optical: x right, y down, z ahead)"
            )
        return CameraPose(height_m, tilt, roll, ground, of_body)

    def _chain(self, frame: str) -> list[Transform]:
        chain: list[Transform] = []
        while frame in self._parents and len(chain) < MAX_CHAIN:
            chain.append(self._parents[frame])
            frame = chain[-1].parent
        if frame in self._parents:
            raise UnusablePose(f"the transforms above {chain[0].child!r} have no end")
        return chain

    def _up_to_ground(self, camera_frame: str, chain: list[Transform]) -> list[Transform]:
        parents = [step.parent for step in chain]
        wanted = (self.ground_frame,) if self.ground_frame else GROUND_FRAMES
        for name in wanted:
            for index, parent in enumerate(parents):
                if name in (parent, parent.rsplit("/", 1)[-1]):
                    return chain[: index + 1]
        raise UnusablePose(
            f"the transforms place {camera_frame!r} in {', '.join(map(repr, parents))}, none of which "
            f"is {wanted[0]!r}"
            if self.ground_frame
            else f"the transforms place {camera_frame!r} in {', '.join(map(repr, parents))}; which of "
            "these lies on the ground is not known (a camera file can say: [ingest] ground_frame)"
        )


def _tilt_and_roll(rotation: FloatArray) -> tuple[float, float]:
    """Return the tilt and roll of a camera, by the rotation from its optical frame to the ground's."""
    gravity = -rotation[2]
    tilt = math.asin(min(1.0, max(-1.0, float(gravity[2]))))
    return tilt, math.atan2(float(gravity[0]), float(gravity[1]))


def rotation_matrix(xyzw: tuple[float, float, float, float]) -> FloatArray:
    """Return the matrix, (3, 3), of a unit quaternion."""
    x, y, z, w = xyzw
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
