"""Content of a chunk: decompressed no further than it claims, and checked."""

from __future__ import annotations

import zlib

import lz4.frame
import zstandard

from pipeline.mcap_file.records import ChunkRecord, Malformed

_BLOCK = 1 << 20
# zstd's own limit for streams, said aloud: a frame may ask for a window of two gigabytes.
_WINDOW = 1 << 27


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
    except (RuntimeError, zstandard.ZstdError, EOFError) as error:
        raise Malformed(str(error) or "it cannot be decompressed") from error
    if len(data) != size:
        more = "more than" if len(data) > size else f"{len(data):,} bytes where"
        raise WrongContent(f"it holds {more} it claims ({size:,})", data)
    if chunk.uncompressed_crc and zlib.crc32(data) != chunk.uncompressed_crc:
        raise WrongContent("its CRC does not fit its content", data)
    return data


def unpacked_as_far_as_possible(chunk: ChunkRecord, limit: int) -> bytes | memoryview:
    """Return the beginning of what is in a chunk whose end is missing."""
    size = min(chunk.uncompressed_size, limit)
    if chunk.compression == "":
        return chunk.data[:size]
    blocks, total = [], 0
    try:
        if chunk.compression == "zstd":
            stream = zstandard.ZstdDecompressor(max_window_size=_WINDOW).stream_reader(chunk.data)
            while total < size and (block := stream.read1(min(_BLOCK, size - total))):
                blocks.append(block)
                total += len(block)
        elif chunk.compression == "lz4":
            decompressor = lz4.frame.LZ4FrameDecompressor()
            block = decompressor.decompress(bytes(chunk.data), max_length=_BLOCK)
            while block and total < size:
                blocks.append(block)
                total += len(block)
                block = b"" if decompressor.eof else decompressor.decompress(b"", max_length=_BLOCK)
    except (RuntimeError, zstandard.ZstdError, EOFError):
        pass  # what came out before is good
    return b"".join(blocks)[:size]


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
    """Decompress one frame after the other, up to `size` bytes and one."""
    out, ended = b"", True
    while ended and len(data) and len(out) <= size:
        context = lz4.frame.create_decompression_context()
        block, used, ended = lz4.frame.decompress_chunk(
            context, data, max_length=size + 1 - len(out)
        )
        out = out + block if out else block
        data = data[used:]
    return out


def _zstd(data: memoryview, size: int) -> bytes:
    if zstandard.frame_content_size(data) == size:
        return zstandard.ZstdDecompressor().decompress(data, allow_extra_data=False)
    # The frame does not say how much it holds, or there are several: by blocks, up to the claim.
    stream = zstandard.ZstdDecompressor(max_window_size=_WINDOW).stream_reader(
        data, read_across_frames=True
    )
    blocks, total = [], 0
    while total <= size and (block := stream.read(min(_BLOCK, size + 1 - total))):
        blocks.append(block)
        total += len(block)
    return b"".join(blocks)
