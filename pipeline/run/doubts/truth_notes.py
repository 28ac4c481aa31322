"""Diagnostics where the truth of a recording contradicts all that is estimated."""

from __future__ import annotations

import math

from pipeline.core.records import Diagnostic, Severity
from pipeline.store.database import Store

# Nothing that is right elsewhere is wrong by so much: units other than metres, fields exchanged, other
# objects or another time are.
FACTOR = 2.0
FEWEST = 8
_RATIOS = """
SELECT
    count(*) FILTER (m.true_depth_m > 0) AS depths,
    exp(median(ln(e.depth_m / m.true_depth_m)) FILTER (m.true_depth_m > 0)) AS depth_ratio,
    count(*) FILTER (m.true_height_m > 0 AND e.height_m > 0) AS heights,
    exp(median(ln(e.height_m / m.true_height_m)) FILTER (m.true_height_m > 0 AND e.height_m > 0))
        AS height_ratio
FROM estimates AS e
JOIN matches AS m USING (recording_id, observation_index)
WHERE recording_id = $recording AND m.camera = $camera AND e.run_id = $run
    AND e.method = 'fused' AND e.depth_m > 0
"""


def truth_notes(store: Store, recording_id: str, run_id: str, camera: str) -> list[Diagnostic]:
    """Return a note if true depths or heights are far from the estimates: accuracy means nothing then.

    Args:
        store: a database that is open, with the estimates of the run.
        recording_id: the recording.
        run_id: the run.
        camera: name of the camera.
    """
    values = {"recording": recording_id, "run": run_id, "camera": camera}
    (row,) = store.connection.execute(_RATIOS, values).fetchall()
    said = [
        (f"half of {count:,} {what} are {_times(ratio)} the true ones", count)
        for what, count, ratio in (("distances", *row[:2]), ("heights", *row[2:]))
        if count >= FEWEST and abs(math.log(ratio)) >= math.log(FACTOR)
    ]
    if not said:
        return []
    return [
        Diagnostic(
            Severity.WARNING,
            "truth_contradicted",
            f"{' and '.join(words for words, _ in said)}, or more: the truth is in other units than "
            "metres, of other objects or of another time, or the lens, the pose or the class is wrong; "
            "figures of accuracy mean nothing until this is settled",
            camera=camera,
            count=max(count for _, count in said),
        )
    ]


def _times(ratio: float) -> str:
    return f"{ratio:.3g} times" if ratio > 1 else f"1/{1 / ratio:.3g} of"
