"""Verification of a database: `verify`."""

from __future__ import annotations

from pathlib import Path

from pipeline.core.errors import UsageError
from pipeline.run.verify import Verified
from stadimeter.arguments import OnProgress, PathLike, report_of


def verify(
    db: PathLike, *, frames: int = 20, seed: int = 0, progress: OnProgress = None
) -> list[Verified]:
    """Hash the files of all stored recordings again, and measure some of their frames again.

    To measure frames again takes as long as the run: what is found in a frame depends on those before it.

    Args:
        db: DuckDB file.
        frames: number of frames of each recording, drawn at random, whose rows are compared with the
            stored ones; 0 measures nothing again, and compares the hashes of the files only.
        seed: of the draw.
        progress: called with a `Progress` while the work goes on.

    Returns:
        One result for each recording; its `problem` is empty if everything is as it was stored.

    Raises:
        UsageError: the number of frames is negative.
        StoreError: the database does not exist or cannot be read.
    """
    from pipeline.run.verify import verify_recordings

    if frames < 0:
        raise UsageError(f"the number of frames must be at least 0, not {frames}")
    return verify_recordings(Path(db), frames, seed, report_of(progress))
