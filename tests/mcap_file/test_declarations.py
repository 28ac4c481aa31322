"""Channels and schemas whose own records are damaged, missing, repeated or contradicted."""

from __future__ import annotations

import struct
from pathlib import Path

from mcap.opcode import Opcode

from pipeline.core.config import Config
from pipeline.core.diagnostics import Notes
from pipeline.ingest.frames import FrameAssembler
from pipeline.mcap_file.reader import McapFile
from pipeline.mcap_file.writer import image_message
from tests.support.damage import MAGIC, START_NS, chunk_record, record

JPEG = b"\xff\xd8\xff\xe0" + bytes(200)
COUNT = 20


def text(value: str) -> bytes:
    return struct.pack("<I", len(value)) + value.encode()


def schema(number: int, name: str) -> bytes:
    return record(
        Opcode.SCHEMA, struct.pack("<H", number) + text(name) + text("protobuf") + bytes(4)
    )


def channel(number: int, schema_id: int, topic: str) -> bytes:
    body = struct.pack("<HH", number, schema_id) + text(topic) + text("protobuf") + bytes(4)
    return record(Opcode.CHANNEL, body)


def pictures(first: int, count: int, number: int = 1, between: bytes = b"") -> bytes:
    made = b""
    for index in range(first, first + count):
        time_ns = START_NS + index * 100_000_000
        data = image_message(JPEG + bytes([index]), "jpeg", time_ns, "cam").SerializeToString()
        head = struct.pack("<HIQQ", number, index, time_ns, time_ns)
        made += record(Opcode.MESSAGE, head + data) + between
    return made


IMAGE = schema(1, "foxglove.CompressedImage")
DECLARED = IMAGE + channel(1, 1, "/i")


def read(data: bytes, tmp_path: Path) -> tuple[int, int, set[str]]:
    path = tmp_path / "x.mcap"
    path.write_bytes(MAGIC + data)
    notes = Notes()
    assembler = FrameAssembler(McapFile(path, Config().limits, notes.add), Config().ingest, notes)
    frames = len(list(assembler))
    return frames, assembler.frames_lost, {n.code for n in notes}


def test_a_declaration_that_comes_after_the_messages_is_used(tmp_path: Path) -> None:
    assert read(pictures(0, COUNT) + DECLARED, tmp_path)[:2] == (COUNT, 0)
    late = chunk_record("", DECLARED, len(DECLARED))
    assert read(pictures(0, COUNT) + late, tmp_path)[:2] == (COUNT, 0)


def test_a_declaration_in_a_damaged_chunk_is_better_than_none_and_told(tmp_path: Path) -> None:
    inside = DECLARED + pictures(0, 2)
    damaged = chunk_record("", inside, len(inside), crc=1)
    frames, lost, codes = read(damaged + pictures(2, COUNT), tmp_path)
    assert (frames, lost) == (COUNT, 2)
    assert codes >= {"unproven_declaration", "damaged_chunk"}


def test_pictures_of_a_channel_that_nothing_declares_count_as_lost(tmp_path: Path) -> None:
    frames, lost, codes = read(pictures(0, COUNT), tmp_path)
    assert (frames, lost) == (0, COUNT)
    assert "unknown_channel" in codes


def test_pictures_without_their_schema_count_as_lost(tmp_path: Path) -> None:
    frames, lost, codes = read(channel(1, 1, "/i") + pictures(0, COUNT), tmp_path)
    assert (frames, lost) == (0, COUNT)
    assert "missing_schema" in codes


def test_a_schema_that_comes_later_is_used(tmp_path: Path) -> None:
    assert read(channel(1, 1, "/i") + pictures(0, COUNT) + IMAGE, tmp_path)[:2] == (COUNT, 0)


def test_pictures_of_an_id_that_was_declared_anew_count_as_lost(tmp_path: Path) -> None:
    other = schema(2, "x.Unknown") + channel(1, 2, "/other")
    frames, lost, codes = read(DECLARED + pictures(0, 8) + other + pictures(8, 12), tmp_path)
    assert (frames, lost) == (8, 12)
    assert "redefined_channel" in codes


def test_private_records_in_a_chunk_do_not_end_it(tmp_path: Path) -> None:
    inside = DECLARED + pictures(0, COUNT, between=record(0x91, b"private"))
    assert read(chunk_record("", inside, len(inside)), tmp_path)[:2] == (COUNT, 0)
    damaged = inside[:-40] + bytes(40)  # its last records are gone: the others are counted
    frames, lost, _ = read(DECLARED + chunk_record("", damaged, len(inside), crc=1), tmp_path)
    assert frames == 0
    assert COUNT - 1 <= lost <= COUNT
