"""`stadimeter review`: recordings of a database on one timeline, at the moment that was asked for.

The viewer is opened on the loopback only. Without a display the timeline is written, and it is said
how to look at it from elsewhere.
"""

from __future__ import annotations

import re
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np
import pyarrow.compute as pc

from dashboards.review.moment import iso, parse_moment
from dashboards.review.viewer import LOOPBACK, WEB_PORT, free_port, no_viewer, started
from dashboards.timeline.blueprint import shared_clock
from dashboards.timeline.source import Span, read_source
from dashboards.timeline.stream import ELAPSED, TIME
from dashboards.timeline.writer import TimelineOptions, camera_views, write_timeline
from pipeline.core.config import Config
from pipeline.core.errors import UsageError, Where
from pipeline.mcap_file.bag import is_recording, size_of
from pipeline.store.database import Store
from pipeline.store.recordings import list_recordings

# Around a track its frames and a little before and after; around a moment of a long recording so much.
AROUND_TRACK_S = 2.0
AROUND_MOMENT_S = 150.0
READING_S = 20.0  # that long the viewer may take to have read up to the moment
# The viewer's server knows no passwords (Rerun 0.41); it listens on the loopback only.
REACHED_BY = "Ctrl-C ends the viewer; no other machine reaches it, but every user of this one can"
RERUN = "rerun-sdk==0.41.*"


@dataclass(frozen=True, slots=True)
class Review:
    """A request for a review: what to show, and the moment at which it opens."""

    recordings: Sequence[str]  # files, file names or ids
    at: str | None = None  # a time, seconds from the start, or #frame
    track: int | None = None
    camera: str | None = None  # of the track or frame, where there are several


@dataclass(frozen=True, slots=True)
class Written:
    """A timeline that was written, and the moment at which it opens."""

    path: Path
    clock: str
    moment_ns: int | None
    start_ns: int  # of the recording that the moment is of
    remarks: tuple[str, ...]


def write_review(store: Store, review: Review, target: Path, config: Config) -> Written:
    """Write the timeline of what is to be reviewed.

    Raises:
        UsageError: a recording, track or moment is not there.
        StadimeterError: a file cannot be read or written.
    """
    rows = [find_recording(store, name) for name in review.recordings]
    rows = list({row["recording_id"]: row for row in rows}.values())
    if len(rows) > 1 and review.track is not None:
        raise UsageError(
            "--track needs exactly one recording", remedy="Give the recording of the track"
        )
    moment_ns = None if review.at is None else _moment_ns(store, review, rows[0])
    sources, remarks = [], []
    for row in rows:
        span, remark = _span(store, review, row, moment_ns, config.timeline.split_s)
        if remark:
            remarks.append(f"{row['file_name']}: {remark}")
        file = Path(row["file"])
        sources.append(read_source(store, row["recording_id"], file, config, span))
        if review.track is not None and moment_ns is None:
            moment_ns = _middle_of_track(store, review, row)
    options = TimelineOptions(preview_px=config.timeline.preview_px, track=review.track)
    write_timeline(target, sources, options)
    clock = shared_clock(camera_views(sources, options))
    start_ns = pc.min(sources[0].tables["frames"]["capture_time_ns"]).as_py() or 0
    return Written(target, clock, moment_ns, start_ns, tuple(remarks))


