"""A long recording in windows of time, each of which is read alone.

A window begins before its cut, so that when the cut comes the detector has learned the background and
everybody who is there is being followed. What it finds before the cut is found by the window before it
too: that is how tracks are stitched (`stitch`). Only recordings without damage are cut, because where
damage ends is known to who reads on past it.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.reader import SeekingReader
from mcap.records import Channel, Chunk, ChunkIndex, Message
from mcap.stream_reader import breakup_chunk
from mcap.summary import Summary

from pipeline.core.config import Config, Limits
from pipeline.core.diagnostics import Notes
from pipeline.core.errors import DamagedRecording, Where
from pipeline.ingest.logged_behind import order_of
from pipeline.mcap_file.reader import ChannelInfo, McapFile, Note, RawMessage
from pipeline.messages.content import Kind
from pipeline.messages.registry import kind_of

# Windows of a long recording: ten minutes are two of them, and 13 % of a day is read twice (`OVERLAP_S`).
WINDOW_S = 300.0
# Recordings longer than so many windows are cut: each part then has nearly the length that is wished.
CUT_FROM_WINDOWS = 1.5
# A window begins so long before its cut: 15 s in which the detector learns the background
# (`DetectConfig.learning_s`), and two time constants of 10 s in which the background settles
# (`background.FOLLOW_S`); people who were there are seen moving meanwhile.
OVERLAP_S = 40.0
# Messages about a picture come at most so much later (`IngestConfig.reorder_s`, and room).
LOOK_AHEAD_S = 1.0
FRAMING_BYTES = 9  # an MCAP record's opcode and length
# Whatever else there is holds until it is said anew, so that a window needs the last of it.
MOMENTARY = (Kind.IMAGE, Kind.TRUTH)
# Video can be entered at key frames only, transforms add up to the pose, and lists of class names add up
# too: left whole.
UNCUT = (Kind.VIDEO, Kind.TRANSFORMS, Kind.LABELS)


@dataclass(frozen=True, slots=True)
class Window:
    """A part of a recording in log time: it is read from `read_from_ns`, and counts from `from_ns`."""

    number: int
    read_from_ns: int
    from_ns: int
    to_ns: int


@dataclass(frozen=True, slots=True)
class Plan:
    """The windows of a recording."""

    content_sha256: str
    windows: tuple[Window, ...]


def plan_windows(path: Path, config: Config, window_s: float) -> Plan | None:
    """Return the windows of a recording, of about so many seconds each; None: it is left whole.

    Reads all of it once, without decoding a picture: its hash is needed, and that it has no damage.
    """
    windows = windows_by_index(path, config, window_s)
    sha256 = hash_if_undamaged(path, config) if windows else None
    return None if sha256 is None else Plan(sha256, windows)


def windows_by_index(path: Path, config: Config, window_s: float) -> tuple[Window, ...]:
    """Return the windows of a recording by its index alone, which tells nothing of damage.

    Args:
        path: the recording.
        config: how it is worked.
        window_s: the wished length of a window, in seconds; 0 cuts nothing.

    Returns:
        The windows in order of time; none if the recording is short, or cannot be cut.
    """
    if window_s <= 0 or config.ingest.every > 1 or not path.is_file():
        return ()  # a window does not know which pictures are chosen before it
    summary = _summary(path, config.limits)
    if summary is None or summary.statistics is None or not summary.chunk_indexes:
        return ()
    start_ns = min(c.message_start_time for c in summary.chunk_indexes)
    end_ns = max(c.message_end_time for c in summary.chunk_indexes)
    if (end_ns - start_ns) / 1e9 < CUT_FROM_WINDOWS * window_s:
        return ()
    if any(kind_of(_info(c, summary)) in UNCUT for c in summary.channels.values()):
        return ()
    if not _is_in_order(summary, round(config.ingest.reorder_s * 1e9)):
        return ()
    order = order_of(path, config.limits, look_again=False)
    if order.behind or order.as_in_file:
        return ()
    return cut(start_ns, end_ns, window_s)


def hash_if_undamaged(path: Path, config: Config) -> str | None:
    """Return the SHA-256 of a recording, None if any of it is damaged; no picture is decoded."""
    summary = _summary(path, config.limits)
    if summary is None or summary.statistics is None:
        return None
    notes = Notes()
    file = McapFile(path, config.limits, notes.add)
    count = sum(1 for _ in file.messages())
    undamaged = not notes.lost_data and count == summary.statistics.message_count
    return file.content_sha256 if undamaged else None


def _is_in_order(summary: Summary, tolerance_ns: int) -> bool:
    """Return whether no chunk begins earlier than one before it ended, by more than a tolerance."""
    newest_ns = 0
    for chunk in sorted(summary.chunk_indexes, key=lambda c: c.chunk_start_offset):
        if chunk.message_start_time < newest_ns - tolerance_ns:
            return False
        newest_ns = max(newest_ns, chunk.message_end_time)
    return True


def cut(start_ns: int, end_ns: int, window_s: float) -> tuple[Window, ...]:
    """Return windows of about `window_s` over a span of time, its end included.

    All are read for the same time, so that none is waited for: the first, which has nothing to read
    before its cut, counts for longer than the others. A span of less than two overlaps is cut evenly.
    """
    span_ns = end_ns + 1 - start_ns
    count = max(round(span_ns / 1e9 / window_s), 1)
    overlap_ns = round(OVERLAP_S * 1e9)
    saved_ns = overlap_ns if span_ns > 2 * overlap_ns else 0
    first_ns = (span_ns + (count - 1) * saved_ns) // count
    rest_ns = span_ns - first_ns
    edges = [
        start_ns,
        *(start_ns + first_ns + rest_ns * i // max(count - 1, 1) for i in range(count)),
    ]
    return tuple(
        Window(i, max(edges[i] - (overlap_ns if i else 0), start_ns), edges[i], edges[i + 1])
        for i in range(count)
    )


def _summary(path: Path, limits: Limits) -> Summary | None:
    """Return the summary at the end of a file, with its chunks and channels; None if there is none."""
    try:
        with path.open("rb") as stream:
            return SeekingReader(stream, record_size_limit=limits.record_bytes).get_summary()
    except (McapError, OSError, ValueError, struct.error):
        return None  # who reads the data tells what is wrong


class WindowFile(McapFile):
    """The messages of an undamaged file within a window, and the lasting ones before it."""

    def __init__(self, path: Path, limits: Limits, note: Note, window: Window, sha256: str) -> None:
        super().__init__(path, limits, note)
        self._window = window
        self._content_sha256 = sha256
        self._channels: dict[int, ChannelInfo] = {}

    @property
    def channels(self) -> dict[int, ChannelInfo]:
        """The channels of the file, by id."""
        return self._channels

    @property
    def content_sha256(self) -> str:
        """SHA-256 of the whole file, as it was when the file was cut."""
        return self._content_sha256

    def messages(self) -> Iterator[RawMessage]:
        """Yield the last lasting messages before the window, then those in it, in file order.

        Raises:
            DamagedRecording: the file is not what it was when it was cut.
        """
        try:
            yield from self._messages()
        except (McapError, ValueError, struct.error, KeyError) as error:
            raise DamagedRecording(
                f"was changed while it was read: {error}", where=Where(self.path)
            ) from error

    def messages_by_log_time(self, tolerance_ns: int = 0) -> Iterator[RawMessage]:
        """Yield the same: only recordings in order are cut."""
        return self.messages()

    def _messages(self) -> Iterator[RawMessage]:
        summary = _summary(self.path, self.limits)
        if summary is None:
            raise ValueError("it has no summary")
        self._channels = {i: _info(c, summary) for i, c in summary.channels.items()}
        chunks = sorted(summary.chunk_indexes, key=lambda c: c.chunk_start_offset)
        begin_ns = self._window.read_from_ns
        end_ns = self._window.to_ns + round(LOOK_AHEAD_S * 1e9)
        with self.path.open("rb", buffering=1 << 20) as stream:
            yield from self._last_before(stream, chunks, begin_ns)
            for chunk in chunks:
                if chunk.message_start_time < end_ns and chunk.message_end_time >= begin_ns:
                    for message in self._messages_in(stream, chunk):
                        if begin_ns <= message.log_time_ns < end_ns:
                            yield message

    def _last_before(
        self, stream: BinaryIO, chunks: Sequence[ChunkIndex], time_ns: int
    ) -> Iterator[RawMessage]:
        """Yield the newest lasting message of each channel before a time, in order of time."""
        lasting = {i for i, c in self._channels.items() if kind_of(c) not in MOMENTARY}
        newest: dict[int, RawMessage] = {}
        for chunk in sorted(chunks, key=lambda c: c.message_end_time, reverse=True):
            wanted = {
                i
                for i in lasting & set(chunk.message_index_offsets)
                if i not in newest or chunk.message_end_time > newest[i].log_time_ns
            }
            if not wanted or chunk.message_start_time >= time_ns:
                continue
            for message in self._messages_in(stream, chunk):
                known = newest.get(message.channel_id)
                if (
                    message.channel_id in wanted
                    and message.log_time_ns < time_ns
                    and (known is None or message.log_time_ns >= known.log_time_ns)
                ):
                    newest[message.channel_id] = message
        yield from sorted(newest.values(), key=lambda m: m.log_time_ns)

    def _messages_in(self, stream: BinaryIO, index: ChunkIndex) -> Iterator[RawMessage]:
        stream.seek(index.chunk_start_offset + FRAMING_BYTES)
        chunk = Chunk.read(ReadDataStream(stream))
        for record in breakup_chunk(chunk, validate_crc=True):
            if isinstance(record, Message):
                yield RawMessage(
                    record.channel_id,
                    self._channels[record.channel_id],
                    record.log_time,
                    record.data,
                    index.chunk_start_offset,
                    record.publish_time,
                    record.sequence,
                )


def _info(channel: Channel, summary: Summary) -> ChannelInfo:
    return ChannelInfo.of(channel, summary.schemas.get(channel.schema_id))
