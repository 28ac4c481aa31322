"""Joining observations into tracks: prediction by a Kalman filter, optimal assignment.

The filter is in `pipeline.track.kalman`. Time is the frames' own, so gaps and changing rates need no
special case.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt
import pyarrow as pa
from scipy.optimize import linear_sum_assignment

from pipeline.core.arrays import FloatArray, IntArray
from pipeline.core.config import TrackConfig
from pipeline.core.records import Boxes, Expected
from pipeline.core.tables import TRACKS
from pipeline.track.kalman import Filters

# Chi-squared, 4 degrees of freedom, 99.9 %: further apart is another object.
GATE = 18.47


@dataclass(slots=True)
class _Life:
    """Facts about a track beside the state of its filter."""

    track_id: int
    object_id: str | None
    first_time_ns: int
    last_time_ns: int
    first_frame_index: int
    last_frame_index: int
    first_foot_px: tuple[float, float]
    count: int = 0
    votes: dict[str, int] = field(default_factory=dict)


class Tracker:
    """Follows the objects of one camera; frames must come in order of time."""

    def __init__(self, config: TrackConfig, camera: str) -> None:
        self._config = config
        self._camera = camera
        self._filters = Filters()
        self._active: list[_Life] = []
        self._lives: list[_Life] = []
        self._away: dict[
            str, _Life
        ] = {}  # retired, by the recording's own id, which may come again
        self._time_ns: int | None = None

    def expected(self, capture_time_ns: int) -> Expected:
        """Return where the tracks that are confirmed must be at a time.

        Those who were seen last come first, and of them the nearest.
        """
        sure = [i for i, k in enumerate(self._active) if k.count >= self._config.min_count]
        if self._time_ns is None or not sure:
            return Expected(np.empty((0, 4)), np.empty(0, dtype=bool))
        elapsed_s = max((capture_time_ns - self._time_ns) / 1e9, 0.0)
        x, y, tall, wide, x_speed, y_speed = self._filters.state[sure].T
        x, y = x + elapsed_s * x_speed, y + elapsed_s * y_speed
        lives = [self._active[i] for i in sure]
        first_x, first_y = np.array([k.first_foot_px for k in lives]).T
        walked = np.hypot(x - first_x, y - first_y) > tall
        order = np.lexsort((-y, [-k.last_time_ns for k in lives]))
        boxes = np.stack([x - wide / 2, y - tall, x + wide / 2, y], axis=1)
        return Expected(boxes[order], walked[order])

    def update(self, capture_time_ns: int, frame_index: int, boxes: Boxes) -> IntArray:
        """Return a track id for every box of a frame."""
        self._predict(capture_time_ns)
        measured = _measure(boxes.bbox_xyxy_px)
        assigned = self._assign(boxes, measured)
        new = np.flatnonzero(assigned < 0)
        matched = np.flatnonzero(assigned >= 0)
        if len(matched):
            self._filters.correct(assigned[matched], measured[:, matched])
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
        none = [None] * len(kept)
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
            }
            | dict.fromkeys(("filled_count", "looked_at_count", "confirmed_count"), none)
            | {"verdict": none},
            schema=TRACKS,
        )

    def _predict(self, time_ns: int) -> None:
        """Move the tracks on in time; where time falls back, the clock was set: all tracks end."""
        if self._time_ns is not None and time_ns < self._time_ns - self._config.coast_s * 1e9:
            self._filters.keep(np.zeros(len(self._active), dtype=bool))
            self._active, self._time_ns = [], None
        elapsed_s = 0.0 if self._time_ns is None else max((time_ns - self._time_ns) / 1e9, 0.0)
        self._time_ns = time_ns if self._time_ns is None else max(time_ns, self._time_ns)
        if elapsed_s == 0.0 or len(self._active) == 0:
            return
        self._filters.predict(elapsed_s)

    def _assign(self, boxes: Boxes, measured: FloatArray) -> IntArray:
        """Return the active track of each box, or -1: by the recorded id, else by least cost."""
        assigned = np.full(len(boxes), -1, dtype=np.int64)
        by_id = {life.object_id: i for i, life in enumerate(self._active) if life.object_id}
        for box, object_id in enumerate(boxes.object_id):
            if object_id is not None and object_id in by_id:
                assigned[box] = by_id.pop(object_id)
        free_boxes = np.array([b for b, name in enumerate(boxes.object_id) if name is None])
        free_tracks = np.array([i for i, k in enumerate(self._active) if k.object_id is None])
        if len(free_boxes) == 0 or len(free_tracks) == 0:
            return assigned
        cost = self._distance(free_tracks, measured[:, free_boxes])
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
        squared, relative = self._filters.distance(tracks, measured)
        cost = squared + np.log(relative)[:, None] * 0.5
        return np.where(squared < GATE, cost, np.inf).clip(max=10 * GATE)

    def _begin(
        self,
        time_ns: int,
        frame_index: int,
        boxes: Boxes,
        measured: FloatArray,
        new: npt.NDArray[np.intp],
    ) -> IntArray:
        slots = np.arange(len(self._active), len(self._active) + len(new))
        if len(new):
            self._filters.begin(measured[:, new])
        for box in new:
            object_id = boxes.object_id[box]
            life = self._away.pop(object_id, None) if object_id is not None else None
            if life is not None:
                self._active.append(life)
                continue
            life = _Life(
                len(self._lives),
                object_id,
                time_ns,
                time_ns,
                frame_index,
                frame_index,
                (float(measured[0, box]), float(measured[1, box])),
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
            for life in self._active
        ]
        if all(keep):
            return
        for life, kept in zip(self._active, keep, strict=True):
            if not kept and life.object_id is not None:
                self._away[life.object_id] = life
        self._filters.keep(np.array(keep))
        self._active = [life for life, kept in zip(self._active, keep, strict=True) if kept]


def _measure(bbox: FloatArray) -> FloatArray:
    """Return foot x, foot y, height and width, (4, n), of boxes (n, 4)."""
    x0, y0, x1, y1 = bbox.T
    return np.stack([(x0 + x1) / 2, y1, y1 - y0, x1 - x0])
