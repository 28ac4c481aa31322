"""Attachments are checked block by block, and not kept: they may be of any size."""

from __future__ import annotations

import zlib

from mcap.opcode import Opcode

from pipeline.mcap_file.forward_file import ForwardFile
from pipeline.mcap_file.records import FRAMING, Fields, Malformed, content_length

_BLOCK = 1 << 20
_TIMES_BYTES = 16  # log time and create time, before the name


def checked_attachment(
    source: ForwardFile, offset: int, length: int, name_bytes: int
) -> tuple[int, int]:
    """Read an attachment whose record starts at `offset`; return where it stands, and its length.

    Raises:
        Malformed: its fields do not fit it, or its CRC does not fit its content.
    """
    start = source.position
    stated = content_length(Opcode.ATTACHMENT, offset, source.peek)
    if stated is None or stated > length:
        source.skip_to(start + length)
        raise Malformed("the fields of an attachment do not fit its length")
    crc, crc_at = 0, start + stated - 4
    while source.position < crc_at:
        crc = zlib.crc32(source.read(min(crc_at - source.position, _BLOCK)), crc)
    expected = int.from_bytes(source.read(4), "little")
    source.skip_to(start + length)
    if expected and expected != crc:
        name = _name(source, offset, name_bytes)
        raise Malformed(f"the CRC of the attachment {name!r} does not fit; no frame comes from it")
    return start, stated


def _name(source: ForwardFile, offset: int, name_bytes: int) -> str:
    fields = Fields(source.peek(offset + FRAMING.size, _TIMES_BYTES + 4 + name_bytes))
    try:
        fields.take(_TIMES_BYTES)
        return fields.text(name_bytes)
    except Malformed:
        return "?"
