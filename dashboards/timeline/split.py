"""A timeline for each stretch of a recording: a day is a file an hour, which a viewer can hold."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from dashboards.timeline.source import Span, read_source
from dashboards.timeline.writer import TimelineOptions, write_timeline
from pipeline.core.config import Config
from pipeline.core.text import storable
from pipeline.store.database import Store


def write_timelines(
    store: Store, recording_id: str, file: Path, folder: Path, config: Config
) -> list[Path]:
    """Write the timelines of a recording: one, or one a stretch of `config.timeline.split_s`.

    Raises:
        StadimeterError: a file cannot be written.
    """
    options = TimelineOptions(preview_px=config.timeline.preview_px)
    stem = storable(file.stem)
    spans = list(spans_of(store, recording_id, config.timeline.split_s))
    if len(spans) <= 1:
        target = folder / f"{stem}.rrd"
        write_timeline(target, [read_source(store, recording_id, file, config)], options)
        return [target]
    written = []
    for number, span in enumerate(spans, start=1):
        target = folder / f"{stem}.{number:03d}.rrd"
        source = read_source(store, recording_id, file, config, span)
        write_timeline(target, [source], options)
        written.append(target)
    return written


def spans_of(store: Store, recording_id: str, split_s: float) -> Iterator[Span]:
    """Yield the stretches of a recording in which there are frames, none longer than `split_s`."""
    split_ns = max(round(split_s * 1e9), 1)
    found = store.query(
        """
        WITH ends AS (
            SELECT min(log_time_ns) AS start_ns FROM frames WHERE recording_id = ?
        )
        SELECT DISTINCT start_ns, (log_time_ns - start_ns) // ?::BIGINT AS part
        FROM frames, ends WHERE recording_id = ? ORDER BY part
        """,
        [recording_id, split_ns, recording_id],
    )
    for row in found.to_pylist():
        start_ns = row["start_ns"] + row["part"] * split_ns
        yield Span(start_ns, start_ns + split_ns - 1)
