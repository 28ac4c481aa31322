"""Fuzz targets. Each takes bytes; an exception that it lets pass is a bug."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from pathlib import Path

from pipeline.core.config import Config, Limits, load_config
from pipeline.core.diagnostics import Notes, diagnostics_table
from pipeline.core.errors import StadimeterError
from pipeline.images.decode import decode
from pipeline.images.exif import exif_block, exposure_of, read_tags
from pipeline.images.header import hidden_cost, image_size
from pipeline.ingest.frames import FrameAssembler
from pipeline.ingest.plausibility import refuse_implausible
from pipeline.mcap_file.reader import ChannelInfo, McapFile
from pipeline.messages.registry import FAMILIES, decoder_of
from pipeline.messages.tree import UndecodableMessage

ENCODINGS = ("protobuf", "json", "cdr", "ros1")
SCHEMA_ENCODINGS = ("protobuf", "jsonschema", "ros2msg", "ros1msg")
# Small pictures: the decoders themselves are OpenCV's, and are fuzzed by others.
MAX_PIXELS = 1_000_000


@cache
def _folder() -> Path:
    """Return a folder in memory, where there is one."""
    memory = Path("/dev/shm")  # noqa: S108
    return Path(tempfile.mkdtemp(prefix="fuzz-", dir=memory if memory.is_dir() else None))


def _file(data: bytes, name: str) -> Path:
    path = _folder() / f"{os.getpid()}-{name}"
    path.write_bytes(data)
    return path


def reader(data: bytes) -> None:
    """A whole recording: framing, chunks, channels, messages, frames, and the rows of its losses."""
    config, notes = Config(), Notes()
    file = McapFile(_file(data, "x.mcap"), config.limits, notes.add)
    assembler = FrameAssembler(file, config.ingest, notes)
    try:
        for _ in assembler:
            pass
    except StadimeterError:
        return
    assert assembler.frames_lost >= 0  # noqa: S101
    diagnostics_table(list(notes))


def message(data: bytes) -> None:
    """One message: the first bytes choose its type, its encoding and how long its schema is."""
    if len(data) < 4:
        return
    names = [*FAMILIES, "unknown/Thing"]
    name, encoding = names[data[0] % len(names)], data[1] % len(ENCODINGS)
    length = int.from_bytes(data[2:4], "little")
    schema, body = data[4 : 4 + length], data[4 + length :]
    channel = ChannelInfo("/t", ENCODINGS[encoding], name, SCHEMA_ENCODINGS[encoding], schema)
    with suppress(UndecodableMessage, StadimeterError):
        decoder = decoder_of(channel, Limits().record_bytes)
        if decoder is not None:
            refuse_implausible(decoder(body))


def picture(data: bytes) -> None:
    """The header of a picture, its EXIF, and the decoder behind the bounds."""
    size = image_size(data)
    hidden_cost(data, 100)
    block = exif_block(data)
    if block is not None:
        exposure_of(read_tags(block), *(size or (0, 0)))
    with suppress(StadimeterError):
        decode(data, max_pixels=MAX_PIXELS)


def config(data: bytes) -> None:
    """A camera file."""
    with suppress(StadimeterError):
        load_config(_file(data, "camera.toml"))


TARGETS: dict[str, Callable[[bytes], None]] = {
    "reader": reader,
    "message": message,
    "picture": picture,
    "config": config,
}
