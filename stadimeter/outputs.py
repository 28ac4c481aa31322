"""Results for people and other programs: annotated recordings, reports and timelines."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from pipeline.core.errors import UsageError
from stadimeter.arguments import (
    Camera,
    OnProgress,
    PathLike,
    config_of,
    paths_of,
    recordings_in,
    report_of,
    with_timelines,
)

if TYPE_CHECKING:
    from pipeline.export.recording import Exported


class Reviewed(NamedTuple):
    """A timeline that was shown or written."""

    path: Path | None  # None if it was shown
    remarks: tuple[str, ...]  # on what is shown of long recordings
    hindrance: str = ""  # reason why it could not be shown; empty if it was, or was not to be
    hints: tuple[str, ...] = ()  # ways to look at it from elsewhere, if it could not be shown


def export(
    recording: PathLike,
    db: PathLike,
    output: PathLike,
    *,
    camera: Camera = None,
    progress: OnProgress = None,
) -> Exported:
    """Write a copy of a measured recording with its boxes, objects and estimates added.

    Args:
        recording: MCAP file that was measured.
        db: database with its results.
        output: MCAP file to write; it appears when it is complete.
        camera: camera file, or a `Config`, whose `limits` bound what is read; None takes defaults.
        progress: called with a `Progress` while the work goes on.

    Returns:
        Number of original messages, frames and objects; `notes` says what of the original was lost.

    Raises:
        UsageError: the recording is not in the database, or would be overwritten.
        StadimeterError: it cannot be read or written.
    """
    from pipeline.export.recording import export_recording

    limits = config_of(camera).limits
    return export_recording(Path(recording), Path(db), Path(output), limits, report_of(progress))


def report(db: PathLike, output: PathLike) -> Path:
    """Write accuracy, heights and diagnostics of a database as one HTML file; return its path.

    Raises:
        StoreError: the database cannot be read.
        MissingLibrary: the extra `report` is not installed.
        StadimeterError: the file cannot be written.
    """
    from dashboards.report.writer import write_report
    from stadimeter.advice import advice_for

    write_report(Path(db), Path(output), advice_for)
    return Path(output)


def review(
    recordings: PathLike | Iterable[PathLike],
    db: PathLike,
    *,
    output: PathLike | None = None,
    at: str | None = None,
    track: int | None = None,
    track_camera: str | None = None,
    browser: bool = False,
    preview_px: int | None = None,
    say: Callable[[str], None] = print,
) -> Reviewed:
    """Show measured recordings on a Rerun timeline, or write it; several share one clock.

    A window or browser is waited for until it is closed. Where none can be opened, the timeline is
    written to `RECORDING.review.rrd` in the current folder.

    Args:
        recordings: files, bags, folders or patterns of them, file names, or ids of recordings in the
            database.
        db: database with their results.
        output: Rerun file to write; None shows it.
        at: moment at which it opens: ISO 8601, seconds from the start, or `#frame`.
        track: id of the track to show.
        track_camera: name of the camera of `track` or of `#frame`.
        browser: serve it to a browser, on this machine only.
        preview_px: longer side of the pictures, in pixels; None keeps them as recorded.
        say: called with lines for the user while a viewer is open.

    Raises:
        UsageError: a recording, track or moment is not there.
        StoreError: the database cannot be read.
        StadimeterError: a file cannot be read or written, or the viewer does not start.
    """
    from dashboards.review.review import Review, elsewhere, open_review, place_for, write_review
    from dashboards.review.viewer import no_display, no_viewer
    from pipeline.store.database import Store

    names = [str(path) for one in paths_of(recordings) for path in _files_or_name(one)]
    config = with_timelines(config_of(None), preview_px)
    hindrance = ""
    target = None if output is None else Path(output)
    if target is None:
        hindrance = no_viewer() if browser else no_display()
        if hindrance:
            target = Path(f"{Path(names[0]).stem}.review.rrd")
    with place_for(target) as place:
        with Store.open_current(Path(db)) as store:
            asked = Review(names, at, track, track_camera)
            written = write_review(store, asked, place, config)
        if target is None:
            for remark in written.remarks:
                say(f"shown     {remark}")
            open_review(written, say, browser=browser)
    hints = tuple(elsewhere(target)) if target is not None and hindrance else ()
    return Reviewed(target, written.remarks, hindrance, hints)


def _files_or_name(given: Path) -> list[Path]:
    """Return the recordings of a folder or pattern; what is none may be a name in the database."""
    try:
        return recordings_in(given)
    except UsageError:
        return [given]
