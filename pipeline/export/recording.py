"""`stadimeter export`: the original is copied as a stream, our messages in between by log time."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from google.protobuf.message import Message
from mcap.data_stream import ReadDataStream
from mcap.records import Attachment
from mcap.writer import CompressionType, Writer

from pipeline import __version__
from pipeline.core.camera_row import camera_rows
from pipeline.core.config import Limits
from pipeline.core.diagnostics import Notes
from pipeline.core.errors import StadimeterError, UsageError, Where
from pipeline.core.files import whole_file
from pipeline.core.progress import Progress, Report, silent
from pipeline.export.annotations import CameraScene
from pipeline.export.results import FrameResult, frame_results
from pipeline.ingest.sources import EXPORTED
from pipeline.mcap_file.bag import is_recording, open_bytes, size_of
from pipeline.mcap_file.reader import ChannelInfo, McapFile, RawMessage
from pipeline.mcap_file.writer import CHUNK_BYTES, schema_of
from pipeline.store.database import Store
from pipeline.store.recordings import list_recordings


@dataclass(frozen=True, slots=True)
class Exported:
    """Counts of an export, and notes on parts of the original that were lost."""

    messages: int
    frames: int
    objects: int
    notes: Notes


def export_recording(
    recording: Path, database: Path, target: Path, limits: Limits, report: Report = silent
) -> Exported:
    """Write a recording with its results; the file appears when it is complete.

    Raises:
        UsageError: the recording is not in the database, or would be overwritten.
        StadimeterError: it cannot be read or written.
    """
    if not is_recording(recording):
        raise UsageError("there is no such file", where=Where(recording))
    if target.exists() and target.samefile(recording):
        raise UsageError("the export would overwrite the recording", where=Where(target))
    with Store.open_current(database) as store:
        row = _stored(store, recording, database)
        notes = Notes()
        with whole_file(target, "the export") as part, part.open("wb") as stream:
            export = _Export(McapFile(recording, limits, notes.add), store, row, stream, report)
            export.run()
            if export.file.content_sha256 != row["content_sha256"]:
                raise _not_measured(recording, database)
    return Exported(export.messages, export.frames, export.objects, notes)


def _stored(store: Store, recording: Path, database: Path) -> dict[str, Any]:
    """Return the recording's row by its size, and its name if several are of one size.

    What it holds is checked when it has been read: its hash is then known.
    """
    size = size_of(recording)
    rows = [r for r in list_recordings(store).to_pylist() if r["size_bytes"] == size]
    named = [r for r in rows if r["file_name"] == recording.name]
    if not rows:
        raise _not_measured(recording, database)
    found: dict[str, Any] = (named or rows)[0]
    return found


def _not_measured(recording: Path, database: Path) -> UsageError:
    return UsageError(
        f"the recording is not in {database}, or is another one of the same size",
        where=Where(recording),
        remedy="Measure it first: stadimeter run",
    )


class _Export:
    """One export, and its state while it runs."""

    def __init__(
        self, file: McapFile, store: Store, row: dict[str, Any], stream: Any, report: Report
    ) -> None:
        self.file = file
        self.messages = self.frames = self.objects = 0
        self._report = report
        self._path = Path(row["file_name"])
        self._results = frame_results(store, row["recording_id"])
        cameras = camera_rows(store.read("cameras", row["recording_id"]))
        self._scenes = {camera.camera: CameraScene(camera) for camera in cameras}
        self._writer = Writer(
            stream, chunk_size=CHUNK_BYTES, compression=CompressionType.LZ4, enable_data_crcs=True
        )
        self._schemas: dict[tuple[str, str, bytes], int] = {}
        self._channels: dict[tuple[int, ChannelInfo], int] = {}
        self._own: dict[str, int] = {}

    def run(self) -> None:
        """Copy the original's messages and add ours, by log time."""
        self._writer.start(profile="", library=f"stadimeter {__version__}")
        waiting = next(self._results, None)
        for raw in self.file.messages():
            while waiting is not None and waiting.log_time_ns < raw.log_time_ns:
                self._add(waiting)
                waiting = next(self._results, None)
            self._copy(raw)
        while waiting is not None:
            self._add(waiting)
            waiting = next(self._results, None)
        for record in self.file.metadata:
            self._writer.add_metadata(record.name, dict(record.metadata))
        for attachment in self._attachments():
            self._writer.add_attachment(
                create_time=attachment.create_time,
                log_time=attachment.log_time,
                name=attachment.name,
                media_type=attachment.media_type,
                data=attachment.data,
            )
        self._writer.finish()

    def _copy(self, raw: RawMessage) -> None:
        key = (raw.channel_id, raw.channel)
        channel_id = self._channels.get(key)
        if channel_id is None:
            channel_id = self._channels[key] = self._channel(raw.channel)
        self._writer.add_message(
            channel_id,
            log_time=raw.log_time_ns,
            data=raw.data,
            publish_time=raw.publish_time_ns,
            sequence=raw.sequence,
        )
        self.messages += 1

    def _channel(self, channel: ChannelInfo) -> int:
        schema_id = 0
        if channel.schema_name or channel.schema_encoding or channel.schema_data:
            key = (channel.schema_name, channel.schema_encoding, channel.schema_data)
            if key not in self._schemas:
                self._schemas[key] = self._writer.register_schema(*key)
            schema_id = self._schemas[key]
        number: int = self._writer.register_channel(
            channel.topic, channel.message_encoding, schema_id, dict(channel.metadata)
        )
        return number

    def _add(self, frame: FrameResult) -> None:
        scene = self._scenes.get(frame.camera)
        if scene is None:
            return
        prefix = f"/stadimeter/{frame.camera.strip('/')}"
        ground = scene.ground(frame.capture_time_ns)
        if ground is not None:
            self._write(f"{prefix}/ground", ground, frame)
        self._write(f"{prefix}/boxes", scene.boxes(frame), frame)
        self._write(f"{prefix}/scene", scene.scene(frame), frame)
        self._write(f"{prefix}/estimates", scene.estimates(frame), frame)
        self.frames += 1
        self.objects += len(frame.objects)
        if self.frames % 256 == 0:
            self._report(Progress(self._path.name, "export", self.frames, 0.0))

    def _write(self, topic: str, message: Message, frame: FrameResult) -> None:
        channel_id = self._own.get(topic)
        if channel_id is None:
            channel_id = self._own[topic] = self._writer.register_channel(
                topic, "protobuf", self._own_schema(message), dict([EXPORTED])
            )
        self._writer.add_message(
            channel_id,
            log_time=frame.log_time_ns,
            data=message.SerializeToString(deterministic=True),
            publish_time=frame.log_time_ns,
            sequence=frame.frame_index,
        )

    def _own_schema(self, message: Message) -> int:
        key = (message.DESCRIPTOR.full_name, "protobuf", schema_of(message))
        if key not in self._schemas:
            self._schemas[key] = self._writer.register_schema(*key)
        return self._schemas[key]

    def _attachments(self) -> Iterator[Attachment]:
        """Yield the attachments whose CRC fits, one in memory at a time."""
        with open_bytes(self.file.path) as stream:
            for offset, length in self.file.attachments:
                if length > self.file.limits.record_bytes:
                    raise StadimeterError(
                        f"an attachment of {length:,} bytes is larger than "
                        f"limits.record_bytes, {self.file.limits.record_bytes:,}",
                        where=Where(self.file.path, byte_offset=offset),
                        remedy="Raise the limit in the camera file",
                    )
                stream.seek(offset)
                yield Attachment.read(ReadDataStream(stream))
