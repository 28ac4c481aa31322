"""Time that the accuracy views and the report take over ten million estimates with truth."""

from __future__ import annotations

import tempfile
import time
from pathlib import Path

import duckdb

from dashboards.report.writer import write_report
from pipeline.cli.console import out, print_rows
from pipeline.store.database import Store

RECORDINGS, PER_RECORDING = 100, 25_000
METHODS = ("aperture", "inverse", "size", "ground")
VIEWS = (
    "accuracy.by_method",
    "accuracy.by_range",
    "accuracy.by_aperture",
    "accuracy.by_camera",
    "accuracy.by_track",
    "accuracy.coverage",
    "accuracy.height_by_method",
    "accuracy.worst",
)

# A hundred recordings of two cameras: objects that move away, each seen 200 times, at four apertures;
# errors of four methods, nearly normal.
FILL = f"""
CREATE TEMP TABLE base AS
SELECT
    printf('%016x', r * 982451653 + 77) AS recording_id, i::INT AS observation_index,
    'cam' || (i % 2) AS camera, ((i // 2) % 5000)::INT AS frame_index,
    (i // 200)::INT AS track_id, 'obj' || (i // 200) AS object_id,
    if((i // 200) % 3 = 0, 'car', 'person') AS class_name,
    ((i // 2) % 5000)::BIGINT * 40000000 AS capture_time_ns,
    [1.8, 2.8, 4.0, 5.6][1 + i % 4] AS f_number,
    2 + 30 * (((i // 200) * 0.37 + r * 0.11) % 1) + 3 * ((i % 200) / 200.0) AS true_depth_m,
    1.6 + 0.2 * (((i // 200) * 0.73) % 1) AS true_height_m
FROM range({RECORDINGS}) a(r), range({PER_RECORDING}) b(i);

INSERT INTO observations BY NAME
SELECT recording_id, observation_index, camera, frame_index, track_id, object_id, class_name,
    'recorded' AS detector, 0.9 AS score,
    1.0 AS x_min_px, 2.0 AS y_min_px, 3.0 AS x_max_px, 4.0 AS y_max_px
FROM base;

INSERT INTO matches BY NAME
SELECT recording_id, camera, frame_index, observation_index, object_id, 'object_id' AS rule,
    track_id, class_name, capture_time_ns, f_number, true_depth_m, true_depth_m AS true_range_m,
    true_height_m
FROM base;

INSERT INTO recordings BY NAME
SELECT DISTINCT recording_id, recording_id AS content_sha256, recording_id || '.mcap' AS file_name,
    '' AS path, 1 AS size_bytes, 1 AS frame_count, 0 AS frames_lost, FALSE AS damaged,
    'run1' AS run_id
FROM base;

INSERT INTO runs BY NAME
SELECT 'run1' AS run_id, 'run' AS command, now() AS started_at, '0' AS software_version,
    '{{}}' AS configuration;

INSERT INTO estimates BY NAME
SELECT recording_id, 'run1' AS run_id, observation_index, method,
    true_depth_m * (1 + 0.1 * (random() + random() + random() - 1.5)) AS depth_m,
    0.05 * true_depth_m AS depth_std_m,
    true_height_m * (1 + 0.1 * (random() + random() + random() - 1.5)) AS height_m,
    0.05 * true_height_m AS height_std_m,
    FALSE AS height_assumed, TRUE AS in_calibrated_range
FROM base, (SELECT unnest({list(METHODS)}) AS method);
"""


def main() -> None:
    """Fill a database, and time each view and the report."""
    with tempfile.TemporaryDirectory(prefix="stadimeter-bench-") as folder:
        path = Path(folder) / "big.duckdb"
        Store.open(path).__exit__(None, None, None)
        with duckdb.connect(str(path)) as connection:
            connection.execute(FILL)
        size_mb = path.stat().st_size / 1e6
        rows = []
        with Store.open(path, read_only=True) as store:
            for view in VIEWS:
                start, cpu_start = time.perf_counter(), time.process_time()
                found = store.query(f"FROM {view}")
                rows.append([view, f"{found.num_rows:,}", *_since(start, cpu_start)])
        start, cpu_start = time.perf_counter(), time.process_time()
        write_report(path, Path(folder) / "report.html")
        seconds = _since(start, cpu_start)
        page_mb = (Path(folder) / "report.html").stat().st_size / 1e6
        rows.append(["the report", f"{page_mb:.1f} MB", *seconds])
        count = RECORDINGS * PER_RECORDING * len(METHODS)
        out.print(f"{count:,} estimates, database {size_mb:,.0f} MB")
        print_rows("Queries", ("view", "rows", "seconds", "CPU seconds"), rows)


def _since(start: float, cpu_start: float) -> tuple[str, str]:
    """Return the seconds that passed, and those that all cores worked: others may hold them."""
    return f"{time.perf_counter() - start:.2f}", f"{time.process_time() - cpu_start:.2f}"


if __name__ == "__main__":
    main()
