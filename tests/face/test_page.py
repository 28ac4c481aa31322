"""The page on Python: its examples run, from top to bottom."""

from __future__ import annotations

import inspect
import re
from pathlib import Path

import pytest

import stadimeter

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "python.md"


def blocks(page: Path) -> list[str]:
    """Return the Python examples of a page, with their lines where the page has them."""
    text = page.read_text(encoding="utf-8")
    found = re.finditer(r"^```python\n(.*?)^```$", text, re.DOTALL | re.MULTILINE)
    return ["\n" * text.count("\n", 0, m.start(1)) + m.group(1) for m in found]


def run(page: Path, monkeypatch: pytest.MonkeyPatch, folder: Path) -> dict[str, object]:
    """Run the examples of a page in one namespace, as a notebook does."""
    (folder / "recordings").symlink_to(ROOT / "recordings")
    monkeypatch.chdir(folder)
    names: dict[str, object] = {}
    for block in blocks(page):
        exec(compile(block, str(page), "exec"), names)  # noqa: S102  (our own page)
    return names


@pytest.mark.slow
def test_the_page_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    names = run(PAGE, monkeypatch, tmp_path)
    printed = capsys.readouterr().out
    assert "200 frames" in printed
    assert "tilt_deg" in printed  # the setting that the page shows to be refused
    assert len(names["frame"]) == names["table"].num_rows > 5  # type: ignore[attr-defined]
    assert 1.4 < names["frame"]["height_m"].median() < 2.0  # type: ignore[index]
    assert {p.name for p in tmp_path.iterdir()} >= {"street.duckdb", "staff.toml", "annotated.mcap"}


def test_every_function_is_on_the_page() -> None:
    text = PAGE.read_text(encoding="utf-8")
    functions = [n for n in stadimeter.__all__ if inspect.isfunction(getattr(stadimeter, n))]
    shown = {n for n in functions if f"`{n}`" in text or f"stadimeter.{n}(" in text}
    assert set(functions) - shown == {"load_config"}  # the README's camera file does the same
