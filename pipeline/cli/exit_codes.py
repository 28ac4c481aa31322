"""Exit codes: 0 done; 1 failed; 2 wrong usage; 3 done, but some input was damaged or refused.

The rows of the table `diagnostics` say what was damaged.
"""

from __future__ import annotations

from collections.abc import Sequence

DONE, FAILED, USAGE, DAMAGED, INTERRUPTED = 0, 1, 2, 3, 130


def code_of(stored: Sequence[object], failed: Sequence[object], damaged: Sequence[object]) -> int:
    """Return the exit code of a run from the recordings that were stored, failed and damaged."""
    if not stored:
        return FAILED
    return DAMAGED if failed or damaged else DONE
