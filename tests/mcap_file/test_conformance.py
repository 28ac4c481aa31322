"""Every combination of the format's options is read back whole, with nothing to complain of."""

from __future__ import annotations

import io
from pathlib import Path

import pytest
from mcap.reader import make_reader

from pipeline.core.config import Config
from pipeline.core.diagnostics import Notes
from pipeline.mcap_file.reader import McapFile
from tests.support.conformance import CONTENTS, Content, Features, every_combination, write


def check(data: bytes, content: Content, path: Path, what: object) -> None:
    path.write_bytes(data)
    notes = Notes()
    file = McapFile(path, Config().limits, notes.add)
    found = [(m.channel_id, m.log_time_ns, m.data) for m in file.messages()]
    assert found == list(content.messages), what
    assert not len(notes), (what, list(notes))
    assert [(m.name, m.metadata) for m in file.metadata] == [
        (name, dict(values)) for name, values in content.metadata
    ], what
    assert {i: c.topic for i, c in file.channels.items()} == {
        i: f"/{i}" for i in content.channels
    }, what
    for number, channel in file.channels.items():
        assert channel.schema_name == ("Example" if number == 1 else "")
        assert channel.schema_data == (b"def" if number == 1 else b"")
        assert channel.metadata == (("foo", "bar"),)
    assert file.lost_counts.total() == 0


@pytest.mark.parametrize("name", [*CONTENTS])
def test_every_combination_of_options_is_read_whole(name: str, tmp_path: Path) -> None:
    content, count = CONTENTS[name], 0
    for features in every_combination():
        check(write(content, features), content, tmp_path / "x.mcap", features)
        count += 1
    assert count == 1280


@pytest.mark.parametrize("compression", ["lz4", "zstd"])
def test_compressed_chunks_with_every_option_are_read_whole(
    compression: str, tmp_path: Path
) -> None:
    content = CONTENTS["everything"]
    for features in every_combination():
        if features.chunks and features.crcs:
            data = write(content, features, compression)
            check(data, content, tmp_path / "x.mcap", features)


def test_the_format_s_own_library_reads_what_the_writer_writes() -> None:
    content = CONTENTS["everything"]
    for features in every_combination():
        if features.padding or not (features.repeated_channels and features.repeated_schemas):
            continue
        reader = make_reader(io.BytesIO(write(content, features)), validate_crcs=True)
        found = [
            (channel.id, message.log_time, message.data)
            for _, channel, message in reader.iter_messages(log_time_order=False)
        ]
        if features.chunk_index or not features.chunks:
            assert sorted(found) == sorted(content.messages), features


def test_a_changed_byte_in_any_checked_file_is_noticed(tmp_path: Path) -> None:
    content = CONTENTS["everything"]
    # No CRC covers what a later version may put behind the last fields.
    for features in (Features(*[True] * 10, False), Features(*[False] * 3, *[True] * 7, False)):
        data = write(content, features)
        for at in range(8, len(data)):
            path, notes = tmp_path / "x.mcap", Notes()
            path.write_bytes(data[:at] + bytes([data[at] ^ 0x10]) + data[at + 1 :])
            file = McapFile(path, Config().limits, notes.add)
            found = [(m.channel_id, m.log_time_ns, m.data) for m in file.messages()]
            assert notes.lost_data, (at, features)
            assert len(found) >= len(content.messages) - 5 or not features.chunks
