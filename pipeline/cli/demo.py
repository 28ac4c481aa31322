"""`stadimeter demo`: the main job on the recordings that come with the source, from end to end."""

from __future__ import annotations

import argparse
import csv
import math
from pathlib import Path
from typing import TYPE_CHECKING

from pipeline.cli.console import out, print_rows, progress_lines, safe
from pipeline.cli.exit_codes import code_of
from pipeline.cli.options import Commands
from pipeline.cli.run import print_run, summary_of
from pipeline.core.errors import MissingLibrary, UsageError, Where

if TYPE_CHECKING:
    from stadimeter import Config, Outcome, Results, RunResult

SOURCE_RECORDINGS = Path(__file__).resolve().parents[2] / "recordings"
# Recordings of the source. A wheel has those that are small.
RECORDINGS = ("aperture_sweep", "staff", "street", "walkers")


def add(commands: Commands) -> None:
    """Add the command and its arguments to the parser."""
    parser = commands.add_parser("demo", help="run on the recordings that come with stadimeter")
    parser.add_argument(
        "--recordings",
        type=Path,
        metavar="DIR",
        help="folder of recordings, such as `recordings` of the source (default: those installed)",
    )
    parser.add_argument("--out", type=Path, default=Path("out/demo"), metavar="DIR")
    parser.set_defaults(function=call)


def call(arguments: argparse.Namespace) -> int:
    """Run the command; return its exit code."""
    result = demo(arguments.recordings or SOURCE_RECORDINGS, arguments.out)
    return code_of(result.stored, result.failed, result.damaged)


def demo(source: Path, folder: Path) -> RunResult:
    """Measure all recordings of a folder, and print the results and how far off they are.

    Raises:
        UsageError: there are no recordings.
    """
    import stadimeter

    paths = sorted(source.glob("*.mcap"))
    if not paths:
        raise UsageError(
            "no recordings here",
            where=Where(source),
            remedy="They are in the folder `recordings` of stadimeter's source; name that folder: "
            "stadimeter demo --recordings DIR",
        )
    camera_file = source / "cameras.toml"
    config = stadimeter.load_config(camera_file) if camera_file.is_file() else stadimeter.Config()
    database = folder / "stadimeter.duckdb"
    folder.mkdir(parents=True, exist_ok=True)
    with progress_lines() as progress:
        result = stadimeter.measure(
            paths,
            database,
            camera=config,
            timelines=folder,
            label="demo",
            strict=False,
            progress=progress,
        )
    print_run(result, database, summary_of(result, database))
    with stadimeter.open(database) as results:
        for outcome in result.stored:
            _print_outcome(results, outcome, source, config)
    _write_report(database, folder / "report.html")
    out.print(f"next      stadimeter query --db {safe(database)} --view accuracy.by_aperture")
    if source == SOURCE_RECORDINGS:
        _print_missing({path.stem for path in paths})
    return result


def _print_outcome(results: Results, outcome: Outcome, source: Path, config: Config) -> None:
    recording = outcome.recording
    assert recording is not None  # noqa: S101  (narrowing)
    recording_id = recording.recording_id
    truth = results.query(
        "SELECT class_name FROM ground_truth WHERE recording_id = ?", [recording_id]
    ).arrow()
    if STAFF in truth["class_name"].to_pylist():
        _print_accuracy(results, recording_id, source)
        return
    if _print_defocus(results, recording_id, outcome.path.name):
        return
    if truth.num_rows:
        _print_true_pose(outcome.path, config)
        _print_against_truth(results, recording_id, outcome.path.name)


def _print_missing(found: set[str]) -> None:
    """Print how to get the recordings that an installed wheel lacks."""
    missing = [name for name in RECORDINGS if name not in found]
    if missing:
        out.print(
            f"more      {' and '.join(missing)}: too large for an installed stadimeter. The folder "
            "`recordings` of its source has all: stadimeter demo --recordings DIR",
            soft_wrap=True,
        )


def _write_report(database: Path, target: Path) -> None:
    import stadimeter

    try:
        stadimeter.report(database, target)
    except MissingLibrary as error:  # the rest of the demo needs no extra
        out.print(safe(error), style="yellow", soft_wrap=True)
    else:
        out.print(f"report    {safe(target)}", soft_wrap=True)


def _print_true_pose(path: Path, config: Config) -> None:
    """Print the pose that a simulated recording was made with, as its metadata say; no run reads it."""
    import stadimeter

    said = stadimeter.inspect(path, camera=config).metadata.get("true_camera")
    if said is not None:
        values = ", ".join(f"{safe(k)} = {safe(v)}" for k, v in said.items())
        out.print(f"truth     {values}", soft_wrap=True)


def _print_against_truth(results: Results, recording_id: str, title: str) -> None:
    """Print how far depths and heights of people are from the truth, by method."""
    depths = results.query(
        """
        SELECT method, count(*) AS n, median(abs(depth_error_m) / true_depth_m) AS relative,
            median(depth_error_m / true_depth_m) AS bias,
            avg((abs(depth_z) < 1.96)::INTEGER) AS inside
        FROM accuracy.errors WHERE recording_id = ? GROUP BY method ORDER BY method
        """,
        [recording_id],
    ).rows()
    heights = results.query(
        """
        SELECT method, median(abs(height_error_m)) AS off_m
        FROM accuracy.track_heights WHERE recording_id = ? GROUP BY method
        """,
        [recording_id],
    ).rows()
    off_m = {row["method"]: row["off_m"] for row in heights}
    rows = [
        [
            row["method"],
            f"{row['n']:,}",
            f"{100 * row['relative']:.1f}",
            f"{100 * row['bias']:+.1f}",
            "" if row["inside"] is None else f"{100 * row['inside']:.0f}",
            _cm(100 * off_m[row["method"]]) if row["method"] in off_m else "",
        ]
        for row in depths
    ]
    header = ("method", "estimates", "depth off %", "bias %", "in 95 % interval", "height off cm")
    print_rows(f"{title}: against the truth, medians", header, rows)