def find_recording(store: Store, name: str) -> dict[str, Any]:
    """Return the row of a recording by its id, its file or its file's name, with the file to read.

    Raises:
        UsageError: there is none in the database, there are several, or its file is gone or another.
    """
    rows = list_recordings(store).to_pylist()
    given = Path(name)
    tests = (
        lambda row: row["recording_id"] == name,
        lambda row: given.exists() and _same(Path(row["path"]), given),
        lambda row: row["file_name"] == given.name,
        lambda row: Path(row["file_name"]).stem == name,
    )
    found = next((f for f in ([r for r in rows if test(r)] for test in tests) if f), [])
    if not found:
        there = ", ".join(row["file_name"] for row in rows[:10]) or "none"
        raise UsageError(
            f"no recording {name!r} is in the database; there are: {there}",
            remedy="Measure it first, with `stadimeter run`",
        )
    if len(found) > 1:
        ids = ", ".join(row["recording_id"] for row in found)
        raise UsageError(f"several recordings are called {name!r}", remedy=f"Give an id: {ids}")
    row = found[0]
    file = given if is_recording(given) else Path(row["path"])
    if not is_recording(file):
        raise UsageError(
            "cannot show pictures: there is no such file",
            where=Where(file),
            remedy="Give the path at which the recording is now",
        )
    if size_of(file) != row["size_bytes"]:
        raise UsageError(
            f"is not the file that was measured, which had {row['size_bytes']:,} bytes",
            where=Where(file),
            remedy="Measure it again with `stadimeter run`, or give the file that was measured",
        )
    return row | {"file": str(file)}


def _same(one: Path, other: Path) -> bool:
    try:
        return one.samefile(other)
    except OSError:
        return False


def _moment_ns(store: Store, review: Review, row: dict[str, Any]) -> int:
    """Return the capture time that `--at` names."""
    text = str(review.at)
    camera = _camera_clause(review)
    if re.fullmatch(r"#\d+", text):
        found = store.query(
            "SELECT capture_time_ns AS t FROM frames "  # noqa: S608
            f"WHERE recording_id = ? AND frame_index = ? {camera} ORDER BY camera LIMIT 1",
            [row["recording_id"], int(text[1:]), *_camera_value(review)],
        ).to_pylist()
        if not found:
            raise UsageError(f"{row['file_name']} has no frame {text}")
        return int(found[0]["t"])
    ends = store.query(
        "SELECT min(capture_time_ns) AS low, max(capture_time_ns) AS high FROM frames "
        "WHERE recording_id = ?",
        [row["recording_id"]],
    ).to_pylist()[0]
    if ends["low"] is None:
        raise UsageError(f"{row['file_name']} has no frames")
    moment_ns = parse_moment(text, ends["low"])
    if not ends["low"] <= moment_ns <= ends["high"]:
        raise UsageError(
            f"--at {text} is outside {row['file_name']}, which has frames from "
            f"{iso(ends['low'])} to {iso(ends['high'])}"
        )
    return moment_ns


def _span(
    store: Store, review: Review, row: dict[str, Any], moment_ns: int | None, longest_s: float
) -> tuple[Span | None, str]:
    """Return what of a recording to show: all of it, if it is not too long for a viewer."""
    start_ns, end_ns = row["start_time_ns"], row["end_time_ns"]
    if review.track is not None:
        low, high = _frames_of_track(store, review, row)
        margin_ns = round(AROUND_TRACK_S * 1e9)
        return Span(low - margin_ns, high + margin_ns), ""
    if start_ns is None or end_ns - start_ns <= longest_s * 1e9:
        return None, ""
    if moment_ns is not None:
        margin_ns = round(AROUND_MOMENT_S * 1e9)
        span = Span(moment_ns - margin_ns, moment_ns + margin_ns)
    else:
        span = Span(start_ns, start_ns + round(longest_s * 1e9))
    hours = (end_ns - start_ns) / 3.6e12
    return span, (
        f"{iso(max(span.start_ns, start_ns))} to {iso(min(span.end_ns, end_ns))} of {hours:.1f} hours; "
        "--at and --track show others, `stadimeter run --rrd` writes all"
    )


