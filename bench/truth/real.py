"""Errors and coverage of depths and heights on recordings that hold boxes and truth.

    python -m bench.truth.real FOLDER [CAMERA_FILE]

FOLDER has recordings (.mcap) with truth; each is run by itself with the defaults, or a camera file.
Printed are depth by method, heights of tracks, and differences of heights (`height_difference`).
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

from pipeline.cli.console import out, print_rows
from pipeline.core.config import load_config
from pipeline.run.recordings import run
from pipeline.store.database import Store

_DEPTHS = """
SELECT method, count(*) AS n, avg(abs(e.depth_m / m.true_depth_m - 1)) AS error,
    avg(e.depth_m / m.true_depth_m - 1) AS bias,
    avg((m.true_depth_m BETWEEN e.depth_low_m AND e.depth_high_m)::INTEGER) AS held
FROM current_estimates AS e JOIN matches AS m USING (recording_id, observation_index)
WHERE m.true_depth_m > 0 GROUP BY method ORDER BY method
"""
_TRUE = """
WITH t AS (
    SELECT track_id, median(true_height_m) AS true_m FROM matches GROUP BY track_id
    HAVING count(true_height_m) >= 10
)
"""
_HEIGHTS = f"""{_TRUE}
SELECT count(*) AS n, avg((height_high_m - height_low_m) / 2) AS half,
    avg(abs(height_m - true_m)) AS error,
    avg((true_m BETWEEN height_low_m AND height_high_m)::INTEGER) AS held
FROM people JOIN t USING (track_id)
"""
_DIFFERENCES = f"""{_TRUE}, d AS (
    SELECT height_difference(a, b) AS found, s.true_m - t.true_m AS true_m
    FROM people AS a JOIN people AS b USING (recording_id, camera)
    JOIN t AS s ON s.track_id = a.track_id JOIN t ON t.track_id = b.track_id
    WHERE a.track_id < b.track_id
)
SELECT count(*) AS n, avg((found.high_m - found.low_m) / 2) AS half,
    avg(abs(found.value_m - true_m)) AS error,
    avg((true_m BETWEEN found.low_m AND found.high_m)::INTEGER) AS held
FROM d
"""


def main(folder: Path, camera_file: Path | None = None) -> None:
    """Run every recording of a folder, and print how far off it is and how often its intervals hold."""
    rows = []
    for recording in sorted(folder.glob("*.mcap")):
        with tempfile.TemporaryDirectory(prefix="stadimeter-real-") as place:
            database = Path(place) / "real.duckdb"
            run([recording], database, load_config(camera_file))
            with Store.open(database, read_only=True) as store:
                for found in store.query(_DEPTHS).to_pylist():
                    cells = (found["n"], 100 * found["error"], 100 * found["held"])
                    rows.append([recording.stem, f"depth, {found['method']}", "%", *_text(*cells)])
                for name, query in (("height", _HEIGHTS), ("difference", _DIFFERENCES)):
                    (found,) = store.query(query).to_pylist()
                    if found["n"]:
                        cells = (found["n"], 100 * found["error"], 100 * found["held"])
                        half = f", half {100 * found['half']:.1f}"
                        rows.append([recording.stem, name + half, "cm", *_text(*cells)])
    header = ("recording", "of", "unit", "count", "mean error", "in 95 % interval, %")
    print_rows("Recordings with truth", header, rows)
    if not rows:
        out.print(f"no recording with truth in {folder}")


def _text(count: int, error: float, held: float) -> list[str]:
    return [f"{count:,}", f"{error:.1f}", f"{held:.0f}"]


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:3]))
