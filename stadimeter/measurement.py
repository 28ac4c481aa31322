"""Recordings measured into a database or a shared folder, and estimated again."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Literal, NamedTuple

from pipeline.core.config import Config
from pipeline.core.errors import StadimeterError, UsageError
from stadimeter.arguments import (
    Camera,
    OnProgress,
    PathLike,
    config_of,
    paths_of,
    report_of,
    with_timelines,
)

if TYPE_CHECKING:
    from pipeline.cluster.shared_run import Finished, SharedResult
    from pipeline.run.recording import Outcome, Timelines
    from pipeline.run.recordings import RunResult


LONGEST_WINDOW_S = 86_400.0  # a day
MOST_SKIPPED = 1_000_000  # as in `pipeline.core.setting_bounds`


class DamageWarning(UserWarning):
    """Recordings were measured, but a part of them was lost to damage."""


class Estimated(NamedTuple):
    """New estimates of the stored recordings."""

    run_id: str
    recording_count: int


def measure(
    recordings: PathLike | Iterable[PathLike],
    db: PathLike,
    *,
    camera: Camera = None,
    videos: PathLike | None = None,
    detector: str | None = None,
    model: PathLike | None = None,
    model_family: str | None = None,
    every: int | None = None,
    timelines: PathLike | None = None,
    preview_px: int | None = None,
    split_minutes: float | None = None,
    workers: int | None = None,
    window_s: float = 300.0,
    label: str | None = None,
    strict: bool = True,
    progress: OnProgress = None,
) -> RunResult:
    """Measure recordings or videos, estimate depths and heights, and store both in a database.

    Of a video a recording is made first (`import_video`), unless it is there already. A recording is
    stored whole or not at all; measured again, it replaces what was stored of it.

    Args:
        recordings: MCAP files, bags (folders with a metadata.yaml), videos, folders or patterns of them.
        db: DuckDB file; it is made if it does not exist.
        camera: camera file, or a `Config`; None takes the defaults.
        videos: folder for the recordings that are made of videos; None takes that of the database.
        detector: `auto`, `recorded`, `roi`, `motion` or `onnx`; overrides the camera file.
        model: ONNX file of a network. It looks at every fifth frame, and tells which of the tracks that
            motion finds are people; with the detector `onnx` it looks at every frame, instead of motion.
        model_family: family of the network, needed if its outputs fit several.
        every: one of so many pictures of each camera is measured, the others are not decoded; None takes
            the camera file's `[ingest] every`, which is 1.
        timelines: folder for a Rerun timeline of each recording; None writes none.
        preview_px: longer side of the timelines' pictures, in pixels; None keeps them as recorded.
        split_minutes: length of a timeline, in minutes; None takes that of the camera file.
        workers: number of processes at a time; None takes as many as are worth their start, at most one
            a core. Results do not depend on it.
        window_s: length in seconds of the windows that long recordings are cut into, to be measured side
            by side; 0 cuts none, else at least a second.
        label: name of the run, to compare it with others.
        strict: raise if a recording cannot be measured, and warn of damage, after all are done.
            Otherwise look at `failed` and `damaged` of the result.
        progress: called with a `Progress` while the work goes on.

    Returns:
        What became of each recording, in the order given: `stored`, `failed` and `damaged`.

    Raises:
        UsageError: an argument or a setting is unknown or impossible.
        StoreError: the database cannot be opened or written.
        StadimeterError: with `strict`, the error of the first recording that failed.
        MissingLibrary: a library of an extra is needed and not installed.

    Warns:
        DamageWarning: with `strict`, frames were lost; the table `diagnostics` says where.
    """
    from pipeline.run.recordings import run
    from stadimeter.inputs import inputs_of

    _check_workers(workers)
    _check_window(window_s)
    config = _with_every(_with_detector(config_of(camera), detector, model, model_family), every)
    config = with_timelines(config, preview_px, split_minutes)
    folder = Path(db).parent if videos is None else Path(videos)
    inputs = inputs_of(paths_of(recordings), folder, config, report_of(progress))
    result = run(
        inputs.recordings,
        Path(db),
        config,
        timelines=None if timelines is None else _timelines(Path(timelines)),
        workers=workers,
        window_s=window_s,
        label=label,
        report=report_of(progress),
    )
    result.outcomes += inputs.failed
    result.made = inputs.made
    if strict:
        _be_strict(result.failed, result.damaged)
    return result


def measure_parts(
    recordings: PathLike | Iterable[PathLike],
    parts: PathLike,
    *,
    camera: Camera = None,
    videos: PathLike | None = None,
    detector: str | None = None,
    model: PathLike | None = None,
    model_family: str | None = None,
    every: int | None = None,
    engine: Literal["local", "ray"] = "local",
    address: str | None = None,
    workers: int | None = None,
    window_s: float = 300.0,
    label: str | None = None,
    strict: bool = True,
    progress: OnProgress = None,
) -> SharedResult:
    """Measure recordings into a folder of Parquet files, on one machine or many.

    Recordings that the folder has already are not measured again. `open` answers questions to the
    folder, and `merge` makes a database of it.

    Args:
        recordings: as in `measure`, under paths that every machine sees.
        parts: folder on storage that all machines share, under the same path on each.
        camera: as in `measure`.
        videos: folder for the recordings that are made of videos; None takes the one beside `parts`.
        detector: as in `measure`.
        model: as in `measure`.
        model_family: as in `measure`.
        every: as in `measure`.
        engine: `local`, or `ray` (needs the extra `ray`).
        address: address of a running Ray cluster; None starts one on this machine.
        workers: number of tasks at a time, if no cluster is running already; None takes one a core.
        window_s: length in seconds of the windows that long recordings are cut into; 0 cuts none, else
            at least a second.
        label: name of the run, to compare it with others.
        strict: as in `measure`.
        progress: as in `measure`.

    Returns:
        What became of each recording: `there` (before this run), `made`, `failed` and `damaged`.

    Raises:
        UsageError: an argument or a setting is unknown or impossible.
        StadimeterError: with `strict`, the error of the first recording that failed.
        MissingLibrary: Ray, or another library of an extra, is needed and not installed.

    Warns:
        DamageWarning: as in `measure`.
    """
    from pipeline.cluster.shared_run import run_shared
    from stadimeter.inputs import inputs_of

    _check_workers(workers)
    if address is not None and engine != "ray":
        raise UsageError("an address belongs to the engine ray")
    _check_window(window_s)
    config = _with_every(_with_detector(config_of(camera), detector, model, model_family), every)
    folder = Path(parts).parent if videos is None else Path(videos)
    inputs = inputs_of(paths_of(recordings), folder, config, report_of(progress))
    for one in inputs.failed:
        raise one.error or StadimeterError(f"{one.path} could not be read")
    result = run_shared(
        inputs.recordings,
        Path(parts),
        config,
        engine=engine,
        address=address,
        workers=workers,
        window_s=window_s,
        label=label,
        report=report_of(progress),
    )
    if strict:
        _be_strict(result.failed, result.damaged)
    return result


def estimate(db: PathLike, *, camera: Camera = None, label: str | None = None) -> Estimated:
    """Estimate all stored recordings anew, with other calibrations or settings; no picture is read.

    Args:
        db: database that `measure` made.
        camera: camera file, or a `Config`; None takes the defaults.
        label: name of the new run, to compare it with others.

    Raises:
        StoreError: the database does not exist, or cannot be written.
        UsageError: a setting is unknown or impossible.
    """
    from pipeline.run.recordings import estimate_again

    return Estimated(*estimate_again(Path(db), config_of(camera), label))


def _timelines(folder: Path) -> Timelines:
    from dashboards.timeline.split import write_timelines  # heavy, and not always wanted
    from pipeline.run.recording import Timelines

    return Timelines(folder, write_timelines)


def _check_workers(workers: int | None) -> None:
    if workers is not None and workers < 1:
        raise UsageError(f"the number of workers must be at least 1, not {workers}")


def _check_window(window_s: float) -> None:
    if window_s != 0 and not 1 <= window_s <= LONGEST_WINDOW_S:
        raise UsageError(
            f"windows of {window_s:g} s: it must be 0, or at least 1 and at most {LONGEST_WINDOW_S:g}"
        )


def _with_detector(
    config: Config, detector: str | None, model: PathLike | None, model_family: str | None
) -> Config:
    """Return a configuration in which given options of the detector override the camera file's."""
    from pipeline.detect import check_detector

    detect = config.detect
    if model is not None:
        if detector not in (None, "auto", "motion", "onnx"):
            raise UsageError(f"a model goes with the detectors motion and onnx, not {detector}")
        detect = replace(detect, model=str(model))
    if model_family is not None:
        detect = replace(detect, model_family=model_family)
    if detector is not None:
        detect = replace(detect, method=detector)
    check_detector(detect)  # a wrong model is refused once, before hours of footage
    return replace(config, detect=detect)


def _with_every(config: Config, every: int | None) -> Config:
    """Return a configuration in which a given choice of pictures overrides the camera file's."""
    if every is None:
        return config
    if not 1 <= every <= MOST_SKIPPED:
        raise UsageError(f"every must be at least 1 and at most {MOST_SKIPPED:,}, not {every}")
    return replace(config, ingest=replace(config.ingest, every=every))


def _be_strict(
    failed: Sequence[Outcome] | Sequence[Finished], damaged: Sequence[Outcome] | Sequence[Finished]
) -> None:
    if damaged:
        names = ", ".join(one.path.name for one in damaged)
        warnings.warn(
            f"a part of {names} was lost to damage; the table diagnostics says where",
            DamageWarning,
            stacklevel=3,
        )
    for one in failed:
        raise one.error or StadimeterError(f"{one.path} could not be measured")
