"""Messages by log time: all of them once, in order, from files in any order, with little memory."""

from __future__ import annotations

import random
from collections.abc import Sequence
from pathlib import Path

import pytest
from mcap.writer import CompressionType, Writer

from pipeline.core.config import Config, Limits
from pipeline.core.diagnostics import Notes
from pipeline.mcap_file.reader import McapFile
from tests.support.damaged_at_random import BASES, damaged_files, whole_file

Message = tuple[int, int, bytes]  # channel, log time, data


def write(
    path: Path, messages: Sequence[Message], *, chunk_size: int, chunked: bool = True
) -> None:
    with path.open("wb") as stream:
        writer = Writer(
            stream,
            chunk_size=chunk_size,
            compression=CompressionType.LZ4,
            use_chunking=chunked,
            enable_data_crcs=True,
        )
        writer.start()
        for n in range(3):
            writer.register_channel(f"/{n}", "json", 0)
        for number, (channel, time_ns, data) in enumerate(messages):
            writer.add_message(channel, time_ns, data, time_ns, sequence=number)
        writer.finish()


def read(
    path: Path, limits: Limits | None = None, tolerance_ns: int = 0
) -> tuple[list[Message], Notes]:
    notes = Notes()
    file = McapFile(path, limits or Config().limits, notes.add)
    found = [(m.channel_id, m.log_time_ns, m.data) for m in file.messages_by_log_time(tolerance_ns)]
    assert file.content_sha256
    assert file.message_counts.total() == len(found)
    return found, notes


def shuffled(kind: str) -> list[Message]:
    chance = random.Random(0)  # noqa: S311
    pictures = [(1, 1000 + 10 * i, chance.randbytes(80)) for i in range(200)]
    boxes = [(2, 1003 + 10 * i, chance.randbytes(30)) for i in range(200)]
    third = [(3, 1005 + 10 * i, chance.randbytes(30)) for i in range(200)]
    if kind == "appended":
        return pictures + boxes
    if kind == "before":
        return boxes + pictures
    if kind == "three_after_another":
        return pictures + boxes + third
    if kind == "backwards":
        return pictures[::-1]
    if kind == "in_blocks":
        return [m for i in range(0, 200, 50) for m in pictures[i : i + 50] + boxes[i : i + 50]]
    messages = pictures + boxes + third
    chance.shuffle(messages)
    return messages


@pytest.mark.parametrize("chunk_size", [500, 4_000, 1_000_000])
@pytest.mark.parametrize("chunked", [True, False])
@pytest.mark.parametrize(
    "kind", ["appended", "before", "three_after_another", "backwards", "in_blocks", "shuffled"]
)
def test_messages_come_in_the_order_of_their_log_times(
    kind: str, chunked: bool, chunk_size: int, tmp_path: Path
) -> None:
    messages = shuffled(kind)
    path = tmp_path / "x.mcap"
    write(path, messages, chunk_size=chunk_size, chunked=chunked)
    found, notes = read(path)
    assert [m[1] for m in found] == sorted(m[1] for m in messages)
    assert sorted(found) == sorted(messages)
    assert not len(notes), list(notes)


def test_what_is_late_by_less_than_the_tolerance_stays_where_it_is(tmp_path: Path) -> None:
    messages = [(1, 1000, b"a"), (1, 990, b"b"), (1, 500, b"c"), (1, 1010, b"d")]
    path = tmp_path / "x.mcap"
    write(path, messages, chunk_size=1, chunked=False)
    found, _ = read(path, tolerance_ns=100)
    assert [data for _, _, data in found] == [b"c", b"a", b"b", b"d"]


def test_more_than_may_be_held_is_told_and_kept(tmp_path: Path) -> None:
    messages = shuffled("shuffled")
    path = tmp_path / "x.mcap"
    write(path, messages, chunk_size=500)
    found, notes = read(path, Limits(waiting_bytes=2000))
    assert sorted(found) == sorted(messages)
    assert {n.code for n in notes} == {"out_of_order"}


def test_one_time_that_cannot_be_does_not_make_all_others_late(tmp_path: Path) -> None:
    messages = [(1, 1000, b"a"), (1, 2**64 - 1, b"b"), (1, 1010, b"c")]
    path = tmp_path / "x.mcap"
    write(path, messages, chunk_size=1, chunked=False)
    found, _ = read(path)
    assert found == messages


def test_damaged_files_give_the_same_messages_in_either_order(tmp_path: Path) -> None:
    path = tmp_path / "x.mcap"
    for damaged in damaged_files(160, seed=3):
        path.write_bytes(damaged.data)
        file = McapFile(path, Config().limits, lambda _: None)
        expected = {(m.channel_id, m.log_time_ns, m.data) for m in file.messages()}
        found, _ = read(path)
        assert len(found) == len(set(found)), damaged.name
        assert expected & damaged.messages <= set(found), damaged.name


@pytest.mark.parametrize("base", range(len(BASES)))
def test_a_file_in_order_is_read_as_it_stands(base: int, tmp_path: Path) -> None:
    data, messages = whole_file(base)
    path = tmp_path / "x.mcap"
    path.write_bytes(data)
    found, notes = read(path)
    assert frozenset(found) == messages
    assert not len(notes)
