"""Recordings handed to an engine, whole or in windows; each comes back as one outcome.

look for damage | windows side by side -> joined -> outcome        damage found: once more, whole
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

from pipeline.core.config import Config
from pipeline.core.errors import StadimeterError
from pipeline.core.progress import Progress, Report
from pipeline.mcap_file.bag import size_of
from pipeline.parallel.processes import Engine
from pipeline.run.recording import Outcome, Work, attempt, work_alone
from pipeline.run.windows.split import Window, windows_by_index
from pipeline.run.windows.tasks import (
    MeasuredWindow,
    WindowProgress,
    give_up,
    join_windows,
    look_for_damage,
    work_window,
)

# A process takes about a second to begin, in which one that runs already measures so much footage
# (720p, 90 KB a frame, 325 frames a second: `python -m bench.speed`).
BYTES_WORTH_A_PROCESS = 32_000_000
_WHOLE, _LOOK, _WINDOW, _JOIN = "whole", "look", "window", "join"


class Task(NamedTuple):
    """Name of a task."""

    path: Path
    kind: str
    window: int = 0

    def __str__(self) -> str:
        """Name the recording, as whoever reads of a lost task wants to know it."""
        return str(self.path)


def windows_of(
    paths: list[Path], config: Config, window_s: float
) -> dict[Path, tuple[Window, ...]]:
    """Return the windows of each recording that is cut; it depends on the recording alone."""
    found = {path: attempt(path, windows_by_index, path, config, window_s) for path in paths}
    return {path: ws for path, ws in found.items() if ws and not isinstance(ws, StadimeterError)}


def usual_processes(paths: list[Path], cut: Mapping[Path, tuple[Window, ...]]) -> int:
    """Return how many processes are worth their start, at most one a core and task."""
    size = 0
    for path in paths:
        with suppress(OSError):  # who reads it tells
            size += size_of(path)
    return max(1, min(usable_cores(), task_count(paths, cut), size // BYTES_WORTH_A_PROCESS))


def task_count(paths: list[Path], cut: Mapping[Path, tuple[Window, ...]]) -> int:
    """Return how many tasks can be done side by side."""
    return sum(len(cut.get(path, (None,))) for path in paths)


def usable_cores() -> int:
    """Return the number of cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


@dataclass(slots=True)
class _Cut:
    """One recording whose windows are being measured."""

    work: Work
    windows: tuple[Window, ...]
    sha256: str = ""
    measured: dict[int, MeasuredWindow] = field(default_factory=dict)
    left: int = 0  # tasks that have not come back
    whole: bool = False  # it has to be read whole
    error: StadimeterError | None = None


class Course:
    """Tasks of all recordings of a run, in their order.

    Args:
        cut: the windows of recordings that have any.
        processes: how many tasks are done at a time.
    """

    def __init__(self, cut: Mapping[Path, tuple[Window, ...]], processes: int) -> None:
        self._windows = cut
        self._processes = processes
        self._works: dict[Path, Work] = {}
        self._cut: dict[Path, _Cut] = {}

    def submit(self, engine: Engine, work: Work) -> None:
        """Hand out a recording."""
        self._works[work.path] = work
        windows = self._windows.get(work.path, ())
        if not windows:
            engine.submit(Task(work.path, _WHOLE), work_alone, work)
            return
        self._cut[work.path] = _Cut(work, windows, left=len(windows) + 1)
        # Found early, damage saves the work on windows. Where all windows are begun at once anyway, a
        # look before them only lets the last of them begin later.
        look_last = 1 < len(windows) <= self._processes
        if not look_last:
            engine.submit(Task(work.path, _LOOK), look_for_damage, work)
        for window in windows:
            engine.submit(Task(work.path, _WINDOW, window.number), work_window, work, window)
        if look_last:
            engine.submit(Task(work.path, _LOOK), look_for_damage, work)

    def results(self, engine: Engine) -> Iterator[tuple[Work, Outcome]]:
        """Yield each recording's outcome as it ends."""
        for name, found in engine.results():
            work = self._works[name.path]
            if name.kind in (_LOOK, _WINDOW):
                error = self._part_done(engine, self._cut[name.path], name, found)
                if error is None:
                    continue
                found = error
            if found is None:  # the joining tells that it cannot be joined
                self._read_whole(engine, work)
                continue
            failed = isinstance(found, StadimeterError)
            yield work, Outcome(work.path, error=found) if failed else found

    def _part_done(
        self, engine: Engine, cut: _Cut, name: Task, found: Any
    ) -> StadimeterError | None:
        """Take the result of a look or a window; hand out what comes after the last of them."""
        cut.left -= 1
        if isinstance(found, StadimeterError):
            cut.error = found
        elif name.kind == _WINDOW and found is not None:
            cut.measured[name.window] = found
        elif name.kind == _LOOK:
            cut.sha256 = found or ""
            cut.whole = found is None
        if cut.whole or cut.error is not None:
            give_up(cut.work)
        if cut.left:
            return None
        if cut.whole:
            self._read_whole(engine, cut.work)
            return None
        if cut.error is not None:
            return cut.error
        measured = tuple(cut.measured[window.number] for window in cut.windows)
        name = Task(cut.work.path, _JOIN)
        engine.submit(name, join_windows, cut.work, cut.windows, measured, cut.sha256)
        return None

    def _read_whole(self, engine: Engine, work: Work) -> None:
        engine.submit(Task(work.path, _WHOLE), work_alone, work)


class SharedProgress:
    """Listener of an engine: the progress of windows becomes that of their recording."""

    def __init__(self, report: Report, cut: Mapping[Path, tuple[Window, ...]]) -> None:
        self._report = report
        self._cut = cut
        self._seen: dict[tuple[Path, int], Progress] = {}

    def __call__(self, message: Progress | WindowProgress) -> None:
        """Report what a task tells."""
        if isinstance(message, Progress):
            self._report(message)
            return
        self._seen[message.path, message.number] = message.progress
        windows = self._cut[message.path]
        every = [self._seen.get((message.path, window.number)) for window in windows]
        begun = [p for p in every if p is not None]
        share = sum(_share(progress, number, len(windows)) for number, progress in enumerate(every))
        self._report(
            message.progress._replace(
                frames=sum(p.frames for p in begun), fraction=min(share / len(windows), 1.0)
            )
        )


def _share(progress: Progress | None, number: int, count: int) -> float:
    """Return how much of a window is done; its progress is a place in the whole file."""
    if progress is None:
        return 0.0
    return min(max(progress.fraction * count - number, 0.0), 1.0)
