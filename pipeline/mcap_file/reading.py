"""State that the parts of one walk over a file share."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

from pipeline.core.config import Limits
from pipeline.mcap_file.channels import Declarations, Topics
from pipeline.mcap_file.chunk import unpacked
from pipeline.mcap_file.forward_file import ForwardFile
from pipeline.mcap_file.losses import Losses
from pipeline.mcap_file.records import FRAMING, Malformed, read_chunk
from pipeline.mcap_file.rescue import declarations_between_chunks, declarations_in_chunks
from pipeline.mcap_file.search import RecordSearch
from pipeline.mcap_file.summary import summary_records
from pipeline.mcap_file.work import Work

_MOST_SUSPECT = 1024  # declarations from damaged chunks that are kept


@dataclass(slots=True)
class Reading:
    """One walk: where it is, what it found, and what it may still cost."""

    source: ForwardFile
    limits: Limits
    losses: Losses
    topics: Topics
    work: Work
    message_counts: Counter[int]
    search: RecordSearch = field(init=False)
    begin: int = 0  # of the recording, in a file of several
    repeated_counts: Counter[int] = field(default_factory=Counter)  # in an earlier one of the file
    stated_counts: dict[int, int] = field(default_factory=dict)  # by the summary
    crc_holds: bool = True  # of the data section or the summary, as nothing was passed over
    suspect: list[tuple[int, bytes]] = field(default_factory=list)  # from damaged chunks

    def __post_init__(self) -> None:
        """Give the channels the places in which their declarations may survive."""
        source = self.source
        self.search = RecordSearch(
            source.peek, source.size, self.topics.knows, self.work, self._is_whole_chunk
        )
        self.topics.elsewhere = self._places
        self.topics.believe(lambda: self._summary(proven=True))

    def suspects(self, declarations: Iterator[tuple[int, bytes]]) -> None:
        """Keep declarations of a damaged chunk, for channels that nothing else declares."""
        for found in declarations:
            if len(self.suspect) >= _MOST_SUSPECT:
                return
            self.suspect.append(found)

    def _places(self) -> Iterator[Callable[[], Declarations]]:
        ahead = (self.source, self.source.position, self._silent_search(), self.work, self.limits)
        yield lambda: self._summary(proven=True)
        yield lambda: declarations_between_chunks(*ahead)
        yield lambda: declarations_in_chunks(*ahead)
        yield self._told_suspects

    def _summary(self, *, proven: bool) -> Iterator[tuple[int, bytes]]:
        return summary_records(self.source, self.limits.record_bytes, proven=proven)

    def _told_suspects(self) -> list[tuple[int, bytes]]:
        if self.suspect:
            self.losses.repaired(
                "unproven_declaration",
                "schemas and channels were taken from a damaged chunk, as they stand nowhere else; no "
                "CRC covers their names",
                self.source.position,
            )
        return self.suspect

    def _silent_search(self) -> RecordSearch:
        """Return a search that asks for no channels, which are what it is to find."""
        known = self.topics.channels
        return RecordSearch(
            self.source.peek, self.source.size, known.__contains__, self.work, self._is_whole_chunk
        )

    def _is_whole_chunk(self, offset: int, length: int) -> bool:
        """Return whether the chunk whose record is here has a CRC, and it fits."""
        if length > self.limits.record_bytes or self.work.bytes_left <= 0:
            return False
        try:
            chunk = read_chunk(self.source.peek(offset + FRAMING.size, length))
            if chunk.uncompressed_crc == 0:
                return False
            data = unpacked(chunk, self.limits.chunk_bytes)
        except Malformed:
            return False
        if chunk.compression:
            self.work.bytes_left -= len(
                data
            )  # the next chunk that is read tells when it is too much
        return True
