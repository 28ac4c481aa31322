"""Joining observations into tracks: prediction by a Kalman filter, optimal assignment.

The state of a track is its foot point, its height and its width in pixels, with the velocity of the
foot point: [x, y, height, width, vx, vy]. All tracks are predicted and corrected at once, as arrays.
Time is the frames' own, so gaps and changing rates need no special case.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt
import pyarrow as pa
from scipy.optimize import linear_sum_assignment

from pipeline.config import TrackConfig
from pipeline.records import TRACKS, Boxes, FloatArray, IntArray

# Lengths in the filter are relative to the object's own height, so that near and far people, and
# large and small pictures, are treated alike.
# A walker passes 0.8 body heights a second (1.4 m/s), a runner twice that.
SPEED_STD = 1.0  # body heights a second, of a new track
ACCELERATION_STD = (
    0.6  # body heights a second squared: 1 m/s2, setting off or stopping within 1.5 s
)
# The height in the picture changes only as the person comes nearer; the width also with every stride.
HEIGHT_CHANGE_STD = 0.08  # of the height, in a second
WIDTH_CHANGE_STD = 0.3
FOOT_STD = 0.05  # body heights: how well a box's foot point and sides repeat
SIZE_STD = 0.08
# Chi-squared, 4 degrees of freedom, 99.9 %: further apart is another object.
GATE = 18.47
_MEASURED = 4
_STATES = 6


@dataclass(slots=True)
class _Life:
    """What is remembered of a track beside its filter."""

    track_id: int
    object_id: str | None
    first_time_ns: int
    last_time_ns: int
    first_frame_index: int
    last_frame_index: int
    count: int = 0
    votes: dict[str, int] = field(default_factory=dict)


class Tracker:
    """Follows the objects of one camera; frames must come in order of time."""

    def __init__(self, config: TrackConfig, camera: str) -> None:
        self._config = config
        self._camera = camera
        self._state = np.empty((0, _STATES))
        self._covariance = np.empty((0, _STATES, _STATES))
        self._active: list[_Life] = []
        self._lives: list[_Life] = []
        self._time_ns: int | None = None

    def update(self, capture_time_ns: int, frame_index: int, boxes: Boxes) -> IntArray:
        """Return a track id for every box of a frame."""
        self._predict(capture_time_ns)
        measured = _measure(boxes.bbox_xyxy_px)
        assigned = self._assign(boxes, measured)
        new = np.flatnonzero(assigned < 0)
        matched = np.flatnonzero(assigned >= 0)
        self._correct(assigned[matched], measured[matched])
        assigned[new] = self._begin(capture_time_ns, frame_index, boxes, measured, new)
        for box, slot in enumerate(assigned):
            life = self._active[slot]
            life.last_time_ns, life.last_frame_index = capture_time_ns, frame_index
            life.count += 1
            name = boxes.class_name[box]
            life.votes[name] = life.votes.get(name, 0) + 1
        ids = np.array([self._active[slot].track_id for slot in assigned], dtype=np.int64)
        self._retire(capture_time_ns)
        return ids

    def tracks(self) -> pa.Table:
        """Return the tracks that lasted, in the schema of the table `tracks`.

        A track with the recording's own id always counts; one that motion made must have been seen
        often enough, and for long enough, not to be noise.
        """
        config = self._config
        kept = [
            life
            for life in self._lives
            if life.object_id is not None
            or not config.noisy(life.count, (life.last_time_ns - life.first_time_ns) / 1e9)
        ]
        return pa.table(
            {
                "camera": [self._camera] * len(kept),
                "track_id": [k.track_id for k in kept],
                "class_name": [max(k.votes, key=lambda n: k.votes[n]) for k in kept],
                "object_id": [k.object_id for k in kept],
                "first_frame_index": [k.first_frame_index for k in kept],
                "last_frame_index": [k.last_frame_index for k in kept],
                "first_time_ns": [k.first_time_ns for k in kept],
                "last_time_ns": [k.last_time_ns for k in kept],
                "observation_count": [k.count for k in kept],
            },
            schema=TRACKS,
        )

    def _predict(self, time_ns: int) -> None:
        elapsed_s = 0.0 if self._time_ns is None else max((time_ns - self._time_ns) / 1e9, 0.0)
        self._time_ns = time_ns if self._time_ns is None else max(time_ns, self._time_ns)
        if elapsed_s == 0.0 or len(self._active) == 0:
            return
        move = np.eye(_STATES)
        move[0, 4] = move[1, 5] = elapsed_s
        self._state = self._state @ move.T
        self._covariance = move @ self._covariance @ move.T + _process_noise(
            elapsed_s, self._state[:, 2]
        )

    def _assign(self, boxes: Boxes, measured: FloatArray) -> IntArray:
        """Return the active track of each box, or -1: by the recorded id, else by least cost."""
        assigned = np.full(len(boxes), -1, dtype=np.int64)
        by_id = {life.object_id: i for i, life in enumerate(self._active) if life.object_id}
        for box, object_id in enumerate(boxes.object_id):
            if object_id is not None and object_id in by_id:
                assigned[box] = by_id.pop(object_id)
        free_boxes = np.array(
            [b for b in range(len(boxes)) if boxes.object_id[b] is None], dtype=np.int64
        )
        free_tracks = np.array(
            [i for i, life in enumerate(self._active) if life.object_id is None], dtype=np.int64
        )
        if len(free_boxes) == 0 or len(free_tracks) == 0:
            return assigned
        cost = self._distance(free_tracks, measured[free_boxes])
        rows, columns = linear_sum_assignment(np.minimum(cost, 10 * GATE))
        good = cost[rows, columns] < GATE
        assigned[free_boxes[columns[good]]] = free_tracks[rows[good]]
        return assigned

    def _distance(self, tracks: IntArray, measured: FloatArray) -> FloatArray:
        """Return squared Mahalanobis distances, (tracks, boxes), plus the cost of a wide gate.

        The logarithm of the innovation covariance keeps a track that has not been seen for long,
        and so could be anywhere, from outbidding one that was just there (its negative
        log-likelihood, in the object's own lengths).
        """
        state = self._state[tracks]
        innovation = measured[None, :, :] - state[:, None, :_MEASURED]
        spread = self._covariance[tracks][:, :_MEASURED, :_MEASURED] + _measurement_noise(
            state[:, 2]
        )
        inverse = np.linalg.inv(spread)
        squared = np.einsum("tbi,tij,tbj->tb", innovation, inverse, innovation)
        relative = np.linalg.det(spread) / np.linalg.det(_measurement_noise(state[:, 2]))
        return np.where(squared < GATE, squared + np.log(relative)[:, None] * 0.5, np.inf).clip(
            max=10 * GATE
        )

    def _correct(self, tracks: IntArray, measured: FloatArray) -> None:
        if len(tracks) == 0:
            return
        state, covariance = self._state[tracks], self._covariance[tracks]
        spread = covariance[:, :_MEASURED, :_MEASURED] + _measurement_noise(state[:, 2])
        gain = covariance[:, :, :_MEASURED] @ np.linalg.inv(spread)
        innovation = measured - state[:, :_MEASURED]
        self._state[tracks] = state + np.einsum("tij,tj->ti", gain, innovation)
        self._covariance[tracks] = covariance - gain @ covariance[:, :_MEASURED, :]
        self._state[tracks, 2:4] = np.maximum(self._state[tracks, 2:4], 1.0)

    def _begin(
        self,
        time_ns: int,
        frame_index: int,
        boxes: Boxes,
        measured: FloatArray,
        new: npt.NDArray[np.intp],
    ) -> IntArray:
        slots = np.arange(len(self._active), len(self._active) + len(new))
        state = np.hstack([measured[new], np.zeros((len(new), 2))])
        height = state[:, 2]
        covariance = np.zeros((len(new), _STATES, _STATES))
        covariance[:, :_MEASURED, :_MEASURED] = _measurement_noise(height)
        covariance[:, 4, 4] = covariance[:, 5, 5] = (SPEED_STD * height) ** 2
        self._state = np.vstack([self._state, state])
        self._covariance = np.concatenate([self._covariance, covariance])
        for box in new:
            life = _Life(
                len(self._lives), boxes.object_id[box], time_ns, time_ns, frame_index, frame_index
            )
            self._lives.append(life)
            self._active.append(life)
        return slots

    def _retire(self, time_ns: int) -> None:
        """Forget tracks that were not seen for long; new ones that were not confirmed, sooner."""
        config = self._config
        keep = [
            (time_ns - life.last_time_ns) / 1e9
            <= (config.coast_s if life.count >= config.min_count else config.coast_new_s)
            or life.object_id is not None
            for life in self._active
        ]
        if all(keep):
            return
        mask = np.array(keep)
        self._state, self._covariance = self._state[mask], self._covariance[mask]
        self._active = [life for life, kept in zip(self._active, keep, strict=True) if kept]


def _measure(bbox: FloatArray) -> FloatArray:
    """Return foot point, height and width, (n, 4), of boxes (n, 4)."""
    x0, y0, x1, y1 = bbox.T
    return np.stack([(x0 + x1) / 2, y1, y1 - y0, x1 - x0], axis=1)


def _measurement_noise(height_px: FloatArray) -> FloatArray:
    noise = np.zeros((len(height_px), _MEASURED, _MEASURED))
    noise[:, 0, 0] = noise[:, 1, 1] = (FOOT_STD * height_px) ** 2
    noise[:, 2, 2] = noise[:, 3, 3] = (SIZE_STD * height_px) ** 2
    return noise


def _process_noise(elapsed_s: float, height_px: FloatArray) -> FloatArray:
    """Return the discrete white-noise acceleration model's covariance (Bar-Shalom 2001, 6.3.2)."""
    noise = np.zeros((len(height_px), _STATES, _STATES))
    acceleration = (ACCELERATION_STD * height_px) ** 2
    for position, velocity in ((0, 4), (1, 5)):
        noise[:, position, position] = acceleration * elapsed_s**4 / 4
        noise[:, position, velocity] = acceleration * elapsed_s**3 / 2
        noise[:, velocity, position] = acceleration * elapsed_s**3 / 2
        noise[:, velocity, velocity] = acceleration * elapsed_s**2
    noise[:, 2, 2] = (HEIGHT_CHANGE_STD * height_px) ** 2 * elapsed_s
    noise[:, 3, 3] = (WIDTH_CHANGE_STD * height_px) ** 2 * elapsed_s
    return noise
