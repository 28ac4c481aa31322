"""The paper's rows as test cases, from the tables that come with the recordings."""

from __future__ import annotations

import csv
from pathlib import Path

PAPER = Path(__file__).resolve().parents[2] / "recordings" / "paper"


def rows(name: str) -> list[dict[str, str]]:
    with (PAPER / f"{name}.csv").open(encoding="utf-8", newline="") as lines:
        return list(csv.DictReader(lines))


DEPTH_ROWS = rows("depth_tables_3_to_7")
HEIGHT_ROWS = rows("height_tables_9_10")
CONSISTENT_HEIGHTS = [r for r in HEIGHT_ROWS if not r["erratum"]]
FOCAL_LENGTH_MM, PIXEL_PITCH_UM = 50.0, 3.9


def row_id(row: dict[str, str]) -> str:
    return f"table{row.get('paper_table', '9-10')}-row{row['row']}"
