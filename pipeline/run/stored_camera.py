"""One camera of a stored recording: its row, and its tracks as they are read from the store."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from pipeline.calibrate.walkers.sample import MIN_OBSERVATIONS, spread_people
from pipeline.calibrate.walkers.tilt import Tilt
from pipeline.core.arrays import FloatArray
from pipeline.core.camera_row import CameraRow
from pipeline.core.records import GroundPlane
from pipeline.estimate.frame_lens import first_lens
from pipeline.estimate.tables import measured_of
from pipeline.estimate.track_batches import Tracks
from pipeline.estimate.types import Measured
from pipeline.store.database import Store
from pipeline.store.track_rows import lenses_of, observed


@dataclass(slots=True)
class StoredCamera:
    """One camera of a stored recording."""

    store: Store
    recording_id: str
    row: CameraRow
    plane: GroundPlane | None = None
    tilt: Tilt | None = None  # by its people, where they fix no pose
    _lenses: pa.Table | None = None

    @property
    def lenses(self) -> pa.Table:
        """Sizes and lenses of its pictures (`track_rows.lenses_of`)."""
        if self._lenses is None:
            self._lenses = lenses_of(self.store, self.recording_id, self.row.camera)
        return self._lenses

    def measured(self, tracks: Tracks) -> Measured:
        """Read tracks, and what else is in their frames."""
        own, others = observed(
            self.store,
            self.recording_id,
            self.row.camera,
            tracks.track_id.tolist(),
            tracks.frames,
            with_lens=self.lenses.num_rows > 1,
        )
        return measured_of(own, self.row, self.plane, others, first_lens(self.lenses))

    def people(self, tracks: pa.Table, besides: Sequence[int] = ()) -> Measured | None:
        """Read the tracks that determine the pose; None if there are no people.

        Args:
            tracks: the camera's rows of `track_rows.tracks_of`, for the class of those who walk.
            besides: tracks that are read whatever they tell.
        """
        people = tracks.filter(pc.greater(tracks["class_count"], 0)).sort_by("first_of_class")
        if not people.num_rows:
            return None
        long = people.filter(pc.greater_equal(people["class_count"], MIN_OBSERVATIONS))
        some = long if long.num_rows else people
        ids = np.union1d(spread_people(some["track_id"].to_numpy()), np.array(besides, np.int64))
        return self.measured(Tracks.of(people.filter(pc.is_in(people["track_id"], pa.array(ids)))))


def lines_of(edges: pa.Table, camera: str) -> FloatArray:
    """Return a camera's rows of the table `background_lines` as x0 y0 x1 y1, (n, 4)."""
    mine = edges.filter(pc.equal(edges["camera"], camera))
    names = ("x0_px", "y0_px", "x1_px", "y1_px")
    return np.stack([mine[n].to_numpy() for n in names], axis=1).astype(np.float64)
