"""Clips to judge tracks on, and the figures of one run on a clip."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import stadimeter
from pipeline.core.config import Config
from pipeline.run.truth import add_truth_of_file
from pipeline.store.database import Store
from stadimeter.inputs import VIDEO_SUFFIXES

# Names of truth beside NAME.mcap or a video: NAME_gt.txt (MOT), and so on.
TRUTH_ENDINGS = ("_truth.csv", "_gt.txt", "_gt.xml", "_gt.json", "_gt.csv")
TRACKING = ("recall", "precision", "idf1", "hota", "deta", "assa", "mota")
COUNTS = ("switch_count", "fragment_count")
ENDS = ("foot_bias_px", "foot_px", "head_bias_px", "head_px")
# No adult is so much taller than the usual one: statures of adults differ by 6 % (one standard deviation,
# both sexes together). A box of two people one behind the other, seen from above, is.
MERGED = 1.3
FEWEST = 5  # tracks that tell a line

_ENDS = """
SELECT median(o.y_max_px - t.y_max_px) AS foot_bias_px, median(abs(o.y_max_px - t.y_max_px)) AS foot_px,
    median(o.y_min_px - t.y_min_px) AS head_bias_px, median(abs(o.y_min_px - t.y_min_px)) AS head_px
FROM matches AS m
JOIN observations AS o USING (recording_id, observation_index)
JOIN ground_truth AS t ON t.recording_id = m.recording_id AND t.camera = m.camera
    AND t.frame_index = m.frame_index AND t.object_id = m.object_id
"""
_PERSONS = """
WITH persons AS (
    SELECT o.* FROM observations AS o JOIN tracks AS t USING (recording_id, camera, track_id)
    WHERE t.class_name = 'person'
),
crowds AS (SELECT count(*) AS people FROM persons GROUP BY recording_id, camera, frame_index)
SELECT
    (SELECT count(*) FROM tracks WHERE class_name = 'person') AS person_count,
    (SELECT coalesce(max(people), 0) FROM crowds) AS at_once_count,
    (SELECT count(*) FROM cameras WHERE camera_height_m IS NOT NULL) AS pose_count
"""
# By the picture alone, as not every clip has a pose: people's height is a line in the row of their feet
# (a plane seen by a level or slightly tilted camera), fitted to the usual track.
_MERGED = """
WITH usual AS (
    SELECT median(o.y_max_px) AS foot_px, median(o.y_max_px - o.y_min_px) AS tall_px
    FROM observations AS o JOIN tracks AS t USING (recording_id, camera, track_id)
    WHERE t.class_name = 'person' AND o.measured
        AND NOT (o.truncated_top OR o.truncated_bottom OR o.truncated_left OR o.truncated_right)
    GROUP BY recording_id, camera, track_id
),
line AS (
    SELECT regr_slope(tall_px, foot_px) AS slope, regr_intercept(tall_px, foot_px) AS begin FROM usual
)
SELECT
    count(*) AS tracks,
    count(*) FILTER (tall_px > ? * (coalesce(slope, 0.0) * foot_px + coalesce(begin, tall_px))) AS merged
FROM usual, line
"""


class Clip(NamedTuple):
    """A recording or video, and the file of its truth; None if there is none."""

    path: Path
    truth: Path | None


def clips_in(folder: Path) -> Iterator[Clip]:
    """Yield the recordings and videos of a folder in the order of their names, with their truth.

    Args:
        folder: NAME.mcap or a video NAME.mp4, .avi, .gif ...; truth is beside it (`TRUTH_ENDINGS`).
    """
    for path in sorted(folder.iterdir()):
        if path.suffix.lower() == ".mcap" or path.suffix.lower() in VIDEO_SUFFIXES:
            named = (folder / f"{path.stem}{ending}" for ending in TRUTH_ENDINGS)
            yield Clip(path, next((truth for truth in named if truth.is_file()), None))


def figures_of(clip: Clip, config: Config) -> dict[str, float]:
    """Run on a clip, and return its figures by name; those that need truth only where there is some.

    Raises:
        StadimeterError: the clip or its truth cannot be read.
    """
    with tempfile.TemporaryDirectory(prefix="stadimeter-tracking-") as folder:
        database = Path(folder) / "tracking.duckdb"
        result = stadimeter.measure(clip.path, database, camera=config)
        for outcome in result.failed:
            if outcome.error is not None:
                raise outcome.error
        if clip.truth is not None:
            add_truth_of_file(clip.truth, database)
        with Store.open(database, read_only=True) as store:
            return _read(store)


def _read(store: Store) -> dict[str, float]:
    (figures,) = store.query(_PERSONS).to_pylist()
    (tall,) = store.query(_MERGED, [MERGED]).to_pylist()
    if tall["tracks"] >= FEWEST:
        figures["merged_count"] = tall["merged"]
    for tracking in store.query("FROM accuracy.tracking").to_pylist():
        figures |= {name: tracking[name] for name in (*TRACKING, *COUNTS)}
        figures |= store.query(_ENDS).to_pylist()[0]
    return {name: float(value) for name, value in figures.items() if value is not None}
