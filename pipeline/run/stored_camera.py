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
from pipeline.estimate.frame_lens import FrameLens, lens_at
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
    _usual: tuple[FrameLens | None] | None = None

    @property
    def usual_lens(self) -> FrameLens | None:
        """The lens that most of its pictures have, as the recording or the camera file states it."""
        if self._usual is None:
            lenses = lenses_of(self.store, self.recording_id, self.row.camera)
            self._usual = (lens_at(lenses, 0) if lenses.num_rows else None,)
        return self._usual[0]

    def measured(self, tracks: Tracks) -> Measured:
        """Read tracks, and what else is in their frames."""
        own, others = observed(
            self.store,
            self.recording_id,
            self.row.camera,
            tracks.track_id.tolist(),
            tracks.frames,
        )
        return measured_of(own, self.row, self.plane, others, self.usual_lens)

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
