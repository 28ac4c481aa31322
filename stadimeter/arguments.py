"""Arguments that several functions take: paths, a camera file or configuration, progress."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path
from typing import TypeAlias

from pipeline.core import config as configuration
from pipeline.core.config import Config, TimelineConfig, refuse_impossible_settings
from pipeline.core.errors import UsageError
from pipeline.core.progress import Progress, Report, silent
from pipeline.run.recording_paths import recordings_of

PathLike: TypeAlias = str | os.PathLike[str]
Camera: TypeAlias = Config | PathLike | None
OnProgress: TypeAlias = Callable[[Progress], None] | None

MIN_PREVIEW_PX = 16


def paths_of(given: PathLike | Iterable[PathLike]) -> list[Path]:
    """Return one path or several as a list."""
    if isinstance(given, str | os.PathLike):
        return [Path(given)]
    return [Path(one) for one in given]


def recordings_in(given: PathLike | Iterable[PathLike]) -> list[Path]:
    """Return the recordings that are named: files, bags, and those in folders or of patterns.

    Raises:
        UsageError: a folder holds no recording, or a pattern fits nothing.
    """
    return recordings_of(paths_of(given))


def config_of(camera: Camera) -> Config:
    """Return a configuration: one that is given, that of a camera file, or the defaults.

    Raises:
        UsageError: the file cannot be read, or a setting is unknown or impossible.
    """
    if isinstance(camera, Config):
        refuse_impossible_settings(camera)
        return camera
    return Config() if camera is None else load_config(camera)


def load_config(camera_file: PathLike) -> Config:
    """Return the configuration of a camera file.

    Raises:
        UsageError: the file cannot be read, or a setting is unknown or impossible.
    """
    return configuration.load_config(Path(camera_file))


def report_of(progress: OnProgress) -> Report:
    """Return what is told of progress; nobody, if None is given."""
    return silent if progress is None else progress


def counter_of(progress: OnProgress, name: str) -> Callable[[int], None]:
    """Return a function that tells how many pictures of a file are imported."""
    report = report_of(progress)
    return lambda count: report(Progress(name, "import", count, 0.0))


def with_timelines(
    config: Config, preview_px: int | None = None, split_minutes: float | None = None
) -> Config:
    """Return a configuration in which given options of timelines override the camera file's.

    Raises:
        UsageError: the preview has fewer than 16 pixels, or the minutes are not above 0.
    """
    timeline: TimelineConfig = config.timeline
    if preview_px is not None:
        if preview_px < MIN_PREVIEW_PX:
            raise UsageError(f"a preview needs at least {MIN_PREVIEW_PX} pixels")
        timeline = replace(timeline, preview_px=preview_px)
    if split_minutes is not None:
        if not split_minutes > 0:
            raise UsageError("the length of a timeline must be above 0 minutes")
        timeline = replace(timeline, split_s=60 * split_minutes)
    return replace(config, timeline=timeline)
