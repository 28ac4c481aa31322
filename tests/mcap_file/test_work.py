"""Files made to cost much: the work that they cause is bounded, and the bound is told."""

from __future__ import annotations

import resource
import struct
import subprocess
import sys
import time
import zlib
from collections.abc import Callable
from pathlib import Path

import lz4.frame
import pytest
import zstandard
from mcap.opcode import Opcode

from pipeline.core.config import Limits
from pipeline.core.diagnostics import Notes
from pipeline.mcap_file.reader import McapFile
from tests.support.damage import MAGIC, chunk_record, record

SECONDS, MEMORY_MB = 6.0, 700
SIZE = 1 << 26
ZEROS = bytes(SIZE)
MESSAGE = record(Opcode.MESSAGE, struct.pack("<HIQQ", 1, 0, 5, 5))
SCHEMA = record(
    Opcode.SCHEMA, struct.pack("<HI", 1, 1) + b"x" + struct.pack("<I", 4) + b"json" + bytes(4)
)
CHANNEL = record(
    Opcode.CHANNEL,
    struct.pack("<HHI", 1, 1, 2) + b"/t" + struct.pack("<I", 4) + b"json" + bytes(4),
)


def chunk(name: str, packed: bytes, inside: bytes) -> bytes:
    return chunk_record(name, packed, len(inside), zlib.crc32(inside))


def many(made: bytes, count: int) -> bytes:
    """Return chunks that differ in their start time, so that none is a repeated one."""
    return b"".join(made[:9] + struct.pack("<Q", n) + made[17:] for n in range(count))


def _small_lz4_frames() -> bytes:
    count = 28_000
    packed = lz4.frame.compress(b"x", store_size=False) * count
    return chunk("lz4", packed, b"x" * count)


def _tiny_messages() -> bytes:
    inside = SCHEMA + CHANNEL + MESSAGE * 2_000_000
    return many(chunk("zstd", zstandard.compress(inside), inside), 5)


def _zeros_of_another_claim() -> bytes:
    return many(chunk_record("zstd", zstandard.compress(ZEROS), 1000, 77), 80)


def _hidden_chunks() -> bytes:
    body = chunk_record("zstd", zstandard.compress(ZEROS), 1000, 77)[9:]
    return many(record(0x33, body), 80)


def _false_heads() -> bytes:
    inside = (b"\x05\x01" + bytes(11)) * (SIZE // 13)
    return many(chunk("zstd", zstandard.compress(inside), inside), 20)


HOSTILE: dict[str, Callable[[], bytes]] = {
    "hang": lambda: chunk_record("zstd", b"", 1000, 77)[:-19] + bytes(19),
    "small_lz4_frames": _small_lz4_frames,
    "empty_lz4_frames": lambda: chunk_record("lz4", lz4.frame.compress(b"") * 40_000, SIZE, 5),
    "zstd_zeros": lambda: many(chunk("zstd", zstandard.compress(ZEROS), ZEROS), 80),
    "zstd_zeros_of_another_claim": _zeros_of_another_claim,
    "zstd_zeros_broken": lambda: many(
        chunk_record("zstd", zstandard.compress(ZEROS)[:-4] + b"1234", SIZE, 77), 80
    ),
    "hidden_chunks": _hidden_chunks,
    "tiny_messages": _tiny_messages,
    "false_heads": _false_heads,
    "false_heads_outside": lambda: (b"\x05\x40" + bytes(7)) * 110_000,
    "tiny_chunks": lambda: many(chunk_record("", b"", 0), 20_000),
    "empty_records": lambda: record(0x90, b"") * 110_000,
    "unknown_channels": lambda: b"".join(
        record(Opcode.MESSAGE, struct.pack("<HIQQ", n % 60_000, n, n, n)) for n in range(30_000)
    ),
    "zeros_outside": lambda: bytes(20_000_000),
}


def cost(path: Path) -> None:
    """Read a file, and print what it cost: seconds of CPU, and MB more than before."""
    before, started = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, time.process_time()
    notes = Notes()
    file = McapFile(path, Limits(), notes.add)
    for _ in file.messages_by_log_time():
        pass
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before
    print(time.process_time() - started, peak / 1024, *(n.code for n in notes))


@pytest.mark.parametrize("name", [*HOSTILE])
def test_hostile_files_cost_little_time_and_memory(name: str, tmp_path: Path) -> None:
    path = tmp_path / "x.mcap"
    path.write_bytes(MAGIC + HOSTILE[name]())
    command = "import sys, pathlib; from tests.mcap_file.test_work import cost; "
    command += "cost(pathlib.Path(sys.argv[1]))"
    done = subprocess.run(
        [sys.executable, "-c", command, str(path)], capture_output=True, text=True, timeout=120
    )
    assert done.returncode == 0, done.stderr
    seconds, memory_mb, *codes = done.stdout.split()
    assert float(seconds) < SECONDS
    assert float(memory_mb) < MEMORY_MB
    assert codes, "something is told"


def test_the_limit_is_told_and_counts_what_the_summary_knows(tmp_path: Path) -> None:
    path = tmp_path / "x.mcap"
    statistics = struct.pack("<QHIIIIQQ", 500, 1, 1, 0, 0, 0, 0, 9) + struct.pack(
        "<IHQ", 10, 1, 500
    )
    data = MAGIC + SCHEMA + CHANNEL
    data += b"".join(record(Opcode.MESSAGE, struct.pack("<HIQQ", 1, n, n, n)) for n in range(500))
    path.write_bytes(data + record(Opcode.STATISTICS, statistics))
    notes = Notes()
    file = McapFile(path, Limits(records=100, records_per_mb=0), notes.add)
    found = list(file.messages())
    assert 90 < len(found) < 100
    (note,) = [n for n in notes if n.code == "work_limit"]
    assert "limits.records" in note.message
    assert note.byte_offset
    whole = McapFile(path, Limits(), notes.add)
    assert len(list(whole.messages())) == 500


@pytest.mark.parametrize("kind", ["pipe", "folder"])
def test_what_may_have_no_end_is_refused(kind: str, tmp_path: Path) -> None:
    import os

    from pipeline.core.errors import NotARecording

    path = tmp_path / "x.mcap"
    if kind == "pipe":
        os.mkfifo(path)
    else:
        path.mkdir()
    with pytest.raises(NotARecording):
        McapFile(path, Limits(), lambda _: None)


def test_a_file_that_grows_is_read_up_to_where_it_ended(tmp_path: Path) -> None:
    path = tmp_path / "x.mcap"
    messages = [record(Opcode.MESSAGE, struct.pack("<HIQQ", 1, n, n, n)) for n in range(3000)]
    path.write_bytes(MAGIC + SCHEMA + CHANNEL + b"".join(messages))
    size = path.stat().st_size
    file = McapFile(path, Limits(), lambda _: None)
    count = 0
    with path.open("ab") as stream:
        for _ in file.messages():
            count += 1
            stream.write(messages[count % 3000])
            stream.flush()
    assert count == 3000
    assert file.size_bytes == size