def _print_defocus(results: Results, recording_id: str, title: str) -> bool:
    """Print depths by blur beside the truth, one row an object, place and focus; False for none."""
    found = results.query(
        """
        SELECT m.object_id, m.true_depth_m, f.focus_distance_m, e.branch,
            count(*) AS frames, min(f.f_number) AS widest, max(f.f_number) AS narrowest,
            median(e.depth_m) AS depth_m, median(e.depth_std_m) AS std_m
        FROM main.current_estimates AS e
        JOIN matches AS m USING (recording_id, observation_index)
        JOIN frames AS f ON f.recording_id = m.recording_id AND f.camera = m.camera
            AND f.frame_index = m.frame_index
        WHERE recording_id = ? AND e.method = 'defocus'
        GROUP BY ALL ORDER BY m.object_id, f.focus_distance_m DESC, m.true_depth_m
        """,
        [recording_id],
    ).rows()
    rows = [
        [
            row["object_id"],
            "infinity" if math.isinf(row["focus_distance_m"]) else f"{row['focus_distance_m']:g} m",
            {"near": "before", "far": "behind"}.get(row["branch"], ""),
            f"{row['frames']} at f/{row['widest']:g} to f/{row['narrowest']:g}",
            f"{row['true_depth_m']:.2f}",
            f"{row['depth_m']:.3f} ± {1.96 * row['std_m']:.3f}",
            f"{100 * (row['depth_m'] / row['true_depth_m'] - 1):+.1f}",
        ]
        for row in found
    ]
    header = ("object", "focus", "side", "frames", "true m", "by blur m (95 %)", "off %")
    if rows:
        print_rows(f"{title}: depth from blur alone, no size known", header, rows)
    return bool(rows)


STAFF = "levelling_staff"
LABELS = {
    "aperture": "Eq. 16, Table 8",
    "inverse": "Eq. 17, printed",
    "size": "one size (ours)",
}


def _print_accuracy(results: Results, recording_id: str, source: Path) -> None:
    """Print the errors on `staff` beside those of what the paper prints for the same rows."""
    depths = _table(source / "paper" / "depth_tables_3_to_7.csv")
    heights = _table(source / "paper" / "height_tables_9_10.csv")
    # A width that contradicts the row's other columns is a misprint, and no measurement.
    wrong = [_id(r) for r in depths if "width_px contradicts" in r["erratum"]]
    wrong += [_id(r) for r in heights if r["erratum"]]
    found = results.query(
        """
        SELECT f_number, method, sqrt(avg(depth_error_m ** 2)) AS depth_m,
            sqrt(avg(height_error_m ** 2)) AS height_m
        FROM accuracy.errors WHERE recording_id = ? AND NOT list_contains(?, object_id)
        GROUP BY GROUPING SETS ((f_number, method), (method))
        """,
        [recording_id, wrong],
    ).rows()
    ours = {(r["f_number"], r["method"]): r["depth_m"] for r in found if r["depth_m"] is not None}
    methods = sorted({method for _, method in ours})
    paper = _printed_rmse(depths, wrong, "estimated_depth_cm", "actual_depth_cm")
    apertures: list[float | None] = [*sorted({f for f, _ in ours if f is not None}), None]
    rows = [
        [
            "all" if f is None else f"f/{f:g}",
            _cm(paper.get(f)),
            *(_cm(100 * ours[f, m]) if (f, m) in ours else "" for m in methods),
        ]
        for f in apertures
    ]
    header = ("aperture", "paper, printed", *(LABELS.get(m, m) for m in methods))
    print_rows("staff: depth RMSE in cm, 50-110 cm, 34 rows of Tables 3-7", header, rows)
    printed = _printed_rmse(heights, wrong, "estimated_height_cm", "actual_height_cm").get(None)
    exact = next(
        (r["height_m"] for r in found if (r["f_number"], r["method"]) == (None, "aperture")), None
    )
    if printed is not None and exact is not None:
        out.print(
            f"staff: height RMSE on {sum(not r['erratum'] for r in heights)} consistent rows of Tables "
            f"9-10: the paper {printed:.2f} cm, ours by the exact magnification {100 * exact:.2f} cm"
        )


def _table(path: Path) -> list[dict[str, str]]:
    if not path.is_file():
        return []
    with path.open(encoding="utf-8", newline="") as lines:
        return list(csv.DictReader(lines))


def _id(row: dict[str, str]) -> str:
    table = row.get("paper_table") or (9 if int(row["row"]) <= 12 else 10)
    return f"table{table}/row{row['row']}"


def _printed_rmse(
    rows: list[dict[str, str]], wrong: list[str], estimated: str, actual: str
) -> dict[float | None, float]:
    """Return the RMSE of what the paper prints, by f-number and, at None, of all rows."""
    errors: dict[float | None, list[float]] = {}
    for row in rows:
        if _id(row) not in wrong:
            error = float(row[estimated]) - float(row[actual])
            errors.setdefault(float(row["f_number"]), []).append(error)
            errors.setdefault(None, []).append(error)
    return {f: math.sqrt(sum(e * e for e in es) / len(es)) for f, es in errors.items()}


def _cm(value_cm: float | None) -> str:
    return "" if value_cm is None else f"{value_cm:.2f}"
