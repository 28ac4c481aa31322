"""Frames from messages: in order of time, cameras apart, each with what belongs to its time.

Exposure, truth and detections may be logged after the picture that they speak of, so a picture
waits until the recording has moved on by the look-ahead. What waits is still encoded, and bounded.
"""

from __future__ import annotations

import math
from collections.abc import Generator, Iterator, Sequence
from dataclasses import replace
from typing import Any

from pipeline.core.config import CameraConfig, IngestConfig
from pipeline.core.diagnostics import Notes
from pipeline.core.errors import MissingLibrary, UnsupportedChannel
from pipeline.core.exposure import FIELDS, UNKNOWN_EXPOSURE, Exposure
from pipeline.core.records import Boxes, Diagnostic, Frame, LensClaim, Pairing, Severity
from pipeline.images.exif import exif_block, exposure_of, read_tags
from pipeline.images.header import image_size
from pipeline.ingest.cameras import Cameras, Why
from pipeline.ingest.class_labels import StatedLabels
from pipeline.ingest.clocks import CameraClock
from pipeline.ingest.lanes import Lanes
from pipeline.ingest.logged_behind import (
    messages_behind,
    messages_in_order,
    order_notes,
    order_of,
)
from pipeline.ingest.named_exposure import NamedExposure, filled
from pipeline.ingest.pairing import Paired
from pipeline.ingest.pairing_notes import TAKEN, pairing_notes
from pipeline.ingest.partners import Asked, Partners
from pipeline.ingest.plausibility import refuse_implausible
from pipeline.ingest.pose import BODY_FRAME, MOVING, CameraPose, TransformTree, UnusablePose
from pipeline.ingest.sample_bits import SampleBits
from pipeline.ingest.sources import Channels, Repeats, Source
from pipeline.ingest.video.access_units import Times
from pipeline.ingest.video.video_stream import Out
from pipeline.ingest.video.videos import OfCamera, Videos
from pipeline.ingest.waiting import Waiting, WaitingRoom
from pipeline.mcap_file.reader import MAX_TIME_NS, McapFile, RawMessage
from pipeline.messages.content import ClassLabels, Decoded, EncodedImage, Kind, VideoPacket
from pipeline.messages.lens_readings import NO_LENS, Found, LensReadings
from pipeline.messages.named_numbers import named_numbers
from pipeline.messages.registry import kind_of
from pipeline.messages.tree import UndecodableMessage

OF_ONE_PICTURE = (Kind.IMAGE, Kind.VIDEO, *TAKEN)


