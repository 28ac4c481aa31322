"""Lanes of all sources of a recording, and the lane of each kind that belongs to a camera."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from pipeline.ingest.pairing import Lane
from pipeline.messages.content import Kind


class Lanes:
    """Values that wait for pictures: a lane for each kind, topic and frame_id.

    Args:
        cameras: topic of the pictures by camera; it grows while the recording is read.
        frame_ids: by camera; it grows too.
        limit: how many values wait in one lane.
        most: how many lanes there may be.
    """

    def __init__(
        self, cameras: Mapping[str, str], frame_ids: Mapping[str, str], *, limit: int, most: int
    ) -> None:
        self._cameras = cameras
        self._frame_ids = frame_ids
        self._limit = limit
        self._most = most
        self._lanes: dict[tuple[Kind, str, str], Lane[Any]] = {}
        self._lane_of: dict[tuple[Kind, str], Lane[Any] | None] = {}

    def __iter__(self) -> Iterator[tuple[Kind, Lane[Any]]]:
        """Yield all lanes with their kinds."""
        for (kind, _, _), lane in self._lanes.items():
            yield kind, lane

    def of_source(self, kind: Kind, topic: str, frame_id: str) -> Lane[Any] | None:
        """Return the lane of a source, a new one at its first message; None if there are too many."""
        key = (kind, topic, frame_id)
        if key not in self._lanes:
            if len(self._lanes) >= self._most:
                return None
            self._lanes[key] = Lane(topic, frame_id, limit=self._limit)
            self._lane_of.clear()
        return self._lanes[key]

    def of_camera(self, kind: Kind, camera: str) -> Lane[Any] | None:
        """Return the lane that belongs to a camera.

        By equal frame_id; else, where the messages name no camera that has pictures, by the
        deepest shared topic namespace; else, if there is one camera only, whatever there is.
        """
        key = (kind, camera)
        if key not in self._lane_of:
            self._lane_of[key] = self._found(kind, camera)
        return self._lane_of[key]

    def forget_choices(self) -> None:
        """Choose anew which lane belongs to which camera, as a camera was added."""
        self._lane_of.clear()

    def _found(self, kind: Kind, camera: str) -> Lane[Any] | None:
        lanes = [lane for (k, _, _), lane in self._lanes.items() if k is kind]
        frame_id = self._frame_ids[camera]
        same = [lane for lane in lanes if lane.frame_id and lane.frame_id == frame_id]
        known = set(self._frame_ids.values()) - {""}
        nameless = [lane for lane in lanes if lane.frame_id not in known]
        topic = self._cameras[camera]
        candidates = same or nameless
        if not candidates:
            return None
        best = max(candidates, key=lambda lane: shared_namespace(lane.topic, topic))
        if same or len(self._cameras) == 1 or shared_namespace(best.topic, topic) > 0:
            return best
        return None


def shared_namespace(a: str, b: str) -> int:
    """Return how many leading parts two topics share: "/front/image", "/front/exposure" -> 1."""
    count = 0
    for x, y in zip(a.strip("/").split("/")[:-1], b.strip("/").split("/")[:-1], strict=False):
        if x != y:
            break
        count += 1
    return count