def _frames_of_track(store: Store, review: Review, row: dict[str, Any]) -> tuple[int, int]:
    found = store.query(
        "SELECT camera, min(f.log_time_ns) AS low, max(f.log_time_ns) AS high FROM observations o "  # noqa: S608
        "JOIN frames f USING (recording_id, camera, frame_index) "
        f"WHERE recording_id = ? AND o.track_id = ? {_camera_clause(review)} GROUP BY camera",
        [row["recording_id"], review.track, *_camera_value(review)],
    ).to_pylist()
    if not found:
        raise UsageError(
            f"{row['file_name']} has no track {review.track}",
            remedy="`stadimeter query --view tracks` lists them",
        )
    if len(found) > 1:
        names = ", ".join(sorted(r["camera"] for r in found))
        raise UsageError(
            f"several cameras have a track {review.track}: {names}", remedy="Name one with --camera"
        )
    return int(found[0]["low"]), int(found[0]["high"])


def _middle_of_track(store: Store, review: Review, row: dict[str, Any]) -> int:
    found = store.query(
        "SELECT quantile_disc(f.capture_time_ns, 0.5) AS t FROM observations o "  # noqa: S608
        "JOIN frames f USING (recording_id, camera, frame_index) "
        f"WHERE recording_id = ? AND o.track_id = ? {_camera_clause(review)}",
        [row["recording_id"], review.track, *_camera_value(review)],
    ).to_pylist()
    return int(found[0]["t"])


def _camera_clause(review: Review) -> str:
    return "" if review.camera is None else "AND camera = ?"


def _camera_value(review: Review) -> list[str]:
    return [] if review.camera is None else [review.camera]


def open_review(
    written: Written,
    say: Callable[[str], None],
    *,
    browser: bool = False,
    headless: bool = False,
) -> None:
    """Open a viewer on a timeline, go to its moment, and wait until the viewer is closed.

    Args:
        written: the timeline.
        say: is told what the user must know.
        browser: serve it to a browser instead of opening a window.
        headless: open no window; for tests.

    Raises:
        StadimeterError: the viewer does not start.
    """
    options = ["--hide-welcome-screen", *(["--headless"] if headless else [])]
    web_port = free_port(WEB_PORT)
    if browser:
        options = ["--serve-web", "--web-viewer-port", str(web_port)]
    with started(written.path, options) as running:
        if browser:
            proxy = quote(f"rerun+http://{LOOPBACK}:{running.port}/proxy", safe="")
            say(f"open      http://{LOOPBACK}:{web_port}?url={proxy}")
            tunnels = " ".join(f"-L {p}:{LOOPBACK}:{p}" for p in (web_port, running.port))
            say(f"          from another machine first: ssh {tunnels} HOST")
        else:
            go_to_moment(running.client(), written)
        say(f"          {REACHED_BY}")
        with suppress(KeyboardInterrupt):
            if running.process.wait() > 0:
                running.client()  # raises, and says why it ended


def go_to_moment(client: Any, written: Written) -> None:
    """Move the viewer to the requested moment; the viewer first needs time to read the file up to it."""
    if written.moment_ns is None:
        return
    if written.clock == ELAPSED:
        since_start = np.timedelta64(written.moment_ns - written.start_ns, "ns")
        moment: dict[str, Any] = {"timeline": ELAPSED, "duration": since_start}
    else:
        moment = {"timeline": TIME, "timestamp": np.datetime64(written.moment_ns, "ns")}
    deadline = time.monotonic() + READING_S
    while True:
        try:
            client.set_time(**moment, play_state="paused")
            return
        except (ConnectionError, RuntimeError):
            if time.monotonic() > deadline:
                return
            time.sleep(0.3)


def elsewhere(path: Path) -> Iterable[str]:
    """Yield the ways to see a timeline from a machine without a display, a line each."""
    yield f"copy it to a machine with a display, and there:  rerun {path.name}   (pip install {RERUN})"
    if not no_viewer():
        yield "or serve it to a browser through a tunnel:  the same command with --browser says how"


@contextmanager
def place_for(output: Path | None) -> Iterator[Path]:
    """Give the file to write: the requested one, or a temporary one that is deleted afterwards."""
    if output is not None:
        yield output
        return
    with tempfile.TemporaryDirectory(prefix="stadimeter-review-") as folder:
        yield Path(folder) / "review.rrd"
