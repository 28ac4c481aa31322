"""Content of a chunk: decompressed no further than it claims, checked, and repaired by its CRC."""

from __future__ import annotations

import zlib

import lz4.frame
import zstandard

from pipeline.mcap_file.records import ChunkRecord, Malformed, chunk_readings
from pipeline.mcap_file.work import Work

_BLOCK = 1 << 18
# zstd's own limit for streams, said aloud: a frame may ask for a window of two gigabytes.
_WINDOW = 1 << 27
_ERRORS = (RuntimeError, zstandard.ZstdError, EOFError, MemoryError)


class WrongContent(Malformed):
    """A chunk can be decompressed, but is not what it claims; `data` is what came out."""

    def __init__(self, problem: str, data: bytes | memoryview) -> None:
        super().__init__(problem)
        self.data = data


def unpacked(chunk: ChunkRecord, limit: int) -> bytes | memoryview:
    """Return the records in a chunk.

    Raises:
        Malformed: it claims more than `limit` bytes, cannot be decompressed, or is not what it
            claims (then `WrongContent`).
    """
    size = chunk.uncompressed_size
    if size > limit:
        raise Malformed(f"it claims {size:,} bytes, the limit is {limit:,}")
    try:
        data = _decompressed(chunk, size)
    except _ERRORS as error:
        raise Malformed(str(error) or "it cannot be decompressed") from error
    if len(data) != size:
        more = "more than" if len(data) > size else f"{len(data):,} bytes where"
        raise WrongContent(f"it holds {more} it claims ({size:,})", data)
    if chunk.uncompressed_crc and zlib.crc32(data) != chunk.uncompressed_crc:
        raise WrongContent("its CRC does not fit its content", data)
    return data


def by_its_crc(body: bytes | memoryview, limit: int, work: Work) -> bytes | memoryview | None:
    """Return the records in a chunk whose size or compression is wrong, if its CRC proves them.

    Args:
        body: the fields of the chunk's record.
        limit: bytes that it may unpack to.
        work: counts what is unpacked to see.

    Raises:
        Exhausted: the file has caused more work than it may.
    """
    for chunk in chunk_readings(body):
        blocks, whole = _blocks(chunk, limit + 1)
        if chunk.compression:
            work.unpack(sum(map(len, blocks)))
        data = blocks[0] if len(blocks) == 1 else b"".join(blocks)
        if whole and 0 < len(data) <= limit and zlib.crc32(data) == chunk.uncompressed_crc:
            return data
    return None


def unpacked_as_far_as_possible(chunk: ChunkRecord, limit: int) -> bytes | memoryview:
    """Return the beginning of what is in a chunk that is damaged, or whose end is missing."""
    size = min(chunk.uncompressed_size, limit)
    blocks, _ = _blocks(chunk, size)
    return blocks[0][:size] if len(blocks) == 1 else b"".join(blocks)[:size]


def _blocks(chunk: ChunkRecord, size: int) -> tuple[list[bytes | memoryview], bool]:
    """Return what comes out, up to `size` bytes, and whether that was without an error."""
    blocks: list[bytes | memoryview] = []
    try:
        if chunk.compression == "":
            blocks.append(chunk.data)
        elif chunk.compression == "zstd":
            _zstd_blocks(chunk.data, size, blocks)
        elif chunk.compression == "lz4":
            _lz4_blocks(chunk.data, size, blocks)
    except _ERRORS:
        return blocks, False  # what came out before is good
    return blocks, True


def _decompressed(chunk: ChunkRecord, size: int) -> bytes | memoryview:
    """Return what comes out, but no more than `size` bytes and one."""
    if chunk.compression == "":
        return chunk.data
    if chunk.compression == "lz4":
        return _lz4(chunk.data, size)
    if chunk.compression == "zstd":
        return _zstd(chunk.data, size)
    raise Malformed(f"compression {chunk.compression!r} is not known")


def _lz4(data: memoryview, size: int) -> bytes:
    context = lz4.frame.create_decompression_context()
    block, used, ended = lz4.frame.decompress_chunk(context, data, max_length=size + 1)
    if not ended or used == len(data):
        return bytes(block)
    blocks: list[bytes | memoryview] = []  # several frames, one after the other
    _lz4_blocks(data, size + 1, blocks)
    return b"".join(blocks)


def _lz4_blocks(data: memoryview, size: int, blocks: list[bytes | memoryview]) -> None:
    """Append what comes out of the frames, up to `size` bytes, to `blocks`."""
    at, total, context = 0, 0, lz4.frame.create_decompression_context()
    while total < size:
        block, used, ended = lz4.frame.decompress_chunk(
            context, data[at:], max_length=min(_BLOCK, size - total)
        )
        at += used
        if block:
            blocks.append(block)
            total += len(block)
        if ended and at < len(data):
            context = lz4.frame.create_decompression_context()
        elif ended or not (used or block):
            return


def _zstd(data: memoryview, size: int) -> bytes:
    if zstandard.frame_content_size(data) == size:
        return zstandard.ZstdDecompressor().decompress(data, allow_extra_data=False)
    # The frame does not say how much it holds, or there are several: by blocks, up to the claim.
    blocks: list[bytes | memoryview] = []
    _zstd_blocks(data, size + 1, blocks)
    return b"".join(blocks)


def _zstd_blocks(data: memoryview, size: int, blocks: list[bytes | memoryview]) -> None:
    """Append what comes out of the frames, up to `size` bytes, to `blocks`.

    `read`, not `read1`: the latter never returns where there is no more to be had.
    """
    stream = zstandard.ZstdDecompressor(max_window_size=_WINDOW).stream_reader(
        data, read_across_frames=True
    )
    total = 0
    while total < size and (block := stream.read(min(_BLOCK, size - total))):
        blocks.append(block)
        total += len(block)
