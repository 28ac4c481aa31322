"""The video streams of a recording, by camera."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from pipeline.core.errors import UnsupportedChannel
from pipeline.ingest.video.access_units import Times
from pipeline.ingest.video.video_stream import READ_CODECS, Out, VideoStream
from pipeline.mcap_file.reader import McapFile, RawMessage
from pipeline.messages.content import VideoPacket


class OfCamera(NamedTuple):
    """A message of a video stream, without its bytes, and its camera."""

    camera: str
    raw: RawMessage


class Videos:
    """Decodes packets in the order of the file; damage to the file is a gap in every stream."""

    def __init__(self, file: McapFile) -> None:
        self._file = file
        self._streams: dict[str, VideoStream[OfCamera]] = {}
        self._damage_seen = 0

    def decode(
        self, packet: VideoPacket, raw: RawMessage, times: Times, camera: str
    ) -> Iterator[Out[OfCamera]]:
        """Yield the frames that are complete with a packet, each with its own message.

        Raises:
            UnsupportedChannel: no such video is read.
            MissingLibrary: the library for it is not installed.
        """
        if packet.codec not in READ_CODECS:
            raise UnsupportedChannel(
                f"video in {packet.codec!r} is not read (it is one of {', '.join(READ_CODECS)})"
            )
        if self._file.damage_count != self._damage_seen:
            self._damage_seen = self._file.damage_count
            for stream in self._streams.values():
                yield from stream.lose()
        known = self._streams.get(camera)
        if known is None or known.codec != packet.codec:
            if known is not None:
                yield from known.flush()
            known = VideoStream(packet.codec, self._file.limits.image_pixels)
            self._streams[camera] = known
        # What waits for its picture keeps its message, without the bytes.
        item = OfCamera(camera, raw._replace(data=b""))
        yield from known.decode(packet.data, item, times)

    def flush(self) -> Iterator[Out[OfCamera]]:
        """Yield what the decoders still hold back at the end of the file."""
        for stream in self._streams.values():
            yield from stream.flush()
