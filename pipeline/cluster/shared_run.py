"""Recordings into a folder of finished ones: those that are missing are handed out as tasks.

find what is missing -> recordings as tasks -> long ones cut into windows -> windows put together
"""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from pathlib import Path

from pipeline import __version__
from pipeline.cluster.engine import ray_engine
from pipeline.cluster.manifest import Manifest, Source, read_manifests
from pipeline.cluster.same_evidence import settle
from pipeline.cluster.tasks import Run, join, work, work_window
from pipeline.core.config import Config
from pipeline.core.errors import RowsRefused, StadimeterError, UsageError, Where
from pipeline.core.progress import Progress, Report, silent
from pipeline.core.records import Diagnostic
from pipeline.mcap_file.bag import is_recording
from pipeline.parallel.processes import Engine, local_engine
from pipeline.run.recordings import begin
from pipeline.run.windows.course import usable_cores, usual_processes, windows_of
from pipeline.run.windows.split import WINDOW_S, Plan


@dataclass(frozen=True, slots=True)
class Finished:
    """Result of one recording."""

    path: Path
    manifest: Manifest | None = None
    error: StadimeterError | None = None


@dataclass(slots=True)
class SharedResult:
    """Results of all recordings of a run."""

    run_id: str
    there: list[Finished] = field(default_factory=list)  # before this run
    made: list[Finished] = field(default_factory=list)
    failed: list[Finished] = field(default_factory=list)
    # What is there twice, by file name: told here, as the rows of a recording are made alone.
    notes: list[tuple[str, Diagnostic]] = field(default_factory=list)

    @property
    def stored(self) -> list[Finished]:
        """Recordings that are in the folder."""
        return [*self.there, *self.made]

    @property
    def damaged(self) -> list[Finished]:
        """Recordings that were stored with losses."""
        return [f for f in self.stored if f.manifest is not None and f.manifest.damaged]


def run_shared(
    recordings: Iterable[Path],
    folder: Path,
    config: Config,
    *,
    engine: str = "local",
    address: str | None = None,
    workers: int | None = None,
    window_s: float = WINDOW_S,
    label: str | None = None,
    report: Report = silent,
) -> SharedResult:
    """Measure and estimate the recordings that are not in the folder yet.

    Args:
        recordings: paths that every machine sees.
        folder: shared storage, the same path on every machine.
        config: how to work them.
        engine: `local` or `ray`.
        address: a running Ray cluster; None starts one on this machine.
        workers: tasks at a time, where no cluster is running already; None takes one a core.
        window_s: recordings longer than one and a half times this are cut; 0 leaves all whole.
        label: a name for the run.
        report: is told what is done.

    Raises:
        UsageError: the folder cannot be made.
        MissingLibrary, StadimeterError: the engine cannot be had.
    """
    try:
        (folder / "manifests").mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UsageError(f"cannot be made: {error.strerror}", where=Where(folder)) from error
    begun = begin(config, label)
    run = Run(folder.absolute(), config, begun, window_s)
    result = SharedResult(begun.run_id)
    before = _paths_by_key(run.folder)
    missing = _missing([p.absolute() for p in recordings], run, result)
    if missing:
        with _engine(engine, address, workers or _usual(engine, missing, run)) as started:
            _Course(started, run, result, report).follow(missing)
        _count_once(run.folder, result, before)
    return result


def _paths_by_key(folder: Path) -> dict[str, str]:
    if not any((folder / "manifests").glob("*.json")):
        return {}
    return {m.key: m.source.path for m in read_manifests(folder)}


def _count_once(folder: Path, result: SharedResult, before: dict[str, str]) -> None:
    """Let what is there twice count once; of equal files the last that was finished stays."""
    made = {f.manifest.key: f for f in result.made if f.manifest is not None}
    for finished in result.made:  # two files with the same bytes, both in this run
        if finished.manifest is not None:
            before.setdefault(finished.manifest.key, finished.manifest.source.path)
    settled = settle(folder, [f.manifest for f in made.values() if f.manifest], before)
    result.notes = settled.notes
    for key, whole in settled.beginnings.items():
        text = f"is only the beginning of {whole}, which is stored whole"
        result.made.remove(made[key])
        result.failed.append(
            Finished(made[key].path, error=RowsRefused(text, where=Where(made[key].path)))
        )


def _engine(name: str, address: str | None, workers: int) -> AbstractContextManager[Engine]:
    return (
        ray_engine(address, workers)
        if name == "ray"
        else local_engine(workers, loads=[work.__module__])
    )


def _usual(engine: str, paths: list[Path], run: Run) -> int:
    """Return how many tasks are done at a time if nobody says it."""
    if engine == "ray":
        return usable_cores()
    return usual_processes(paths, windows_of(paths, run.config, run.window_s))


def _missing(paths: list[Path], run: Run, result: SharedResult) -> list[Path]:
    """Return the recordings that have no result yet; enter the others into `result`."""
    if not any((run.folder / "manifests").glob("*.json")):
        return list(dict.fromkeys(paths))
    known = {m.source.path: m for m in read_manifests(run.folder)}
    missing = []
    for path in dict.fromkeys(paths):
        manifest = known.get(str(path))
        if manifest is not None and is_recording(path) and _answers(manifest, path, run):
            result.there.append(Finished(path, manifest))
        else:
            missing.append(path)
    return missing


def _answers(manifest: Manifest, path: Path, run: Run) -> bool:
    return manifest.answers(Source.of(path), run.configuration_sha256, __version__) and all(
        (run.folder / part.path).is_file() for part in manifest.parts.values()
    )


class _Course:
    """Tasks of a run, in their order: recordings, windows of long ones, joining of windows."""

    def __init__(self, engine: Engine, run: Run, result: SharedResult, report: Report) -> None:
        self._engine = engine
        self._run = run
        self._result = result
        self._report = report
        self._plans: dict[Path, Plan] = {}
        self._left: dict[Path, int] = {}  # windows that are not measured yet
        self._lost: dict[Path, StadimeterError] = {}

    def follow(self, paths: list[Path]) -> None:
        """Hand out tasks until all recordings are finished."""
        for path in paths:
            self._engine.submit(path, work, path, self._run)
        for name, found in self._engine.results():
            path = name[0] if isinstance(name, tuple) else name
            if isinstance(found, Plan):
                self._cut(path, found)
            elif isinstance(name, tuple):
                self._window_done(path, found)
            else:
                self._finished(path, found)

    def _cut(self, path: Path, plan: Plan) -> None:
        self._plans[path], self._left[path] = plan, len(plan.windows)
        for window in plan.windows:
            name = (path, window.number)
            self._engine.submit(name, work_window, path, self._run, plan, window)

    def _window_done(self, path: Path, found: StadimeterError | None) -> None:
        self._left[path] -= 1
        if found is not None:
            self._lost[path] = found
        count = len(self._plans[path].windows)
        done = count - self._left[path]
        self._report(Progress(path.name, "measure", 0, done / count))
        if self._left[path]:
            return
        if path in self._lost:
            self._finished(path, self._lost[path])
        else:
            self._engine.submit(path, join, path, self._run, self._plans[path])

    def _finished(self, path: Path, found: Manifest | StadimeterError) -> None:
        if isinstance(found, StadimeterError):
            self._result.failed.append(Finished(path, error=found))
            return
        if found.failure is not None:
            error = StadimeterError(found.failure.rstrip("."))
            self._result.failed.append(Finished(path, found, error))
            return
        self._result.made.append(Finished(path, found))
        self._report(Progress(path.name, "done", found.frame_count, 1.0))
