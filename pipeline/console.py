"""What a person sees on a terminal: tables, progress and messages, with text from files made safe."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import pyarrow as pa
from rich.console import Console
from rich.markup import escape
from rich.progress import (
    BarColumn,
    SpinnerColumn,
    TaskID,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.progress import (
    Progress as Bars,
)
from rich.table import Table

from pipeline.progress import Progress, Report

PLAIN_LINE_EVERY_S = 5.0  # where there is no terminal, such as in a log

# A table that a program or a log reads must not be cut to eighty columns.
WIDTH = None if sys.stdout.isatty() else 400

out = Console(highlight=False, width=WIDTH)
err = Console(stderr=True, highlight=False)


def safe(text: object) -> str:
    """Return text from a file with control characters made visible and markup disarmed."""
    one_line = " ".join(str(text).split("\n"))
    shown = "".join(c if c.isprintable() else repr(c)[1:-1] for c in one_line)
    return escape(shown)


def print_table(table: pa.Table, *, title: str | None = None, max_rows: int | None = None) -> None:
    """Print a result with its columns as they are named in the database."""
    shown = table if max_rows is None else table.slice(0, max_rows)
    grid = Table(title=safe(title) if title else None, title_justify="left", header_style="bold")
    for schema_field in shown.schema:
        numeric = pa.types.is_floating(schema_field.type) or pa.types.is_integer(schema_field.type)
        grid.add_column(safe(schema_field.name), justify="right" if numeric else "left")
    columns = [column.to_pylist() for column in shown.columns]
    for row in zip(*columns, strict=True):
        grid.add_row(*(_cell(value) for value in row))
    out.print(grid, crop=False)
    if shown.num_rows < table.num_rows:
        out.print(f"... {table.num_rows - shown.num_rows:,} more rows")


def _cell(value: object) -> str:
    if value is None:
        return ""
    if isinstance(value, float):
        return f"{value:.4g}" if abs(value) < 1e5 else f"{value:,.0f}"
    return safe(value)


def print_rows(title: str, header: Sequence[str], rows: Sequence[Sequence[object]]) -> None:
    """Print a small table of rows that are text already; numbers are right-aligned."""
    grid = Table(title=title, title_justify="left", header_style="bold")
    for index, name in enumerate(header):
        numeric = bool(rows) and all(_is_number(row[index]) for row in rows)
        grid.add_column(name, justify="right" if numeric else "left", no_wrap=True)
    for row in rows:
        grid.add_row(*(safe(value) for value in row))
    out.print(grid, crop=False)


def _is_number(value: object) -> bool:
    text = str(value).replace("±", "").replace(" ", "").replace(",", "")
    return text == "" or text.lstrip("-")[:1].isdigit()


@contextmanager
def progress_lines() -> Iterator[Report]:
    """Show how far each recording is: bars on a terminal, plain lines elsewhere."""
    if not err.is_terminal:
        yield _PlainLines()
        return
    columns = (
        SpinnerColumn(),
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.fields[frames]:,} frames  {task.fields[rate]:,.0f}/s"),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
    )
    with Bars(*columns, console=err, transient=True) as bars:
        yield _Bars(bars)


class _Bars:
    def __init__(self, bars: Bars) -> None:
        self._bars = bars
        self._tasks: dict[str, tuple[TaskID, float]] = {}

    def __call__(self, progress: Progress) -> None:
        name = progress.file_name
        if name not in self._tasks:
            task = self._bars.add_task(safe(name), total=1.0, frames=0, rate=0.0)
            self._tasks[name] = (task, time.monotonic())
        task, started = self._tasks[name]
        rate = progress.frames / max(time.monotonic() - started, 1e-3)
        self._bars.update(
            task,
            completed=progress.fraction,
            description=f"{safe(name)}: {progress.stage}",
            frames=progress.frames,
            rate=rate,
        )


class _PlainLines:
    """A line where a recording's stage changes, and every few seconds between."""

    def __init__(self) -> None:
        self._last: dict[str, tuple[str, float]] = {}
        self._started: dict[str, float] = {}

    def __call__(self, progress: Progress) -> None:
        now = time.monotonic()
        started = self._started.setdefault(progress.file_name, now)
        stage, last = self._last.get(progress.file_name, ("", now))
        if stage == progress.stage and now - last < PLAIN_LINE_EVERY_S:
            return
        self._last[progress.file_name] = (progress.stage, now)
        line = f"{safe(progress.file_name)}: {progress.stage}, {progress.frames:,} frames"
        elapsed_s = now - started
        if elapsed_s > 1.0:
            line += f", {progress.frames / elapsed_s:,.0f}/s"
        if elapsed_s > 1.0 and 0.0 < progress.fraction < 1.0:
            line += f", about {elapsed_s * (1 / progress.fraction - 1):.0f} s left"
        print(line, file=sys.stderr, flush=True)
