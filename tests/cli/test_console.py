"""Output for people: wide tables on a narrow terminal, and in a log."""

import pyarrow as pa
import pytest
from rich.console import Console

from pipeline.cli import console

WIDE = pa.table({f"a_long_name_{i}": [i / 7, 1.0] for i in range(20)})
LONG = pa.table({f"a_long_name_{i}": [i / 7] * 30 for i in range(20)})


def printed(monkeypatch: pytest.MonkeyPatch, table: pa.Table, *, terminal: bool) -> str:
    if terminal:
        screen = Console(width=100, force_terminal=True, highlight=False, record=True)
        monkeypatch.setattr(console, "out", screen)
    else:
        screen = Console(width=10_000, record=True)
        monkeypatch.setattr(console, "_log_tables", screen)
    console.print_table(table)
    return screen.export_text()


def test_columns_that_do_not_fit_a_terminal_are_named_and_none_is_squeezed(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    text = printed(monkeypatch, LONG, terminal=True)
    assert "…" not in text
    assert max(map(len, text.splitlines())) <= 100
    assert "14 more columns do not fit" in text
    for name in LONG.column_names:
        assert name in text


def test_few_rows_that_are_too_wide_are_blocks_of_lines(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    lines = printed(monkeypatch, WIDE, terminal=True).splitlines()
    assert lines[0] == "row 1"
    assert lines[2].split() == ["a_long_name_1", "0.1429"]
    assert lines[21] == "row 2"
    assert len(lines) == 42


def test_a_log_has_every_column_whole(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    lines = printed(monkeypatch, WIDE, terminal=False).splitlines()
    assert all(name in lines[1] for name in WIDE.column_names)
    assert "0.1429" in lines[3]
    assert "more columns" not in "".join(lines)


def test_one_column_wider_than_the_terminal_is_still_shown(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    text = printed(monkeypatch, pa.table({"comment": ["word " * 60]}), terminal=True)
    assert text.count("word") == 60
