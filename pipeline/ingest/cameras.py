"""Cameras of a recording, told apart by the frame_id and the topic of their pictures.

Several cameras on one topic differ in their frame_id. One camera on two topics (raw and compressed,
raw and rectified) has one frame_id and one place in the tree of topics: it is one camera, and the
pictures of the second topic are left out. Two cameras that share a frame_id by mistake are at different
places.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from enum import StrEnum

from pipeline.core.config import CameraConfig
from pipeline.core.exposure import FIELDS
from pipeline.core.records import Diagnostic, Severity

MOST_NAMED = 20  # things that a message lists
# Words of which the last parts of a topic of pictures are made, whatever the camera is.
_WORDS = (
    "image|images|img|video|stream|raw|rect|rectified|undistorted|compressed|theora|ffmpeg|h264|h265|"
    "hevc|jpeg|jpg|png|webp|color|colour|mono|gray|grey|rgb|bgr|preview|thumbnail|resized|scaled|"
    "republished|throttled"
)
_FORM = re.compile(rf"(?:{_WORDS})(?:[_-](?:{_WORDS}))*", re.IGNORECASE)


class Why(StrEnum):
    """Reason why a picture belongs to no camera of its own."""

    SAME_CAMERA = "same_camera"
    TOO_MANY = "too_many_cameras"


class Cameras:
    """Names of cameras; they grow while a recording is read.

    Attributes:
        topics: topic of the pictures, by camera.
        frame_ids: frame_id of the pictures, by camera.
    """

    def __init__(self, most: int) -> None:
        self.topics: dict[str, str] = {}
        self.frame_ids: dict[str, str] = {}
        self.others: dict[str, str] = {}  # further topics of a camera: its name
        self._most = most
        self._names: dict[tuple[str, str], str | Why] = {}
        self._last: dict[str, str] = {}  # frame_id of a topic's last picture

    def find(self, topic: str, frame_id: str) -> str | Why:
        """Return the camera of a picture, or why it has none that is measured."""
        key = (topic, frame_id)
        found = self._names.get(key)
        if found is None:
            found = self._find(topic, frame_id)
            if found is not Why.TOO_MANY:
                self._names[key] = found
        self._last[topic] = frame_id
        return found

    def _find(self, topic: str, frame_id: str) -> str | Why:
        here = [camera for camera, other in self.topics.items() if other == topic]
        if here and not frame_id:  # left out in some messages
            return here[0]
        if len(here) == 1 and not self.frame_ids[here[0]]:  # stated later
            self.frame_ids[here[0]] = frame_id
            return here[0]
        if here and _counts(self._last.get(topic, ""), frame_id):
            return self._names[(topic, self._last[topic])]
        for camera, other in self.topics.items():
            if other != topic and self.frame_ids[camera] == frame_id and _same_place(other, topic):
                self.others[topic] = camera
                return Why.SAME_CAMERA
        if len(self.topics) >= self._most:
            return Why.TOO_MANY
        name = topic if not frame_id or frame_id in self.topics else frame_id
        if name in self.topics:
            name = f"{topic}#{frame_id}"
        self.topics[name], self.frame_ids[name] = topic, frame_id
        return name


def _counts(before: str, frame_id: str) -> bool:
    """Return whether a frame_id is the number after the one before: it counts, and names nothing."""
    both = before[-18:], frame_id[-18:]
    return all(b.isdecimal() and b.isascii() for b in both) and int(both[1]) == int(both[0]) + 1


def _same_place(a: str, b: str) -> bool:
    """Return whether two topics differ in the form of the pictures only."""
    places = [_place(topic) for topic in (a, b)]
    return places[0] == places[1] and (bool(places[0]) or a.startswith(b) or b.startswith(a))


def _place(topic: str) -> tuple[str, ...]:
    parts = [part for part in topic.split("/") if part]
    while parts and _FORM.fullmatch(parts[-1]):
        parts.pop()
    return tuple(parts)


def unmatched(
    entries: Sequence[CameraConfig],
    cameras: Mapping[str, str],
    topics: Collection[str],
    found: Collection[tuple[str, str]],
) -> Iterator[Diagnostic]:
    """Yield a note for each entry, and each field that it names, that matches nothing.

    An entry without a camera is a warning: a camera file may serve many recordings. Who sees them all
    knows whether it is an error (`stadimeter.summary`).

    Args:
        entries: cameras of the camera file.
        cameras: of the recording, with the topic of their pictures.
        topics: all topics of the recording.
        found: names of entries and of their exposure fields of which a value was read.
    """
    names = set(cameras) | set(cameras.values())
    missing = [entry.name for entry in entries if entry.name not in names]
    some = list(cameras.items())[:MOST_NAMED]
    there = ", ".join(f"{name!r} on {topic!r}" for name, topic in some)
    for name in missing[:MOST_NAMED] if cameras else ():
        yield Diagnostic(
            Severity.WARNING,
            "unmatched_camera",
            f"the camera file's entry {name!r} matches no camera of this recording, so what it states is "
            f"not used; the cameras are {there}. Name one by its frame_id or by its topic",
            camera=name,
        )
    for entry in entries:
        if entry.name in missing:
            continue
        for name in FIELDS:
            spec = getattr(entry.exposure, name)
            if spec and (entry.name, name) not in found:
                yield _no_field(entry.name, name, spec, topics)


def _no_field(camera: str, field: str, spec: str, topics: Collection[str]) -> Diagnostic:
    path = spec.split()[0]
    fitting = [topic for topic in topics if path.startswith(f"{topic}.")]
    if fitting:
        reason = f"the messages on {max(fitting, key=len)!r} have no such number"
    else:
        some = ", ".join(sorted(topics)[:MOST_NAMED])
        more = ", ..." if len(topics) > MOST_NAMED else ""
        reason = f"no topic fits; there are {some}{more}"
    return Diagnostic(
        Severity.ERROR,
        "unmatched_exposure",
        f"exposure.{field} = {spec!r} of the camera file matches nothing: {reason}",
        camera=camera,
    )
