"""Exit codes: 0 done; 1 failed; 2 wrong usage; 3 done, but something is damaged or in doubt.

In doubt is a recording without a single distance, and one with a warning. The end of `run` and the rows
of the table `diagnostics` say what it is.
"""

from __future__ import annotations

from collections.abc import Sequence

DONE, FAILED, USAGE, DAMAGED, INTERRUPTED = 0, 1, 2, 3, 130


def code_of(stored: Sequence[object], failed: Sequence[object], doubtful: Sequence[object]) -> int:
    """Return the exit code of a run from the recordings that were stored, failed and doubtful."""
    if not stored:
        return FAILED
    return DAMAGED if failed or doubtful else DONE
