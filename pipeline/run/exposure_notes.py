"""Diagnostics of pictures whose brightness contradicts their exposure data (Eq. 15).

`schemas/sql/views/main.exposure_checks.sql` judges every frame; here its verdicts become diagnostics, one
a camera and kind.
"""

from __future__ import annotations

import pyarrow as pa

from pipeline.core.records import Diagnostic, Severity

_SAID = {
    "clipped": (
        Severity.INFO,
        "exposure_clipped",
        "over 5 % of the pixels of these frames are black or white: their brightness is not reliable",
    ),
    "departs": (
        Severity.WARNING,
        "exposure_departs",
        "these frames are brighter or darker than their neighbours by up to {most:.1f} stops, and their "
        "exposure data do not explain it: the data do not belong to the picture",
    ),
    "steps": (
        Severity.WARNING,
        "exposure_steps",
        "the brightness changes by up to {most:.1f} stops and stays so, which the exposure data do not "
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
