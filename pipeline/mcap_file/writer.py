"""Writing recordings in the schemas that stadimeter reads."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from types import TracebackType

from foxglove_schemas_protobuf.CameraCalibration_pb2 import CameraCalibration
from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from google.protobuf.descriptor import FileDescriptor
from google.protobuf.descriptor_pb2 import FileDescriptorSet
from google.protobuf.message import Message
from google.protobuf.timestamp_pb2 import Timestamp
from mcap.writer import CompressionType, Writer

from pipeline.core.files import refuse_special
from pipeline.core.records import Intrinsics

CHUNK_BYTES = 1 << 20  # JPEG does not compress further; a chunk is what one damage costs


def timestamp(time_ns: int) -> Timestamp:
    """Return a protobuf timestamp."""
    return Timestamp(seconds=time_ns // 1_000_000_000, nanos=time_ns % 1_000_000_000)


def part_of(path: Path) -> Path:
    """Return the name of a recording as long as it is not complete."""
    return path.with_name(path.name + ".part")


class RecordingWriter:
    """Writes protobuf messages to an MCAP, each type's schema once, each topic's channel once.

    The file appears under its name when it is complete: until then it is `NAME.part`.
    """

    def __init__(self, path: Path, *, library: str = "stadimeter") -> None:
        self.path = path
        refuse_special(path, "the recording")
        self._part = part_of(path)
        path.parent.mkdir(parents=True, exist_ok=True)
        self._stream = self._part.open("wb")
        self._writer = Writer(
            self._stream,
            chunk_size=CHUNK_BYTES,
            compression=CompressionType.NONE,
            enable_data_crcs=True,
        )
        self._writer.start(profile="", library=library)
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, int] = {}
        self._sequence: dict[str, int] = {}

    def __enter__(self) -> RecordingWriter:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        try:
            if error is None:
                self._writer.finish()
            self._stream.close()
            if error is None:
                self._part.replace(self.path)
        finally:  # nothing of it stays if it could not be finished
            with suppress(OSError):
                self._stream.close()
            with suppress(OSError):
                self._part.unlink(missing_ok=True)

    def write(self, topic: str, message: Message, log_time_ns: int) -> None:
        """Append a message; the first of a topic decides the topic's schema."""
        channel_id = self._channels.get(topic)
        if channel_id is None:
            channel_id = self._add_channel(topic, message)
        sequence = self._sequence[topic]
        self._sequence[topic] = sequence + 1
        self._writer.add_message(
            channel_id,
            log_time=log_time_ns,
            data=message.SerializeToString(deterministic=True),
            publish_time=log_time_ns,
            sequence=sequence,
        )

    def add_metadata(self, name: str, values: Mapping[str, str]) -> None:
        """Add a metadata record, such as where the recording comes from."""
        self._writer.add_metadata(name, dict(values))

    def add_attachment(self, name: str, media_type: str, data: bytes, time_ns: int) -> None:
        """Add an attachment."""
        self._writer.add_attachment(
            create_time=time_ns, log_time=time_ns, name=name, media_type=media_type, data=data
        )

    def _add_channel(self, topic: str, message: Message) -> int:
        descriptor = message.DESCRIPTOR
        schema_id = self._schemas.get(descriptor.full_name)
        if schema_id is None:
            schema_id = self._writer.register_schema(
                name=descriptor.full_name, encoding="protobuf", data=schema_of(message)
            )
            self._schemas[descriptor.full_name] = schema_id
        channel_id: int = self._writer.register_channel(
            topic=topic, message_encoding="protobuf", schema_id=schema_id
        )
        self._channels[topic] = channel_id
        self._sequence[topic] = 0
        return channel_id


def schema_of(message: Message) -> bytes:
    """Return the descriptors of a message's type and of all that it uses."""
    files = FileDescriptorSet()
    for file in _with_dependencies(message.DESCRIPTOR.file):  # type: ignore[arg-type]
        file.CopyToProto(files.file.add())
    return files.SerializeToString(deterministic=True)


def _with_dependencies(
    file: FileDescriptor, seen: set[str] | None = None
) -> Iterator[FileDescriptor]:
    seen = set() if seen is None else seen
    for dependency in file.dependencies:
        if dependency.name not in seen:
            yield from _with_dependencies(dependency, seen)
    if file.name not in seen:
        seen.add(file.name)
        yield file


def image_message(data: bytes, image_format: str, time_ns: int, frame_id: str) -> CompressedImage:
    """Return a foxglove.CompressedImage."""
    return CompressedImage(
        timestamp=timestamp(time_ns), frame_id=frame_id, data=data, format=image_format
    )


def calibration_message(intrinsics: Intrinsics, time_ns: int, frame_id: str) -> CameraCalibration:
    """Return a foxglove.CameraCalibration."""
    fx, fy, cx, cy = intrinsics.fx_px, intrinsics.fy_px, intrinsics.cx_px, intrinsics.cy_px
    return CameraCalibration(
        timestamp=timestamp(time_ns),
        frame_id=frame_id,
        width=intrinsics.width_px,
        height=intrinsics.height_px,
        distortion_model=intrinsics.distortion_model,
        D=intrinsics.distortion,
        K=[fx, 0, cx, 0, fy, cy, 0, 0, 1],
        R=[1, 0, 0, 0, 1, 0, 0, 0, 1],
        P=[fx, 0, cx, 0, 0, fy, cy, 0, 0, 0, 1, 0],
    )
