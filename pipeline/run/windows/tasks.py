"""Tasks of a recording that is cut: a look for damage, one window, the joining of all.

Each is a plain function, so that any engine can run it. What a window leaves lies in a folder of its own
within the folder of the recording's work, and is replaced whole if the task is begun again.
"""

from __future__ import annotations

import shutil
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from pipeline.core.errors import StadimeterError
from pipeline.core.progress import Progress
from pipeline.core.timing import StageTimes
from pipeline.parallel.processes import tell
from pipeline.run.pass_one import measure_recording
from pipeline.run.recording import Outcome, Work, attempt, finish_measured, named
from pipeline.run.windows.split import Window, WindowFile, hash_if_undamaged
from pipeline.run.windows.stitch import refused_pictures, stitch, summed_row
from pipeline.store.recordings import RecordingRow

_GIVEN_UP = "given_up"


@dataclass(frozen=True, slots=True)
class WindowProgress:
    """Progress of one window."""

    path: Path
    number: int
    progress: Progress


@dataclass(frozen=True, slots=True)
class MeasuredWindow:
    """One window whose pictures are measured."""

    row: RecordingRow
    times: StageTimes


def look_for_damage(work: Work) -> str | StadimeterError | None:
    """Return the SHA-256 of a recording, or None if it is damaged and must be read whole."""
    return attempt(work.path, hash_if_undamaged, work.path, work.config)


def give_up(work: Work) -> None:
    """Let windows that have not begun end at once: their recording is not to be cut after all."""
    work.folder.mkdir(parents=True, exist_ok=True)
    (work.folder / _GIVEN_UP).touch()


def work_window(work: Work, window: Window) -> MeasuredWindow | StadimeterError | None:
    """Measure one window of a recording; None if the recording is not to be cut any more."""
    if (work.folder / _GIVEN_UP).exists():
        return None
    return attempt(work.path, _measured, work, window)


def _measured(work: Work, window: Window) -> MeasuredWindow:
    parts = _parts_of(work, window)
    shutil.rmtree(parts, ignore_errors=True)  # by a process that was killed
    times = StageTimes()

    def report(progress: Progress) -> None:
        tell(WindowProgress(work.path, window.number, progress))

    row = measure_recording(
        work.path,
        work.config,
        parts,
        threads=work.threads,
        report=report,
        times=times,
        open_file=partial(WindowFile, window=window, sha256=""),
    )
    report(Progress(work.path.name, "measure", row.frame_count, 1.0, times.slowest))
    return MeasuredWindow(row, times)


def join_windows(
    work: Work, windows: tuple[Window, ...], measured: tuple[MeasuredWindow, ...], sha256: str
) -> Outcome | None:
    """Put the windows of a recording together and do the rest of it; None if it must be read whole.

    Args:
        work: the recording.
        windows: its windows, in order.
        measured: what they gave.
        sha256: of all its bytes.
    """
    folders = [_parts_of(work, window) for window in windows]
    rows = [one.row for one in measured]
    outcome = Outcome(work.path)
    for one in measured:
        outcome.times.add_all(one.times)
    found = attempt(work.path, _joined, work, windows, folders, rows, sha256, outcome)
    if isinstance(found, StadimeterError):
        return Outcome(work.path, error=named(work.path, found), times=outcome.times)
    return outcome if found else None


def _joined(
    work: Work,
    windows: tuple[Window, ...],
    folders: list[Path],
    rows: list[RecordingRow],
    sha256: str,
    outcome: Outcome,
) -> bool:
    if any(map(refused_pictures, rows, folders)):
        return False
    parts = work.folder / "parts"
    shutil.rmtree(parts, ignore_errors=True)
    with outcome.times.stage("stitch"):
        stitch(folders, windows, parts, work.config.track)
        row = summed_row(rows, parts, work.path)
    finish_measured(work, replace(row, content_sha256=sha256), parts, outcome)
    return True


def _parts_of(work: Work, window: Window) -> Path:
    return work.folder / f"window-{window.number:04d}"
