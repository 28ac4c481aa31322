"""A file read forward, every byte hashed once, with a look at any other place."""

from __future__ import annotations

import hashlib
import stat
import zlib
from pathlib import Path
from types import TracebackType

from pipeline.core.errors import NotARecording, Where
from pipeline.mcap_file.bag import open_bytes, size_of

# Small records are cut out of blocks; what is larger than a block is read straight.
_BLOCK = 1 << 16


def regular_size(path: Path) -> int:
    """Return the size of a regular file, or of the files of a bag, in bytes.

    Raises:
        NotARecording: it is a folder that is no bag, a pipe or a device, which may have no end.
        OSError: there is no such file.
    """
    status = path.stat()
    if stat.S_ISREG(status.st_mode):
        return status.st_size
    if stat.S_ISDIR(status.st_mode):
        return size_of(path)
    raise NotARecording(
        "a pipe or a device is not read, as it may have no end",
        where=Where(path),
        remedy="Copy its bytes to a file first",
    )


class ForwardFile:
    """Reads on from `position`; what is passed over is hashed too.

    The file ends where it ended when it was opened: one that grows is read up to there.
    """

    def __init__(self, path: Path) -> None:
        """Open a file.

        Raises:
            NotARecording: it is no regular file.
            OSError: it cannot be opened.
        """
        self.size = regular_size(path)
        self._stream = open_bytes(path, buffered=False)
        self._aside = open_bytes(path)
        self.is_joined = path.is_dir()  # the files of a bag
        self._sha256 = hashlib.sha256()
        self._hashed = 0  # bytes of the file that are in the hash
        self._block = b""
        self._large = bytearray()
        self._block_start = 0
        self._at = 0  # in the block
        self._crc = 0  # of what was read since `restart_crc` and before the block

    def __enter__(self) -> ForwardFile:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._stream.close()
        self._aside.close()

    @property
    def position(self) -> int:
        """Offset at which the next read starts."""
        return self._block_start + self._at

    @property
    def sha256(self) -> str:
        """Hash of all that was read so far."""
        return self._sha256.hexdigest()

    @property
    def crc(self) -> int:
        """CRC-32 of what was read since `restart_crc`."""
        return zlib.crc32(memoryview(self._block)[: self._at], self._crc)

    def restart_crc(self) -> None:
        """Let the CRC begin at the position."""
        self._drop_read()
        self._crc = 0

    def read(self, count: int) -> bytes | memoryview:
        """Return the next bytes, valid until the next read; fewer only at the end of the file."""
        if count >= _BLOCK:
            return self._read_large(count)
        if self._at + count > len(self._block):
            self._fill(count)
        data = self._block[self._at : self._at + count]
        self._at += len(data)
        return data

    def _read_large(self, count: int) -> memoryview:
        """Read into the one large buffer, which is used again: fresh memory costs more than bytes."""
        count = min(count, self.size - self.position)
        if count > len(self._large):
            self._large = bytearray(count)
        view = memoryview(self._large)[:count]
        start, filled = self.position, min(len(self._block) - self._at, count)
        view[:filled] = self._block[self._at : self._at + filled]
        self._at += filled
        if filled < count:
            self._drop_read()
            got = self._read_into(view[filled:], start + filled)
            self._crc = zlib.crc32(view[filled : filled + got], self._crc)
            self._block_start += got
            filled += got
        return view[:filled]

    def skip_to(self, offset: int) -> None:
        """Move to an offset, forward or back."""
        if offset < self.position:
            self._go_back(offset)
        while self.position < offset and self.read(min(offset - self.position, _BLOCK)):
            pass

    def peek(self, offset: int, count: int) -> bytes:
        """Return bytes from anywhere; the position stays."""
        self._aside.seek(offset)
        return self._aside.read(max(min(count, self.size - offset), 0))

    def peek_next(self) -> int:
        """Return the next byte, or -1 at the end of the file."""
        if self._at >= len(self._block):
            self._fill(1)
        return self._block[self._at] if self._at < len(self._block) else -1

    def _fill(self, count: int) -> None:
        """Have at least `count` bytes in the block, if the file has them."""
        self._drop_read()
        fresh = bytearray(_BLOCK)
        got = self._read_into(memoryview(fresh), self._block_start + len(self._block))
        self._block += bytes(memoryview(fresh)[:got])

    def _drop_read(self) -> None:
        self._crc = self.crc
        self._block_start += self._at
        self._block, self._at = self._block[self._at :], 0

    def _read_into(self, view: memoryview, offset: int) -> int:
        """Fill a view from the file, and hash what is new; return how much there was."""
        filled, view = 0, view[: max(self.size - offset, 0)]
        while filled < len(view) and (got := self._stream.readinto(view[filled:])):
            filled += got
        end = offset + filled
        if end > self._hashed:
            self._sha256.update(view[max(self._hashed - offset, 0) : filled])
            self._hashed = end
        return filled

    def _go_back(self, offset: int) -> None:
        # A CRC over what is read twice means nothing; whoever goes back has found damage.
        self._stream.seek(offset)
        self._block, self._block_start, self._at, self._crc = b"", offset, 0, 0
