"""A recording cut at every byte."""

from __future__ import annotations

from pathlib import Path

import pytest
from mcap.opcode import Opcode

from pipeline.core.config import Config
from pipeline.core.diagnostics import Notes
from pipeline.core.errors import NotARecording
from pipeline.mcap_file.reader import McapFile
from tests.support.damage import MAGIC_BYTES, records
from tests.support.damaged_at_random import BASES, library_keeps, whole_file

STEP = {0: 1, 2: 7, 6: 7}  # by kind of file: every byte of one without compression


@pytest.mark.parametrize("base", [*STEP])
def test_a_cut_at_every_byte_keeps_every_whole_message_before_it(base: int, tmp_path: Path) -> None:
    data, messages = whole_file(base)
    ends = [
        at + 9 + length
        for opcode, at, length in records(data)
        if opcode in (Opcode.CHUNK, Opcode.MESSAGE)
    ]
    counts = {end: len(library_keeps(data[:end])) for end in ends}
    assert counts[ends[-1]] == len(messages), BASES[base]
    path = tmp_path / "x.mcap"
    for cut in range(0, len(data), STEP[base]):
        path.write_bytes(data[:cut])
        notes = Notes()
        file = McapFile(path, Config().limits, notes.add)
        if cut < MAGIC_BYTES:
            with pytest.raises(NotARecording):
                list(file.messages_by_log_time())
            continue
        found = {(m.channel_id, m.log_time_ns, m.data) for m in file.messages_by_log_time()}
        assert found <= messages
        assert len(found) >= max((n for end, n in counts.items() if end <= cut), default=0), cut
        assert notes.lost_data, cut