class FrameAssembler:
    """Reads a file's messages and yields its frames.

    Args:
        file: the recording.
        config: how messages become frames.
        notes: receives whatever is refused or lost.
        cameras: those of the camera file, which may name fields that hold exposure values.
        decode_video: whether frames of a video stream are decoded; else they are its packets.
    """

    def __init__(
        self,
        file: McapFile,
        config: IngestConfig,
        notes: Notes,
        cameras: Sequence[CameraConfig] = (),
        *,
        decode_video: bool = True,
    ) -> None:
        self.file = file
        self.poses: dict[str, CameraPose] = {}  # by the recording's transforms
        self.moving: set[str] = set()  # cameras that have several poses
        self._names = Cameras(file.limits.cameras)
        self.cameras = self._names.topics  # camera -> topic of its pictures
        self.frame_ids = self._names.frame_ids  # camera -> frame_id
        self._notes = notes
        tolerance_ns = round(config.exposure_tolerance_s * 1e9)
        self._look_ahead_ns = max(tolerance_ns, round(config.reorder_s * 1e9))
        self._partners = Partners(tolerance_ns, self._look_ahead_ns)
        self._limits = file.limits
        self._lanes = Lanes(
            self.cameras,
            self.frame_ids,
            limit=file.limits.waiting_values,
            most=file.limits.sources,
        )
        self._images_refused = 0
        self._waiting = WaitingRoom(self._look_ahead_ns, file.limits.waiting_bytes)
        self._clocks: dict[str, CameraClock] = {}
        self._frame_counts: dict[str, int] = {}
        self._channels = Channels(file.limits, named_numbers(cameras), self._tell)
        self._named = NamedExposure(file.limits.waiting_values)
        self._labels = StatedLabels(file.limits.sources)
        self._transforms = TransformTree(config.ground_frame)
        self._posed: dict[str, int] = {}  # camera -> version of the transforms
        self._decode_video = decode_video
        self._videos = Videos(file)
        self._readings = LensReadings()
        self._repeats = Repeats()
        self._bits = SampleBits(self._note, file.limits.image_pixels)

    def has_detections(self, camera: str) -> bool:
        """Return whether recorded detections for a camera were seen so far."""
        return self._lanes.of_camera(Kind.DETECTIONS, camera) is not None

    @property
    def named_fields(self) -> set[tuple[str, str]]:
        """Names of cameras and exposure fields that a camera file places, and that were read."""
        return self._named.found

    @property
    def frames_lost(self) -> int:
        """Number of pictures that are known to be lost or could not be read as messages."""
        lost = self.file.pictures_lost(lambda channel: kind_of(channel) in (Kind.IMAGE, Kind.VIDEO))
        return self._images_refused + lost

    def __iter__(self) -> Generator[Frame, None, None]:
        for raw in self._messages():
            source = self._channels.source(raw)
            if source.decoder is not None or source.named:
                self._take(source, raw)
                yield from self._release(raw.log_time_ns)
        for out in self._videos.flush():
            self._enqueue_decoded(out)
        yield from self._release(None)
        for note in pairing_notes(self._lanes, self._partners.ways, self.cameras):
            self._notes.add(note)

    def _messages(self) -> Iterator[RawMessage]:
        """Yield the messages in order, but those that were taken before all others."""
        if type(self.file) is not McapFile:  # a part of a recording that is in order
            yield from self.file.messages_by_log_time(self._look_ahead_ns)
            return
        order = order_of(self.file.path, self._limits, look_again=self._decode_video)
        for note in order_notes(order):
            self._notes.add(note)
        for raw in messages_behind(self.file.path, self._limits, order):
            source = self._channels.source(raw)
            if source.decoder is not None or source.named:
                self._take(source, raw)
        yield from messages_in_order(self.file, order, self._look_ahead_ns)

    def _take(self, source: Source, raw: RawMessage) -> None:
        kind = source.decoder.kind if source.decoder else Kind.EXPOSURE
        if raw.log_time_ns > MAX_TIME_NS:
            self._refuse(kind, "invalid_time", "the log time is beyond the year 2262", raw)
            return
        if not source.is_image and len(raw.data) > self._limits.message_bytes:
            text = f"a {kind} message of {len(raw.data):,} bytes, the limit is "
            text += f"{self._limits.message_bytes:,}"
            self._refuse(kind, "oversized_message", text, raw)
            return
        try:
            if source.named:
                for sentence in self._named.add(source, raw):
                    self._note(Severity.WARNING, "absent_field", sentence, raw)
            if source.decoder is not None:
                self._take_message(kind, source.decoder(raw.data), raw)
        except UndecodableMessage as error:
            self._refuse(kind, "damaged_message", f"no {kind} message: {error}", raw)

    def _take_message(self, kind: Kind, message: Decoded, raw: RawMessage) -> None:
        message = refuse_implausible(message)
        for sentence in message.refused:
            self._note(Severity.WARNING, message.code, sentence, raw)
        if len(message.frame_id) > self._limits.name_bytes:
            self._refuse(kind, "oversized_name", "its frame_id is too long", raw)
            return
        payload = message.payload
        if payload is None:
            return
        if kind in OF_ONE_PICTURE and self._repeats.has(message, raw):
            text = "a message is there twice, with the same stamp and content; it is used once"
            self._note(Severity.WARNING, "repeated_message", text, raw)
            return
        if isinstance(payload, EncodedImage):
            self._enqueue_image(message, payload, raw)
        elif isinstance(payload, VideoPacket):
            self._enqueue_video(message, payload, raw)
        elif isinstance(payload, ClassLabels):
            self._labels.add(raw.channel.topic, payload)
        elif kind is Kind.TRANSFORMS:
            self._transforms.add(payload)  # type: ignore[arg-type]
            for camera in self.frame_ids:
                self._find_pose(camera, raw)
        else:
            self._keep_value(kind, message, raw)

    def _keep_value(self, kind: Kind, message: Decoded, raw: RawMessage) -> None:
        """Let a value wait for the pictures that it belongs to."""
        stated_ns, topic = message.capture_time_ns, raw.channel.topic
        lane = self._lanes.of_source(kind, topic, message.frame_id)
        if lane is None:
            text = f"more than {self._limits.sources:,} sources (topics and frame_ids)"
            self._refuse(kind, "too_many_sources", text, raw)
            return
        lane.add(raw.log_time_ns, stated_ns, message.payload)
        usual_ns = lane.delays.usual_ns
        if kind in TAKEN and usual_ns is not None:
            delays = [d for c in self._clocks.values() if (d := c.delays.usual_ns) is not None]
            self._waiting.wait_longer(min(delays, default=0) - usual_ns)

    def _refuse(self, kind: Kind, code: str, problem: str, raw: RawMessage) -> None:
        if kind in (Kind.IMAGE, Kind.VIDEO):
            self._images_refused += 1
        self._note(Severity.ERROR, code, problem, raw)

    def _camera(self, message: Decoded, raw: RawMessage) -> str | None:
        """Return the camera of a picture; None, and tell why, if it is not measured."""
        topic, known = raw.channel.topic, len(self._names.topics)
        found = self._names.find(topic, message.frame_id)
        if len(self._names.topics) != known:
            self._lanes.forget_choices()
        if found is Why.TOO_MANY:
            text = f"more than {self._limits.cameras} cameras (topics and frame_ids of pictures)"
            self._refuse(Kind.IMAGE, str(found), text, raw)
            return None
        if found is Why.SAME_CAMERA:
            other = self._names.others[topic]
            text = f"its pictures are of the camera {other!r}, whose pictures on "
            text += f"{self.cameras[other]!r} are measured; those here are left out"
            self._note(Severity.INFO, str(found), text, raw)
            return None
        return found

    def _enqueue_image(self, message: Decoded, image: EncodedImage, raw: RawMessage) -> None:
        camera = self._camera(message, raw)
        if camera is not None:
            image = self._bits.told(image, raw)
            times = Times(raw.log_time_ns, message.capture_time_ns)
            self._enqueue(camera, image, times, raw)

    def _enqueue_video(self, message: Decoded, packet: VideoPacket, raw: RawMessage) -> None:
        camera = self._camera(message, raw)
        if camera is None:
            return
        times = Times(raw.log_time_ns, message.capture_time_ns)
        if not self._decode_video:
            self._enqueue(camera, EncodedImage(packet.codec, packet.data), times, raw)
            return
        try:
            for out in self._videos.decode(packet, raw, times, camera):
                self._enqueue_decoded(out)
        except MissingLibrary as error:
            self._refuse(Kind.VIDEO, "missing_library", str(error), raw)
        except UnsupportedChannel as error:
            self._refuse(Kind.VIDEO, "unsupported_channel", error.problem, raw)

    def _enqueue_decoded(self, out: Out[OfCamera]) -> None:
        if out.problem:
            text = f"a frame of the video was left out: {out.problem}"
            self._note(Severity.ERROR, "video_gap", text, out.item.raw)
        self._enqueue(out.item.camera, out.image, out.times, out.item.raw)

    def _enqueue(self, camera: str, image: EncodedImage, times: Times, raw: RawMessage) -> None:
        waiting = Waiting(
            times.log_time_ns,
            0,
            camera,
            times.capture_time_ns,
            image,
            raw.channel.topic,
            raw.byte_offset,
        )
        self._clock(waiting).seen.append(waiting.moment)
        self._waiting.put(waiting)

    def _clock(self, waiting: Waiting) -> CameraClock:
        camera = waiting.camera
        if camera not in self._clocks:

            def tell(code: str, text: str) -> None:
                note = Diagnostic(Severity.WARNING, code, text, camera=camera, topic=waiting.topic)
                self._notes.add(replace(note, log_time_ns=clock.log_time_ns))

            clock = self._clocks[camera] = CameraClock(tell)
        return self._clocks[camera]

    def _release(self, now_ns: int | None) -> Iterator[Frame]:
        for waiting, following in self._waiting.due(now_ns):
            clock = self._clock(waiting)
            waiting.capture_time_ns = clock.capture_time_ns(waiting.moment, following)
            yield self._assemble(waiting, Asked(waiting.moment, clock, next(iter(following), None)))

    def _assemble(self, waiting: Waiting, asked: Asked) -> Frame:
        camera, image = waiting.camera, waiting.image
        exposure = self._exposure(waiting, asked)
        lens = self._lens(waiting, asked)
        truth = self._taken(Kind.TRUTH, camera, asked)
        self._find_pose(camera, waiting)
        index = self._frame_counts.get(camera, 0)
        self._frame_counts[camera] = index + 1
        return Frame(
            camera=camera,
            frame_index=index,
            log_time_ns=waiting.log_time_ns,
            capture_time_ns=waiting.capture_time_ns,
            image_format=image.format,
            image=image.data,
            exposure=exposure.value if exposure else UNKNOWN_EXPOSURE,
            exposure_pairing=exposure.pairing if exposure else Pairing.NONE,
            exposure_offset_ns=exposure.offset_ns if exposure else None,
            intrinsics=lens.lens,
            detections=self._boxes(camera, asked),
            truth=truth or (),
            topic=waiting.topic,
            byte_offset=waiting.byte_offset,
            layout=image.layout,
            rectified=lens.rectified,
        )

    def _lens(self, waiting: Waiting, asked: Asked) -> Found:
        """Return the lens of a picture by the calibration of its time; tell what is odd about it."""
        claim: Paired[LensClaim] | None = self._nearest_or_last(
            Kind.CALIBRATION, waiting.camera, asked
        )
        if claim is None:
            return NO_LENS
        image = waiting.image
        layout = image.layout
        size = (layout.width_px, layout.height_px) if layout else image_size(image.data)
        found = self._readings.lens(claim.value, size, waiting.topic)
        if found.code:
            self._tell_of_picture(Severity.WARNING, found.code, found.sentence, waiting)
        return found

    def _exposure(self, waiting: Waiting, asked: Asked) -> Paired[Exposure] | None:
        """Return what is known of a picture's exposure.

        The fields that a camera file names go first, then the messages; what both leave open may
        stand in the picture's own EXIF.
        """
        found: Paired[Exposure] | None = self._nearest_or_last(Kind.EXPOSURE, waiting.camera, asked)
        names = waiting.camera, waiting.topic
        found, refused = self._named.fill(
            names, lambda lane: self._partners.find(lane, asked), found
        )
        for sentence in refused:
            self._tell_of_picture(Severity.WARNING, "invalid_exposure", sentence, waiting)
        if waiting.image.layout is not None:
            return found
        block = exif_block(waiting.image.data)
        if block is None:
            return found
        width_px, height_px = image_size(waiting.image.data) or (0, 0)
        own, refused = exposure_of(read_tags(block), width_px, height_px)
        for sentence in refused:
            self._tell_of_picture(Severity.WARNING, "invalid_exposure", sentence, waiting)
        if found is None:
            known = any(not math.isnan(getattr(own, name)) for name in FIELDS)
            return Paired(own, Pairing.EMBEDDED, 0) if known else None
        return found._replace(value=filled(found.value, own))

    def _find_pose(self, camera: str, at: Waiting | RawMessage) -> None:
        """Learn a camera's pose from the transforms; say when it moves, or cannot be told."""
        version = self._transforms.version
        if self._posed.get(camera, 0) == version:
            return
        self._posed[camera] = version
        try:
            pose = self._transforms.pose(self.frame_ids[camera])
        except UnusablePose as error:
            self._tell_of_camera("pose_unused", str(error), camera, at)
            return
        if pose is None:
            return
        if pose.is_of_body:
            self._tell_of_camera("body_frame", BODY_FRAME, camera, at)
        if pose.moved_from(self.poses.setdefault(camera, pose)) and camera not in self.moving:
            self.moving.add(camera)
            self._tell_of_camera("moving_camera", MOVING, camera, at)

    def _tell_of_camera(self, code: str, text: str, camera: str, at: Waiting | RawMessage) -> None:
        note = Diagnostic(Severity.WARNING, code, text, camera=camera, byte_offset=at.byte_offset)
        self._notes.add(replace(note, log_time_ns=min(at.log_time_ns, MAX_TIME_NS)))

    def _nearest_or_last(self, kind: Kind, camera: str, asked: Asked) -> Any:
        lane = self._lanes.of_camera(kind, camera)
        return None if lane is None else self._partners.find(lane, asked)

    def _boxes(self, camera: str, asked: Asked) -> Boxes | None:
        """Return the boxes of a picture, with the class names that the recording states by then."""
        boxes: Boxes | None = self._taken(Kind.DETECTIONS, camera, asked)
        lane = self._lanes.of_camera(Kind.DETECTIONS, camera)
        return boxes if boxes is None or lane is None else self._labels.named(boxes, lane.topic)

    def _taken(self, kind: Kind, camera: str, asked: Asked) -> Any:
        lane = self._lanes.of_camera(kind, camera)
        if lane is None:
            return None
        caused = kind is Kind.DETECTIONS
        found = self._partners.take(lane, asked, camera, is_caused=caused)
        return None if found is None else found.value

    def _tell(self, code: str, message: str, raw: RawMessage) -> None:
        self._note(Severity.WARNING, code, message, raw)

    def _tell_of_picture(
        self, severity: Severity, code: str, message: str, waiting: Waiting
    ) -> None:
        self._notes.add(
            Diagnostic(
                severity,
                code,
                message,
                camera=waiting.camera,
                topic=waiting.topic,
                byte_offset=waiting.byte_offset,
                log_time_ns=waiting.log_time_ns,
            )
        )

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
