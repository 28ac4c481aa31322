"""The channels of one recording: what each needs to be read, decided at its first message."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from typing import NamedTuple

from pipeline.core.config import Limits
from pipeline.mcap_file.reader import ChannelInfo, RawMessage
from pipeline.messages import json_text
from pipeline.messages.content import Decoded, Kind
from pipeline.messages.exposure import camera_exposure, names_exposure
from pipeline.messages.named_numbers import NamedNumber
from pipeline.messages.registry import (
    Decoder,
    Reader,
    decoder_of,
    is_unread,
    may_be_json_exposure,
    normalised,
    reader_of,
)
from pipeline.messages.tree import Tree, UndecodableMessage, text

# What `stadimeter export` marks its own channels with: they are results, not evidence.
EXPORTED = ("written_by", "stadimeter export")

# A message is taken for another one's copy by its stamp, its length and the bytes at both its ends, if it
# was logged within this: pictures of a still scene may be equal where stamps are whole seconds.
_TELLS, _REMEMBERED, _TOGETHER_NS = 256, 64, 10_000_000
_TEXT = "std_msgs/String"  # programs put JSON into it

_Told = tuple[int, int, bytes, bytes]
Tell = Callable[[str, str, RawMessage], None]  # code, sentence, message


class Source(NamedTuple):
    """Readers of a channel: of its messages, and of the numbers that a camera file names."""

    decoder: Decoder | None
    reader: Reader | None
    named: tuple[tuple[NamedNumber, str], ...]

    @property
    def is_image(self) -> bool:
        """Return whether a message that cannot be read is a picture lost."""
        return self.decoder is not None and self.decoder.kind in (Kind.IMAGE, Kind.VIDEO)


UNREAD = Source(None, None, ())


class Channels:
    """Finds the source of each message, once a channel."""

    def __init__(self, limits: Limits, named: Sequence[NamedNumber], tell: Tell) -> None:
        self._limits = limits
        self._named = named
        self._tell = tell
        self._sources: dict[tuple[int, ChannelInfo], Source] = {}

    def source(self, raw: RawMessage) -> Source:
        """Return how a message is read; `tell` hears what cannot be."""
        key = (raw.channel_id, raw.channel)
        found = self._sources.get(key)
        if found is None:
            found = self._sources[key] = self._find(raw)
        return found

    def _find(self, raw: RawMessage) -> Source:
        channel = raw.channel
        if EXPORTED in channel.metadata:
            return UNREAD
        try:
            decoder = decoder_of(channel, self._limits.record_bytes)
            if decoder is None and may_be_json_exposure(channel):
                decoder = _exposure_by_content(raw.data, json_text.read)
            if decoder is None and normalised(channel.schema_name) == _TEXT:
                reader = reader_of(channel, self._limits.record_bytes)
                decoder = _exposure_by_content(raw.data, _inner(reader)) if reader else None
        except UndecodableMessage as error:
            self._tell("unsupported_channel", f"the channel is not read: {error}", raw)
            return UNREAD
        if decoder is None and is_unread(channel):
            self._tell(
                "unsupported_channel",
                f"schema {channel.schema_name!r} in encoding {channel.message_encoding!r} "
                "is not read",
                raw,
            )
        return Source(decoder, *self._numbers(raw))

    def _numbers(
        self, raw: RawMessage
    ) -> tuple[Reader | None, tuple[tuple[NamedNumber, str], ...]]:
        named = tuple((n, raw.channel.topic) for n in self._named if n.topic([raw.channel.topic]))
        if not named:
            return None, ()
        try:
            reader = reader_of(raw.channel, self._limits.record_bytes)
        except UndecodableMessage as error:
            self._tell("unsupported_channel", f"its numbers cannot be read: {error}", raw)
            return None, ()
        if reader is None:
            encoding = raw.channel.message_encoding
            self._tell("unsupported_channel", f"numbers in {encoding!r} are not read", raw)
        return reader, named if reader else ()


def _exposure_by_content(data: bytes, read: Reader) -> Decoder | None:
    """Return the decoder of exposures if a JSON message that nothing declares is one."""
    try:
        tree = read(data)
    except UndecodableMessage:
        return None
    if not names_exposure(tree):
        return None
    return Decoder(Kind.EXPOSURE, read, camera_exposure)


def _inner(reader: Reader) -> Reader:
    """Return the reader of the JSON that the field `data` of a text message holds."""

    def read(data: bytes) -> Tree:
        return json_text.read(text(reader(data), "data").encode("utf-8", "surrogatepass"))

    return read


class Repeats:
    """Messages that came last, by topic: recorders that run twice, and merged files, repeat them.

    Only a message with a stamp can be told from another one that says the same.
    """

    def __init__(self) -> None:
        self._last: dict[str, deque[tuple[int, _Told]]] = {}

    def has(self, message: Decoded, raw: RawMessage) -> bool:
        """Return whether a message was there before; else keep what tells it."""
        if not message.capture_time_ns:
            return False
        ends = bytes(raw.data[:_TELLS]), bytes(raw.data[-_TELLS:])
        told = message.capture_time_ns, len(raw.data), *ends
        last = self._last.setdefault(raw.channel.topic, deque(maxlen=_REMEMBERED))
        if any(t == told and abs(raw.log_time_ns - at) <= _TOGETHER_NS for at, t in last):
            return True
        last.append((raw.log_time_ns, told))
        return False
