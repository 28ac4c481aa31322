"""Tasks: a recording, one window of a long one, or the joining of windows.

Each is a plain function, so that any engine can run it anywhere that sees the recordings and the folder.
It may be begun again at any moment: its files have new names, or are replaced whole, and its result
counts from the moment when its manifest is there.
"""

from __future__ import annotations

import hashlib
import json
import shutil
import tempfile
import uuid
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path

from pipeline import __version__
from pipeline.cluster.manifest import (
    Manifest,
    Source,
    key_of_failure,
    new_parts_folder,
    write_manifest,
)
from pipeline.cluster.results_folder import export
from pipeline.core.config import Config
from pipeline.core.errors import StadimeterError
from pipeline.core.timing import StageTimes
from pipeline.run.pass_one import measure_recording
from pipeline.run.recording import add_failure, attempt, named, stored_alone
from pipeline.run.windows.split import Plan, Window, WindowFile, plan_windows
from pipeline.run.windows.stitch import refused_pictures, stitch, summed_row
from pipeline.store.database import Store
from pipeline.store.recordings import RecordingRow
from pipeline.store.runs import finish_run
from pipeline.store.scratch import Begun, own_store

_DONE = "window.json"


@dataclass(frozen=True, slots=True)
class Run:
    """Facts that all tasks of a run share."""

    folder: Path
    config: Config
    begun: Begun
    window_s: float

    @property
    def configuration_sha256(self) -> str:
        """Hash of the configuration, which tells whether a finished recording can stay."""
        return hashlib.sha256(self.begun.configuration.encode()).hexdigest()

    @property
    def answer_key(self) -> str:
        """A short name of configuration and version, for folders of unfinished work."""
        text = f"{self.configuration_sha256} {__version__} {self.window_s}"
        return hashlib.sha256(text.encode()).hexdigest()[:12]


def work(path: Path, run: Run) -> Manifest | Plan:
    """Measure and estimate a recording, or return its windows if it is long."""
    found = attempt(path, _plan_or_whole, path, run)
    return _failed(path, run, found) if isinstance(found, StadimeterError) else found


def _plan_or_whole(path: Path, run: Run) -> Manifest | Plan:
    plan = plan_windows(path, run.config, run.window_s)
    if plan is not None:
        return plan
    source = Source.of(path)
    with tempfile.TemporaryDirectory(prefix="stadimeter-") as name:
        row = measure_recording(path, run.config, Path(name), threads=1)
        return _finish(row, source, Path(name), run)


def window_folder(plan: Plan, window: Window, run: Run) -> Path:
    """Return the folder of a window's parts, until the recording is whole."""
    key = f"{plan.content_sha256[:16]}-{run.answer_key}"
    return run.folder / "work" / key / f"{window.number:04d}"


def work_window(path: Path, run: Run, plan: Plan, window: Window) -> StadimeterError | None:
    """Measure one window of a recording, unless that is done; return the error, if any."""
    target = window_folder(plan, window, run)
    if (target / _DONE).is_file():
        return None
    part = target.with_name(f".{target.name}.{uuid.uuid4().hex[:8]}")
    try:
        return attempt(path, _measure_window, path, run, plan, window, part)
    finally:
        shutil.rmtree(part, ignore_errors=True)


def _measure_window(path: Path, run: Run, plan: Plan, window: Window, part: Path) -> None:
    opened = partial(WindowFile, window=window, sha256=plan.content_sha256)
    row = measure_recording(path, run.config, part, threads=1, open_file=opened)
    known = asdict(row) | {"path": str(row.path)}
    (part / _DONE).write_text(json.dumps(known), encoding="utf-8")
    target = window_folder(plan, window, run)
    if not target.exists():  # by a task that was thought to be dead
        part.rename(target)


def join(path: Path, run: Run, plan: Plan) -> Manifest:
    """Put the windows of a recording together, and estimate it."""
    found = attempt(path, _joined, path, run, plan)
    if isinstance(found, StadimeterError):
        return _failed(path, run, found)
    shutil.rmtree(window_folder(plan, plan.windows[0], run).parent, ignore_errors=True)
    return found


def _joined(path: Path, run: Run, plan: Plan) -> Manifest:
    folders = [window_folder(plan, window, run) for window in plan.windows]
    source = Source.of(path)
    rows = [_row_of(folder) for folder in folders]
    with tempfile.TemporaryDirectory(prefix="stadimeter-") as name:
        if any(map(refused_pictures, rows, folders)):
            row = measure_recording(path, run.config, Path(name), threads=1)
        else:
            stitch(folders, plan.windows, Path(name), run.config.track)
            row = summed_row(rows, Path(name), path)
        return _finish(row, source, Path(name), run)


def _row_of(folder: Path) -> RecordingRow:
    known = json.loads((folder / _DONE).read_text(encoding="utf-8"))
    return RecordingRow(**known | {"path": Path(known["path"])})


def _finish(row: RecordingRow, source: Source, parts: Path, run: Run) -> Manifest:
    """Store and estimate the recording, as a run into a database does, and publish it."""
    with stored_alone(row, parts, run.begun, run.config, StageTimes()) as store:
        return _publish(store, row.recording_id, source, run, row, None)


def _failed(path: Path, run: Run, error: StadimeterError) -> Manifest:
    """Leave the reason why there is nothing of a recording."""
    try:
        source = Source.of(path)
    except OSError:
        source = Source(str(path.absolute()), 0, 0)
    error = named(path, error)
    with own_store(run.begun) as store:
        add_failure(store, path, error, run.begun.run_id)
        return _publish(store, key_of_failure(source), source, run, None, str(error))


def _publish(
    store: Store,
    key: str,
    source: Source,
    run: Run,
    row: RecordingRow | None,
    failure: str | None,
) -> Manifest:
    finish_run(store, run.begun.run_id)
    target = new_parts_folder(run.folder, key)
    manifest = Manifest(
        key=key,
        source=source,
        content_sha256=row.content_sha256 if row else None,
        configuration_sha256=run.configuration_sha256,
        software_version=__version__,
        run_id=run.begun.run_id,
        frame_count=row.frame_count if row else 0,
        frames_lost=row.frames_lost if row else 0,
        damaged=row.damaged if row else False,
        failure=failure,
        parts=export(store, target, run.folder),
    )
    write_manifest(run.folder, manifest)
    return manifest
