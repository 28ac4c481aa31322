"""`stadimeter demo`: the main job on the recordings that come with the source, told from end to end."""

from __future__ import annotations

import csv
import math
from pathlib import Path

from pipeline.config import load_config
from pipeline.console import out, print_rows, progress_lines, safe
from pipeline.errors import UsageError, Where
from pipeline.run import Outcome, run
from pipeline.store.database import Store
from pipeline.summary import print_run, print_tracks

SOURCE_RECORDINGS = Path(__file__).resolve().parents[1] / "recordings"


def demo(
    recordings: Path | None, folder: Path
) -> tuple[list[Outcome], list[Outcome], list[Outcome]]:
    """Run on all recordings of a folder, print what came of it; return stored, failed, damaged.

    Raises:
        UsageError: there are no recordings.
    """
    source = recordings or SOURCE_RECORDINGS
    paths = sorted(source.glob("*.mcap"))
    if not paths:
        raise UsageError(
            "no recordings here", where=Where(source), remedy="Give their folder with --recordings"
        )
    camera_file = source / "cameras.toml"
    config = load_config(camera_file if camera_file.is_file() else None)
    database = folder / "stadimeter.duckdb"
    folder.mkdir(parents=True, exist_ok=True)
    with progress_lines() as report:
        result = run(paths, database, config, timelines=folder, label="demo", report=report)
    with Store.open(database, read_only=True) as store:
        for outcome in result.stored:
            recording = outcome.recording
            assert recording is not None  # noqa: S101  (narrowing)
            recording_id = recording.recording_id
            if store.read("ground_truth", recording_id).num_rows:
                _print_accuracy(store, source)
            else:
                _print_pose(store, recording_id)
                print_tracks(store, recording_id, f"{outcome.path.name}: who walked where")
    print_run(result, database)
    out.print(f"next      stadimeter query --db {safe(database)} --view accuracy.by_aperture")
    return result.stored, result.failed, result.damaged


def _print_pose(store: Store, recording_id: str) -> None:
    for camera in store.read("cameras", recording_id).to_pylist():
        if camera["pose_source"] is None:
            continue
        out.print(
            f"camera {safe(camera['camera'])}: {camera['camera_height_m']:.2f} ± "
            f"{1.96 * camera['camera_height_std_m']:.2f} m above the ground, tilted by "
            f"{math.degrees(camera['tilt_rad']):.1f} ± "
            f"{1.96 * math.degrees(camera['tilt_std_rad']):.1f} degrees (95 %), "
            f"by {'the people who walk on it' if camera['pose_source'] == 'walkers' else 'the file'}",
            soft_wrap=True,
        )


def _print_accuracy(store: Store, source: Path) -> None:
    """Print depth error by aperture and method beside what the paper prints for the same rows."""
    found = store.query("FROM accuracy.by_aperture").to_pylist()
    ours = {
        (r["f_number"], r["method"]): r["depth_rmse_m"]
        for r in found
        if r["depth_rmse_m"] is not None
    }
    methods = sorted({method for _, method in ours})
    paper = printed_rmse_cm(source / "paper" / "depth_tables_3_to_7.csv")
    rows = [
        [f"f/{f:g}", _cm(paper.get(f)), *(_cm(_to_cm(ours.get((f, m)))) for m in methods)]
        for f in sorted({f for f, _ in ours})
    ]
    header = ("aperture", "paper, printed", *methods)
    print_rows("staff: depth RMSE in cm by aperture, 50-110 cm", header, rows)


def printed_rmse_cm(table: Path) -> dict[float, float]:
    """Return the RMSE of the depths that the paper prints, by f-number; rows with errata count."""
    if not table.is_file():
        return {}
    errors: dict[float, list[float]] = {}
    with table.open(encoding="utf-8", newline="") as lines:
        for row in csv.DictReader(lines):
            error = float(row["estimated_depth_cm"]) - float(row["actual_depth_cm"])
            errors.setdefault(float(row["f_number"]), []).append(error)
    return {f: math.sqrt(sum(e * e for e in es) / len(es)) for f, es in errors.items()}


def _to_cm(value_m: float | None) -> float | None:
    return None if value_m is None else value_m * 100


def _cm(value_cm: float | None) -> str:
    return "" if value_cm is None else f"{value_cm:.2f}"
