"""Batches of tracks that are estimated together, so that memory does not grow with the recording.

A track is never cut: its height is that of all its frames. Tracks that begin one after another are a
short range of frames, and so of the database.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import pyarrow as pa

from pipeline.core.arrays import IntArray


@dataclass(frozen=True, slots=True)
class Tracks:
    """Some tracks of a camera, in the order in which they begin, (t,) each."""

    track_id: IntArray
    first_frame: IntArray
    last_frame: IntArray
    count: IntArray  # of observations

    @classmethod
    def of(cls, table: pa.Table) -> Tracks:
        """Return the rows of `track_rows.tracks_of` of one camera."""
        names = ("track_id", "first_frame_index", "last_frame_index", "observation_count")
        return cls(*(table[name].to_numpy() for name in names))

    def __len__(self) -> int:
        return len(self.track_id)

    @property
    def frames(self) -> tuple[int, int]:
        """The first and the last frame that any of them is in."""
        return int(self.first_frame.min()), int(self.last_frame.max())

    @property
    def observations(self) -> int:
        """Number of their observations."""
        return int(self.count.sum())

    def take(self, rows: IntArray | slice) -> Tracks:
        """Return some of them."""
        columns = (self.track_id, self.first_frame, self.last_frame, self.count)
        return Tracks(*(column[rows] for column in columns))

    def batches(self, limit: int) -> Iterator[Tracks]:
        """Yield all of them, as many together as have `limit` observations, or one."""
        begin, total = 0, 0
        for end, count in enumerate(self.count.tolist()):
            if total and total + count > limit:
                yield self.take(slice(begin, end))
                begin, total = end, 0
            total += count
        if begin < len(self):
            yield self.take(slice(begin, len(self)))

    def sample(self, limit: int) -> Tracks:
        """Return some, spread over all, that have no more than `limit` observations, or one."""
        step = -(-self.observations // limit)
        spread = self.take(slice(None, None, max(step, 1)))
        return spread.take(slice(0, max(int((np.cumsum(spread.count) <= limit).sum()), 1)))
