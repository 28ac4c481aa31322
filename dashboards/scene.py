"""Names, colours and coordinates that the timeline's parts share."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import rerun as rr

# Okabe and Ito's palette (2008): eight colours that colour-blind readers tell apart, black left out
# because the pictures are dark, and blue kept for the truth.
PALETTE = np.array(
    [
        [230, 159, 0],
        [86, 180, 233],
        [0, 158, 115],
        [240, 228, 66],
        [213, 94, 0],
        [204, 121, 167],
        [153, 221, 255],
    ],
    dtype=np.uint8,
)
TRUTH_COLOUR = (255, 255, 255)

# Which method is drawn where there are several: the one that assumes the least.
METHOD_ORDER = ("fused", "ground", "defocus", "aperture", "inverse", "size")
FRAME, TIME = "frame", "time"


def path(*parts: str) -> str:
    """Return an entity path; names from files are escaped, so none can reach another entity."""
    return rr.new_entity_path(list(parts))


def colours_of(track_ids: npt.NDArray[np.int64]) -> npt.NDArray[np.uint8]:
    """Return a colour a track, the same in every view."""
    return PALETTE[track_ids % len(PALETTE)]


def best_method(methods: set[str]) -> str | None:
    """Return the method that is drawn by default."""
    return next((m for m in METHOD_ORDER if m in methods), None)


@dataclass(frozen=True, slots=True)
class Pose:
    """A camera above the ground; the world is x right, y ahead, z up, its origin below the camera."""

    height_m: float
    tilt_rad: float
    roll_rad: float
    known: bool

    @classmethod
    def of(cls, camera: dict[str, object]) -> Pose:
        """Return the pose of a row of the table `cameras`; unknown is level, at the origin."""
        if camera["camera_height_m"] is None:
            return cls(0.0, 0.0, 0.0, False)
        height_m, tilt_rad, roll_rad = (
            float(str(camera[name])) for name in ("camera_height_m", "tilt_rad", "roll_rad")
        )
        return cls(height_m, tilt_rad, roll_rad, True)

    def world_from_camera(self) -> npt.NDArray[np.float64]:
        """Return the rotation (3, 3) of camera axes (x right, y down, z ahead) into the world."""
        cos, sin = math.cos(self.tilt_rad), math.sin(self.tilt_rad)
        tilt = np.array([[1, 0, 0], [0, -sin, cos], [0, -cos, -sin]])
        c, s = math.cos(self.roll_rad), math.sin(self.roll_rad)
        return np.asarray(tilt @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]))
