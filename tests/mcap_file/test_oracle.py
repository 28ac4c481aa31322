"""Damage at random: nothing is lost that the `mcap` library keeps, nor of a chunk that is whole."""

from __future__ import annotations

from pathlib import Path

import pytest

from pipeline.core.config import Config
from pipeline.core.diagnostics import Notes
from pipeline.mcap_file.reader import McapFile
from tests.support.damaged_at_random import BASES, damaged_files, library_keeps, whole_file


def kept(data: bytes, path: Path) -> tuple[list[tuple[int, int, bytes]], Notes]:
    path.write_bytes(data)
    notes = Notes()
    file = McapFile(path, Config().limits, notes.add)
    found = [(m.channel_id % 65_536, m.log_time_ns, m.data) for m in file.messages()]
    return found, notes


def lost_of(count: int, seed: int, path: Path) -> list[str]:
    failures = []
    for damaged in damaged_files(count, seed):
        found, notes = kept(damaged.data, path)
        ours = set(found) & damaged.messages
        library = library_keeps(damaged.data) & damaged.messages
        if ours != damaged.messages and damaged.checked:
            assert notes.lost_data, damaged.name
        if not library | damaged.intact <= ours:
            missing = len((library | damaged.intact) - ours)
            failures.append(f"{damaged.name}: {missing} missing, {[n.code for n in notes]}")
        assert len(found) == len(set(found)), f"{damaged.name}: the same message twice"
    return failures


@pytest.mark.parametrize("base", range(len(BASES)))
def test_a_whole_file_is_read_whole(base: int, tmp_path: Path) -> None:
    data, messages = whole_file(base)
    found, notes = kept(data, tmp_path / "x.mcap")
    assert set(found) == messages
    assert not len(notes)


def test_nothing_is_lost_that_another_reader_keeps_or_a_crc_proves(tmp_path: Path) -> None:
    assert not lost_of(400, 0, tmp_path / "x.mcap")


@pytest.mark.slow
def test_nothing_is_lost_of_thousands_of_damaged_files(tmp_path: Path) -> None:
    assert not lost_of(4000, 1, tmp_path / "x.mcap")
