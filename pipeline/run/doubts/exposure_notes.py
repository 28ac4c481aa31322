"""Diagnostics of pictures whose brightness contradicts their exposure data (Eq. 15).

`schemas/sql/views/main.exposure_checks.sql` judges every frame; here its verdicts become diagnostics, one
a camera and kind.
"""

from __future__ import annotations

import pyarrow as pa

from pipeline.core.records import Diagnostic, Severity
from pipeline.store.database import Store

_SAID = {
    "clipped": (
        Severity.INFO,
        "exposure_clipped",
        "over 5 % of the pixels of these frames are black or white: their brightness is not "
        "reliable",
    ),
    "departs": (
        Severity.WARNING,
        "exposure_departs",
        "these frames are brighter or darker than their neighbours by up to {most:.1f} stops, "
        "and their "
        "exposure data do not explain it: the data do not belong to the picture",
    ),
    "steps": (
        Severity.WARNING,
        "exposure_steps",
        "the brightness changes by up to {most:.1f} stops and stays so, which the exposure "
        "data do not "
        "tell: the gain has changed, or the light",
    ),
}


def exposure_notes(verdicts: pa.Table) -> list[Diagnostic]:
    """Return diagnostics of the frames that `main.exposure_checks` flags.

    Args:
        verdicts: how many frames of each camera have each verdict, as the store counts them.
    """
    notes = []
    for row in verdicts.to_pylist():
        severity, code, text = _SAID[row["verdict"]]
        notes.append(
            Diagnostic(
                severity,
                code,
                text.format(most=row["most_ev"] or 0.0)
                + f"; first in frame {row['first_frame_index']}, all in main.exposure_checks",
                camera=row["camera"],
                log_time_ns=row["first_time_ns"],
                count=row["frames"],
            )
        )
    return notes


# A shutter is closed before the next picture begins; stamps jitter.
_LONGEST_SHARE, _FEWEST = 1.5, 8
_TIMES = """
WITH timed AS (
    SELECT exposure_time_s,
        (capture_time_ns - lag(capture_time_ns) OVER (ORDER BY frame_index)) / 1e9 AS interval_s
    FROM frames WHERE recording_id = $recording AND camera = $camera
)
SELECT count(*), median(exposure_time_s), median(interval_s)
FROM timed WHERE exposure_time_s > 0 AND interval_s > 0
"""


def exposure_time_notes(store: Store, recording_id: str, camera: str) -> list[Diagnostic]:
    """Return a note if pictures were exposed for longer than the time from one to the next.

    Args:
        store: a database that is open, with the frames of the recording.
        recording_id: the recording.
        camera: name of the camera.
    """
    values = {"recording": recording_id, "camera": camera}
    ((count, time_s, interval_s),) = store.connection.execute(_TIMES, values).fetchall()
    if count < _FEWEST or time_s <= _LONGEST_SHARE * interval_s:
        return []
    return [
        Diagnostic(
            Severity.WARNING,
            "impossible_exposure_time",
            f"exposure times of {time_s:.3g} s are longer than the {interval_s:.3g} s from one "
            "picture to the next: they are in other units than seconds, or the clock of the pictures "
            "runs too fast",
            camera=camera,
            count=count,
        )
    ]
