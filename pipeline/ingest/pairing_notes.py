"""Diagnostics of how values were paired with pictures, and of those that found none."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from statistics import median
from typing import Any

from pipeline.core.config import EXPOSURE_TOLERANCE_S
from pipeline.core.records import Diagnostic, Severity
from pipeline.ingest.lanes import Lanes
from pipeline.ingest.pairing import Lane
from pipeline.ingest.partners import AHEAD_NS, EXACT_NS, SHARED_NS, Ways
from pipeline.messages.content import Kind

# Kinds of which each value belongs to one picture.
TAKEN = (Kind.DETECTIONS, Kind.TRUTH)
# Some at both ends of a recording have no picture there.
_FEW, _FEW_SHARE = 2, 0.02
_FEWEST, _MOST_SHARE = 8, 0.8
# A driver that states its own time is as late as this at most.
_AT_ITS_TIME_NS = round(EXPOSURE_TOLERANCE_S * 1e9)
# Kinds that hold on until they are said anew, and the code where a camera has none of them.
_SETTINGS = {Kind.CALIBRATION: "unused_calibration", Kind.EXPOSURE: "unused_exposure"}
_WORDS = {Kind.DETECTIONS: "messages with boxes", Kind.TRUTH: "messages with ground truth"}


def pairing_notes(
    lanes: Lanes, ways: Mapping[tuple[int, str], Ways], cameras: Mapping[str, str]
) -> Iterator[Diagnostic]:
    """Yield what is to be told of the pairing of a recording.

    Args:
        lanes: all its sources.
        ways: how the values of each were paired, by `id` of the lane and camera.
        cameras: topic of the pictures by camera.
    """
    yield from _unused_settings(lanes, cameras)
    for kind, lane in lanes:
        if kind is Kind.EXPOSURE:
            yield from _of_settings(lane)
        if kind not in TAKEN:
            continue
        of_lane = {camera: w for (number, camera), w in ways.items() if number == id(lane)}
        for camera, way in of_lane.items():
            yield from _of_way(kind, lane, camera, way)
        lost = lane.added - lane.taken
        if lost and cameras:
            yield _unpaired(kind, lane, lost, of_lane, sorted(cameras))


def _of_way(kind: Kind, lane: Lane[Any], camera: str, way: Ways) -> Iterator[Diagnostic]:
    words = _WORDS[kind]
    if way.by_log and (
        not lane.distinct
        or way.clock_offset_ns is None
        or not -SHARED_NS <= way.clock_offset_ns <= AHEAD_NS
    ):
        if way.clock_offset_ns is None or not lane.distinct:
            reason = "one of the two states no usable times"
            severity = Severity.INFO if lane.distinct else Severity.WARNING
        else:
            reason = f"the clocks of their stamps differ by {way.clock_offset_ns / 1e9:+,.3f} s"
            severity = Severity.WARNING
        text = f"{words} were paired with pictures by log times, as {reason}; they are logged "
        text += (
            f"{_ms(way.by_log)} ms after their pictures (median); if they are of other pictures, "
        )
        text += "let the detector copy the stamps of its pictures"
        yield _note(severity, "paired_by_log_time", text, lane, camera, len(way.by_log))
    if way.by_stamp and abs(median(way.by_stamp)) > EXACT_NS:
        text = (
            f"{words} are stamped {_ms(way.by_stamp)} ms after their pictures (median); each was "
        )
        text += f"paired with the picture that fits this best, within {way.tolerance_ns / 1e6:.0f} ms; a "
        text += "delay of whole pictures more cannot be seen: let the detector copy the stamps"
        yield _note(Severity.WARNING, "paired_by_nearest", text, lane, camera, len(way.by_stamp))


def _unused_settings(lanes: Lanes, cameras: Mapping[str, str]) -> Iterator[Diagnostic]:
    """Tell of calibrations and exposures that no picture got, where a camera is left without."""
    for kind, code in _SETTINGS.items():
        of_cameras = {camera: lanes.of_camera(kind, camera) for camera in cameras}
        without = sorted(c for c, lane in of_cameras.items() if lane is None or not lane.asked)
        used = {id(lane) for lane in of_cameras.values()}
        for other, lane in lanes:
            if other is not kind or lane.asked or not without:
                continue
            text = f"{lane.added:,} messages with {kind} were not used: "
            if id(lane) in used:
                text += (
                    "their times are those of no picture; their clock must be that of the pictures"
                )
            else:
                text += f"they belong to no camera, and {', '.join(without)} has none: frame_id "
                text += f"({lane.frame_id!r}) or topic namespace must be those of the pictures"
            yield _note(Severity.WARNING, code, text, lane, None, lane.added)


def _of_settings(lane: Lane[Any]) -> Iterator[Diagnostic]:
    """Say so if there is a message for each picture, but not at its time."""
    offsets = list(lane.offsets_ns)
    each_has_one = lane.added >= _MOST_SHARE * lane.asked
    if len(offsets) < _FEWEST or not each_has_one or abs(median(offsets)) <= _AT_ITS_TIME_NS:
        return
    text = f"messages with exposure are {_ms(offsets)} ms after their pictures (median; below 0: "
    text += "before them), so they may be of other pictures: let the driver copy the stamps of the "
    text += "pictures"
    yield _note(Severity.WARNING, "exposure_offset", text, lane, None, lane.asked)


def _unpaired(
    kind: Kind, lane: Lane[Any], lost: int, ways: Mapping[str, Ways], cameras: list[str]
) -> Diagnostic:
    words = _WORDS[kind]
    few = lost <= max(_FEW, _FEW_SHARE * lane.added)
    text = f"{lost:,} of {lane.added:,} {words} found no picture"
    if not ways:
        text += f": they belong to none of the cameras {', '.join(cameras)}; frame_id "
        text += f"({lane.frame_id!r}) or topic namespace must be those of the pictures"
    else:
        tolerance_ns = max(way.tolerance_ns for way in ways.values())
        text += f" within {tolerance_ns / 1e6:.0f} ms" if tolerance_ns else ""
        text += ", and were not used"
        if not few:
            text += (
                ": their times or their pictures are missing or wrong; let the detector copy the "
            )
            text += (
                "stamps of its pictures, or raise ingest.exposure_tolerance_s in the camera file"
            )
    camera = next(iter(ways)) if len(ways) == 1 else None
    severity = Severity.INFO if few and ways else Severity.WARNING
    code = "unpaired_boxes" if kind is Kind.DETECTIONS else "unpaired_truth"
    return _note(severity, code, text, lane, camera, lost)


def _ms(offsets_ns: list[int]) -> str:
    return f"{median(offsets_ns) / 1e6:.1f}"


def _note(
    severity: Severity, code: str, text: str, lane: Lane[Any], camera: str | None, count: int
) -> Diagnostic:
    return Diagnostic(severity, code, text, camera=camera, topic=lane.topic, count=count)
