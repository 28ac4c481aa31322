"""Output to a terminal: tables, progress and messages, with text from files made safe."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING

from rich.cells import cell_len
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from pipeline.core.progress import Progress, Report, silent

if TYPE_CHECKING:
    import pyarrow as pa
    from rich.progress import Progress as Bars
    from rich.progress import TaskID

PLAIN_LINE_EVERY_S = 5.0  # where there is no terminal, such as in a log

LOG_WIDTH = 120  # of prose in a log; a table there is as wide as its columns
FEW_RECORDS = 20  # rows that are printed as blocks where they are too wide
TEXT_WIDTH = 80  # longer text in a table is folded
CELL_FRAME = 3  # a border and a space on either side

# The shell's `>&-`: what would be printed goes nowhere, and `main` says so.
stdout_is_closed = sys.stdout is None
if sys.stdout is None:
    sys.stdout = open(os.devnull, "w")  # noqa: PTH123, SIM115  (kept while the process lives)
if sys.stderr is None:
    sys.stderr = open(os.devnull, "w")  # noqa: PTH123, SIM115
out = Console(highlight=False, width=None if sys.stdout.isatty() else LOG_WIDTH)
err = Console(stderr=True, highlight=False)
_log_tables = Console(highlight=False, width=10_000)


def safe(text: object) -> str:
    """Return text from a file with control characters made visible and markup disarmed."""
    one_line = " ".join(str(text).split("\n"))
    shown = "".join(c if c.isprintable() else repr(c)[1:-1] for c in one_line)
    return escape(shown)


def print_table(
    table: pa.Table,
    *,
    title: str | None = None,
    max_rows: int | None = None,
    records: bool | None = None,
) -> None:
    """Print a result with its columns as they are named in the database.

    Args:
        table: the result.
        title: printed above it.
        max_rows: more are counted only.
        records: True prints a block of lines for each row, False a grid. None decides: on a terminal
            rows that do not fit side by side are blocks if they are few; of many the columns that do not
            fit are left out, and named below. A log gets all columns.
    """
    import pyarrow as pa

    shown = table if max_rows is None else table.slice(0, max_rows)
    names = [safe(name) for name in shown.column_names]
    cells = [[_cell(value) for value in column.to_pylist()] for column in shown.columns]
    fitting = _fitting(names, cells, out.width) if out.is_terminal else len(names)
    if records is None:
        records = fitting < len(names) and shown.num_rows <= FEW_RECORDS
    if records:
        _print_records(names, cells)
        return
    grid = Table(title=safe(title) if title else None, title_justify="left", header_style="bold")
    for name, schema_field in zip(names[:fitting], shown.schema, strict=False):
        numeric = pa.types.is_floating(schema_field.type) or pa.types.is_integer(schema_field.type)
        _add_column(grid, name, numeric=numeric)
    for row in zip(*cells[:fitting], strict=True):
        grid.add_row(*row)
    _print_grid(grid)
    if shown.num_rows < table.num_rows:
        out.print(f"... {table.num_rows - shown.num_rows:,} more rows")
    if fitting < len(names):
        hidden = len(names) - fitting
        out.print(f"{hidden} more columns do not fit here; --csv, --json and --parquet have all.")
        out.print(f"For a SELECT: {', '.join(names[fitting:])}")


def _print_records(names: Sequence[str], cells: Sequence[Sequence[str]]) -> None:
    """Print a block of lines for each row: a name and its value a line, none for NULL."""
    widest = max(map(cell_len, names), default=0)
    for number, row in enumerate(zip(*cells, strict=True), start=1):
        out.print(f"[bold]row {number}[/bold]")
        for name, value in zip(names, row, strict=True):
            if value:
                out.print(f"  {name:<{widest}}  {value}", markup=False, soft_wrap=True)


def _fitting(names: Sequence[str], cells: Sequence[Sequence[str]], width: int) -> int:
    """Return how many columns, from the left and at least one, fit side by side."""
    used = 1
    for count, (name, column) in enumerate(zip(names, cells, strict=True)):
        widest = max(map(cell_len, (name, *column)))
        used += min(widest, TEXT_WIDTH) + CELL_FRAME
        if used > width:
            return max(count, 1)
    return len(names)


def _add_column(grid: Table, name: str, *, numeric: bool) -> None:
    if numeric:
        grid.add_column(name, justify="right", no_wrap=True)
    else:
        grid.add_column(name, max_width=TEXT_WIDTH, overflow="fold")


def _print_grid(grid: Table) -> None:
    (out if out.is_terminal else _log_tables).print(grid, crop=False)


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
    _print_grid(grid)


def _is_number(value: object) -> bool:
    text = str(value).replace("±", "").replace(" ", "").replace(",", "")
    return text == "" or text.lstrip("-")[:1].isdigit()


@contextmanager
def progress_lines(*, quiet: bool = False) -> Iterator[Report]:
    """Show how far each recording is: bars on a terminal, plain lines elsewhere, nothing if quiet."""
    if quiet:
        yield silent
        return
    if not err.is_terminal:
        yield _PlainLines()
        return
    from rich.progress import (
        BarColumn,
        SpinnerColumn,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )
    from rich.progress import Progress as Bars

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


def _doing(progress: Progress) -> str:
    """Return what is being done, and what of it takes longest: "measure (mostly decode)"."""
    return f"{progress.stage} (mostly {progress.slowest})" if progress.slowest else progress.stage


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
            description=f"{safe(name)}: {_doing(progress)}",
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
        line = f"{safe(progress.file_name)}: {_doing(progress)}, {progress.frames:,} frames"
        elapsed_s = now - started
        if elapsed_s > 1.0:
            line += f", {progress.frames / elapsed_s:,.0f}/s"
        if elapsed_s > 1.0 and 0.0 < progress.fraction < 1.0:
            line += f", about {elapsed_s * (1 / progress.fraction - 1):.0f} s left"
        print(line, file=sys.stderr, flush=True)
