"""The statement as one HTML page that needs no network and no script, for the screen and for paper."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from dashboards.page import template
from dashboards.report.writer import clock, shown
from dashboards.statement.pictures import Shown
from dashboards.statement.words import LIMITS, METHOD, Point
from pipeline import __version__
from pipeline.core.errors import MissingLibrary
from pipeline.core.extras import how_to_install
from pipeline.core.files import whole_file

TEMPLATE, MARKS_TEMPLATE = "statement.html.j2", "marks.html.j2"
MOST_LISTED = 400  # rows of frames on the page

Row = Mapping[str, Any]


@dataclass(frozen=True, slots=True)
class Part:
    """One part of the uncertainty of a height."""

    name: str
    half_cm: float
    what: str


@dataclass(frozen=True, slots=True)
class Sheet:
    """All that a statement says."""

    track_id: int
    against: int | None
    file_name: str
    camera: str
    warnings: Sequence[Row]
    findings: Sequence[Row]
    height_m: float | None
    height_low_m: float | None
    height_high_m: float | None
    half_cm: float
    no_height: str
    depth_m: float
    depth_low_m: float | None
    depth_high_m: float | None
    difference: Row | None
    taller: float | None
    weight: Any
    population: tuple[float, float]
    items: Sequence[tuple[str, str]]
    pictures: Sequence[Shown]
    no_pictures: str
    budget: Sequence[Part]
    changes: Sequence[Any]
    pose_text: str
    marked: Any
    program_height_m: float | None
    chart: str
    frames: Sequence[Row]
    points: Sequence[Point]
    tables_sha256: str | None
    commands: Sequence[str]
    settings: str
    libraries: str

    @property
    def step(self) -> int:
        """Every so many frames are listed."""
        return max(1, -(-len(self.frames) // MOST_LISTED))

    @property
    def listed(self) -> int:
        """Number of frames that are listed."""
        return len(self.frames[:: self.step])


def write_statement(sheet: Sheet, target: Path) -> None:
    """Write a statement.

    Raises:
        MissingLibrary: the extra `report` is not installed.
        StadimeterError: the file cannot be written.
    """
    _write(TEMPLATE, target, {"s": sheet, "method": METHOD, "limits": LIMITS})


def write_marks_page(
    pictures: Sequence[Shown],
    boxes: Mapping[int, Sequence[float]],
    file_name: str,
    track_id: int,
    target: Path,
) -> None:
    """Write a page on which a person clicks head and feet, and saves the marks as a CSV.

    Args:
        pictures: whole ones.
        boxes: of the person in each, by number of the frame.
        file_name: of the recording.
        track_id: of the person.
        target: HTML file to write.

    Raises:
        MissingLibrary: the extra `report` is not installed.
        StadimeterError: the file cannot be written.
    """
    values = {
        "pictures": pictures,
        "boxes": boxes,
        "file_name": file_name,
        "track_id": track_id,
    }
    _write(MARKS_TEMPLATE, target, values)


def _write(name: str, target: Path, values: Mapping[str, object]) -> None:
    filters = {"shown": shown, "clock": clock, "percent": _percent, "ratio": _ratio}
    try:
        filled = template("dashboards.statement", name, filters)
    except ImportError as error:
        raise MissingLibrary(
            f"the statement needs a library that is not installed: {error.name}",
            remedy=how_to_install("report"),
        ) from error
    made_at = f"{datetime.now(UTC):%Y-%m-%d %H:%M} UTC"
    page = filled.render(made_at=made_at, version=__version__, **values)
    with whole_file(target, "the page") as part:
        part.write_text(page, encoding="utf-8")


def _percent(share: float) -> str:
    return "less than 0.1 %" if share < 0.001 else f"{100 * share:.1f} %"


def _ratio(ratio: float) -> str:
    """Return a likelihood ratio to two digits: more are not earned."""
    if ratio >= 1000:
        return "more than 1,000"
    return "less than 1/1,000" if ratio < 0.001 else f"{ratio:.2g}"
