"""From messages to frames: in order of time, cameras apart, each with what belongs to its time.

Exposure, truth and detections may be logged after the picture that they speak of, so a picture
waits until the recording has moved on by the look-ahead. What waits is still encoded, and bounded.
"""

from __future__ import annotations

import heapq
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

from pipeline.config import IngestConfig
from pipeline.diagnostics import Notes
from pipeline.ingest.lanes import Lane
from pipeline.ingest.mcap_records import MAX_TIME_NS, ChannelInfo, McapFile, RawMessage
from pipeline.ingest.messages import (
    Decoded,
    EncodedImage,
    Kind,
    UndecodableMessage,
    decode,
    is_unread_image,
    kind_of,
)
from pipeline.records import UNKNOWN_EXPOSURE, Diagnostic, Frame, Pairing, Severity

MAX_WAITING = 64  # pictures, where log times make no sense; `Limits` bounds their bytes


@dataclass(order=True, slots=True)
class _Waiting:
    log_time_ns: int
    order: int
    camera: str = field(compare=False)
    capture_time_ns: int | None = field(compare=False)
    image: EncodedImage = field(compare=False)
    topic: str = field(compare=False)
    byte_offset: int = field(compare=False)


class FrameAssembler:
    """Reads a file's messages and yields its frames."""

    def __init__(self, file: McapFile, config: IngestConfig, notes: Notes) -> None:
        self.file = file
        self.cameras: dict[str, str] = {}  # image topic -> camera
        self.frame_ids: dict[str, str] = {}  # camera -> frame_id
        self._notes = notes
        self._tolerance_ns = round(config.exposure_tolerance_s * 1e9)
        self._look_ahead_ns = max(self._tolerance_ns, round(config.reorder_s * 1e9))
        self._lanes: dict[tuple[Kind, str, str], Lane[Any]] = {}
        self._lane_of: dict[tuple[Kind, str], Lane[Any] | None] = {}
        self._limits = file.limits
        self._images_refused = 0
        self._waiting: list[_Waiting] = []
        self._waiting_bytes = 0
        self._newest_ns = 0
        self._order = 0
        self._frame_counts: dict[str, int] = {}
        self._kinds: dict[tuple[int, ChannelInfo], Kind | None] = {}

    def has_detections(self, camera: str) -> bool:
        """Whether recorded detections for a camera were seen so far."""
        return self._lane_for(Kind.DETECTIONS, camera) is not None

    @property
    def frames_lost(self) -> int:
        """How many pictures are known to have been lost or could not be read as messages."""
        channels = self.file.channels
        return self._images_refused + sum(
            count
            for channel_id, count in self.file.lost_counts.items()
            if channel_id in channels and kind_of(channels[channel_id]) is Kind.IMAGE
        )

    def __iter__(self) -> Iterator[Frame]:
        for raw in self.file.messages():
            kind = self._kind(raw)
            if kind is not None:
                self._take(kind, raw)
                yield from self._release()
        while self._waiting:
            yield self._assemble(self._next_waiting())

    def _kind(self, raw: RawMessage) -> Kind | None:
        key = (raw.channel_id, raw.channel)
        if key not in self._kinds:
            self._kinds[key] = kind_of(raw.channel)
            if is_unread_image(raw.channel):
                self._note(
                    Severity.WARNING,
                    "unsupported_channel",
                    f"schema {raw.channel.schema_name!r} in encoding "
                    f"{raw.channel.message_encoding!r} is not read",
                    raw,
                )
        return self._kinds[key]

    def _take(self, kind: Kind, raw: RawMessage) -> None:
        if raw.log_time_ns > MAX_TIME_NS:
            self._refuse(kind, "invalid_time", "the log time is beyond the year 2262", raw)
            return
        if kind is not Kind.IMAGE and len(raw.data) > self._limits.message_bytes:
            text = f"a {kind} message of {len(raw.data):,} bytes, the limit is "
            text += f"{self._limits.message_bytes:,}"
            self._refuse(kind, "oversized_message", text, raw)
            return
        try:
            message = decode(kind, raw.data)
        except UndecodableMessage as error:
            self._refuse(kind, "damaged_message", f"no {kind} message: {error}", raw)
            return
        for sentence in message.refused:
            code = "invalid_exposure" if kind is Kind.EXPOSURE else "invalid_value"
            self._note(Severity.WARNING, code, sentence, raw)
        if len(message.frame_id) > self._limits.name_bytes:
            self._refuse(kind, "oversized_name", "its frame_id is too long", raw)
            return
        self._newest_ns = max(self._newest_ns, raw.log_time_ns)
        if isinstance(message.payload, EncodedImage):
            self._enqueue(message, message.payload, raw)
        else:
            lane = self._lane(kind, raw, message)
            if lane is not None:
                stated_ns = message.capture_time_ns
                lane.add(raw.log_time_ns if stated_ns is None else stated_ns, message.payload)

    def _refuse(self, kind: Kind, code: str, problem: str, raw: RawMessage) -> None:
        if kind is Kind.IMAGE:
            self._images_refused += 1
        self._note(Severity.ERROR, code, problem, raw)

    def _enqueue(self, message: Decoded, image: EncodedImage, raw: RawMessage) -> None:
        topic = raw.channel.topic
        if topic not in self.cameras:
            if len(self.cameras) >= self._limits.cameras:
                text = f"more than {self._limits.cameras} topics with pictures"
                self._refuse(Kind.IMAGE, "too_many_cameras", text, raw)
                return
            taken = message.frame_id in self.frame_ids
            camera = topic if taken or not message.frame_id else message.frame_id
            self.cameras[topic] = camera
            self.frame_ids[camera] = message.frame_id
            self._lane_of.clear()
        self._order += 1
        self._waiting_bytes += len(image.data)
        heapq.heappush(
            self._waiting,
            _Waiting(
                raw.log_time_ns,
                self._order,
                self.cameras[topic],
                message.capture_time_ns,
                image,
                topic,
                raw.byte_offset,
            ),
        )

    def _lane(self, kind: Kind, raw: RawMessage, message: Decoded) -> Lane[Any] | None:
        key = (kind, raw.channel.topic, message.frame_id)
        if key in self._lanes:
            return self._lanes[key]
        if len(self._lanes) >= self._limits.sources:
            text = f"more than {self._limits.sources:,} sources (topics and frame_ids)"
            self._refuse(kind, "too_many_sources", text, raw)
            return None
        stated, limit = message.capture_time_ns is not None, self._limits.waiting_values
        lane: Lane[Any] = Lane(
            raw.channel.topic, message.frame_id, by_capture_time=stated, limit=limit
        )
        self._lanes[key] = lane
        self._lane_of.clear()
        return lane

    def _release(self) -> Iterator[Frame]:
        while self._waiting and (
            self._waiting[0].log_time_ns + self._look_ahead_ns < self._newest_ns
            or len(self._waiting) > MAX_WAITING
            or self._waiting_bytes > self._limits.waiting_bytes
        ):
            yield self._assemble(self._next_waiting())

    def _next_waiting(self) -> _Waiting:
        waiting = heapq.heappop(self._waiting)
        self._waiting_bytes -= len(waiting.image.data)
        return waiting

    def _assemble(self, waiting: _Waiting) -> Frame:
        camera, image = waiting.camera, waiting.image
        exposure = self._nearest_or_last(Kind.EXPOSURE, waiting)
        intrinsics = self._nearest_or_last(Kind.CALIBRATION, waiting)
        truth = self._taken(Kind.TRUTH, waiting)
        index = self._frame_counts.get(camera, 0)
        self._frame_counts[camera] = index + 1
        return Frame(
            camera=camera,
            frame_index=index,
            log_time_ns=waiting.log_time_ns,
            capture_time_ns=_time_for(waiting),
            image_format=image.format,
            image=image.data,
            exposure=exposure.value if exposure else UNKNOWN_EXPOSURE,
            exposure_pairing=exposure.pairing if exposure else Pairing.NONE,
            exposure_offset_ns=exposure.offset_ns if exposure else None,
            intrinsics=intrinsics.value if intrinsics else None,
            detections=self._taken(Kind.DETECTIONS, waiting),
            truth=truth or (),
            topic=waiting.topic,
            byte_offset=waiting.byte_offset,
        )

    def _nearest_or_last(self, kind: Kind, waiting: _Waiting) -> Any:
        lane = self._lane_for(kind, waiting.camera)
        if lane is None:
            return None
        time_ns = _time_for(waiting, lane)
        lane.forget_before(time_ns - self._look_ahead_ns)
        return lane.nearest(time_ns, self._tolerance_ns) or lane.last_known(time_ns)

    def _taken(self, kind: Kind, waiting: _Waiting) -> Any:
        lane = self._lane_for(kind, waiting.camera)
        if lane is None:
            return None
        time_ns = _time_for(waiting, lane)
        lane.forget_before(time_ns - self._look_ahead_ns)
        return lane.take(time_ns, self._tolerance_ns)

    def _lane_for(self, kind: Kind, camera: str) -> Lane[Any] | None:
        """Return the lane that belongs to a camera.

        By equal frame_id; else, where the messages name no camera that has pictures, by the
        deepest shared topic namespace; else, if there is one camera only, whatever there is.
        """
        key = (kind, camera)
        if key not in self._lane_of:
            self._lane_of[key] = self._find_lane(kind, camera)
        return self._lane_of[key]

    def _find_lane(self, kind: Kind, camera: str) -> Lane[Any] | None:
        lanes = [lane for (k, _, _), lane in self._lanes.items() if k is kind]
        frame_id = self.frame_ids[camera]
        same = [lane for lane in lanes if lane.frame_id and lane.frame_id == frame_id]
        known = set(self.frame_ids.values()) - {""}
        nameless = [lane for lane in lanes if lane.frame_id not in known]
        topic = next(t for t, c in self.cameras.items() if c == camera)
        candidates = same or nameless
        if not candidates:
            return None
        best = max(candidates, key=lambda lane: _shared_namespace(lane.topic, topic))
        if same or len(self.cameras) == 1 or _shared_namespace(best.topic, topic) > 0:
            return best
        return None

    def _note(self, severity: Severity, code: str, message: str, raw: RawMessage) -> None:
        self._notes.add(
            Diagnostic(
                severity,
                code,
                message,
                topic=raw.channel.topic,
                byte_offset=raw.byte_offset,
                log_time_ns=min(raw.log_time_ns, MAX_TIME_NS),
            )
        )


def _time_for(waiting: _Waiting, lane: Lane[Any] | None = None) -> int:
    """Return the frame's time on the clock that a lane uses: capture times, or log times."""
    if waiting.capture_time_ns is None or (lane is not None and not lane.by_capture_time):
        return waiting.log_time_ns
    return waiting.capture_time_ns


def _shared_namespace(a: str, b: str) -> int:
    """Return how many leading parts two topics share: "/front/image", "/front/exposure" -> 1."""
    count = 0
    for x, y in zip(a.strip("/").split("/")[:-1], b.strip("/").split("/")[:-1], strict=False):
        if x != y:
            break
        count += 1
    return count
