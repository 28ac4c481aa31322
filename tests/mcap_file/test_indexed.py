"""Messages by the index of a file: those that the walk over all of it finds, and no others."""

from __future__ import annotations

from pathlib import Path

import pytest
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer

from pipeline.mcap_file.indexed import indexed_messages, summary_of

TOPICS = ("/a/image", "/b/image", "/b/exposure")


def written(path: Path, compression: CompressionType, count: int = 60) -> Path:
    with path.open("wb") as stream:
        writer = Writer(stream, chunk_size=500, compression=compression)
        writer.start()
        channels = [writer.register_channel(topic, "json", 0) for topic in TOPICS]
        for i in range(count):
            time_ns = i * 10 - 25 * (i % 7 == 0 and i > 0)  # some come late
            data = bytes([i]) * (40 + i)
            writer.add_message(channels[i % 3], time_ns, data, time_ns)
        writer.finish()
    return path


def found(path: Path, topics: set[str], span_ns: tuple[int, int] | None, limit: int = 1 << 20):
    with path.open("rb") as stream:
        summary = summary_of(stream)
        assert summary is not None
        messages = indexed_messages(stream, summary, topics, span_ns, limit)
        return [(m.topic, m.log_time_ns, bytes(m.data)) for m in messages]


@pytest.mark.parametrize("compression", list(CompressionType))
def test_the_index_leads_to_the_messages_that_the_file_holds(
    tmp_path: Path, compression: CompressionType
) -> None:
    path = written(tmp_path / "a.mcap", compression)
    topics = {"/a/image", "/b/exposure"}
    with path.open("rb") as stream:
        expected = [
            (channel.topic, message.log_time, message.data)
            for _, channel, message in make_reader(stream).iter_messages(topics=list(topics))
        ]
    assert sorted(found(path, topics, None)) == sorted(expected)
    assert len(expected) == 40
    within = {m for m in expected if 200 <= m[1] <= 300}
    some = found(path, topics, (200, 300))
    assert within <= set(some)
    assert len(some) < len(expected)


def test_a_file_that_has_changed_since_gives_what_is_left(tmp_path: Path) -> None:
    path = written(tmp_path / "a.mcap", CompressionType.LZ4)
    with path.open("rb") as stream:
        summary = summary_of(stream)
    assert summary is not None
    bad = summary.chunk_indexes[1]
    data = bytearray(path.read_bytes())
    start = bad.chunk_start_offset + 60
    data[start : start + 200] = bytes(200)
    path.write_bytes(data)
    summary.chunk_indexes[2].chunk_length = 1 << 60
    with path.open("rb") as stream:
        messages = [
            bytes(m.data) for m in indexed_messages(stream, summary, set(TOPICS), None, 1 << 20)
        ]
    assert 0 < len(messages) < 60
    assert found(path, {"/a/image"}, None, limit=10) == []
