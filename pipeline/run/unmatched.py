"""Entries of the camera file that match nothing in a recording: told, with what there is."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence

from pipeline.core.config import CameraConfig
from pipeline.core.exposure import FIELDS
from pipeline.core.records import Diagnostic, Severity

MOST_NAMED = 20  # things that a message lists


def unmatched(
    entries: Sequence[CameraConfig],
    cameras: Mapping[str, str],
    topics: Collection[str],
    found: Collection[tuple[str, str]],
) -> Iterator[Diagnostic]:
    """Yield a note for each entry, and each field that it names, that matches nothing.

    A camera file may serve many recordings, so an entry for another camera is a warning; that none of
    the entries is for a camera of the recording is an error.

    Args:
        entries: cameras of the camera file.
        cameras: of the recording, with the topic of their pictures.
        topics: all topics of the recording.
        found: names of entries and of their exposure fields of which a value was read.
    """
    names = set(cameras) | set(cameras.values())
    missing = [entry.name for entry in entries if entry.name not in names]
    if missing and cameras:
        severity = Severity.ERROR if len(missing) == len(entries) else Severity.WARNING
        there = ", ".join(f"{name!r} on {topic!r}" for name, topic in cameras.items())
        yield Diagnostic(
            severity,
            "unmatched_camera",
            f"the camera file's {', '.join(map(repr, missing[:MOST_NAMED]))} match no camera of this "
            f"recording, so what is stated there is not used; its cameras are {there}. Name one by its "
            "frame_id or by its topic",
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
