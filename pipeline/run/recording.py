"""One recording: measured, committed with its estimates, written as timelines."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from pipeline.core.config import Config
from pipeline.core.errors import StadimeterError
from pipeline.core.progress import Progress, Report
from pipeline.core.timing import StageTimes
from pipeline.run.pass_one import measure_recording
from pipeline.run.pass_two import estimate_recording
from pipeline.store.database import Store
from pipeline.store.recordings import RecordingRow, replace_recording


@dataclass(slots=True)
class Outcome:
    """Outcome of one recording."""

    path: Path
    recording: RecordingRow | None = None
    timelines: list[Path] = field(default_factory=list)
    error: StadimeterError | None = None
    times: StageTimes = field(default_factory=StageTimes)


def measure(path: Path, config: Config, folder: Path, *, threads: int, report: Report) -> Outcome:
    """Measure a recording into the files of a folder, or say why that cannot be."""
    outcome = Outcome(path)
    try:
        outcome.recording = measure_recording(
            path, config, folder, threads=threads, report=report, times=outcome.times
        )
    except StadimeterError as error:
        outcome.error = error
    except OSError as error:
        problem = f"cannot be read: {error.strerror or error}"
        outcome.error = StadimeterError(f"{path} {problem}")
    return outcome


def commit(
    store: Store, row: RecordingRow, parts: Path, run_id: str, config: Config, times: StageTimes
) -> None:
    """Store what was measured of a recording, and its estimates, in one transaction."""
    with store.transaction():
        with times.stage("store"):
            recording_id = replace_recording(store, row, parts, run_id)
        with times.stage("estimate"):
            estimate_recording(store, recording_id, run_id, row.path.name, config)


def add_timelines(
    store: Store, outcome: Outcome, folder: Path, config: Config, report: Report
) -> None:
    """Write the Rerun recordings of a stored recording; a long one is split by time."""
    from dashboards.timeline.split import write_timelines  # heavy, and not always wanted

    recording = outcome.recording
    assert recording is not None  # noqa: S101  (narrowing)
    report(Progress(outcome.path.name, "timeline", recording.frame_count, 1.0))
    with outcome.times.stage("timeline"):
        outcome.timelines = write_timelines(
            store, recording.recording_id, outcome.path, folder, config
        )
