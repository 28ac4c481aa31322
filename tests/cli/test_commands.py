"""The commands as a user starts them: output, exit codes, messages."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pyarrow.parquet as pq
import pytest

from tests.run.test_recordings import write_people

ROOT = Path(__file__).resolve().parents[2]


def stadimeter(*arguments: object, cwd: Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "pipeline.cli", *map(str, arguments)]
    environment = {"PYTHONPATH": str(ROOT), "PATH": "/usr/bin:/bin", "HOME": str(cwd)}
    return subprocess.run(
        command, cwd=cwd, env=environment, capture_output=True, text=True, timeout=300
    )


@pytest.fixture(scope="module")
def workplace(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("cli")
    write_people(folder / "people.mcap")
    (folder / "level.toml").write_text(
        '[[camera]]\nname = "cam"\ncamera_height_m = 1.5\ntilt_deg = 0.0\n'
    )
    done = stadimeter(
        "run", "people.mcap", "--db", "x.duckdb", "--camera", "level.toml", "--profile", cwd=folder
    )
    assert done.returncode == 0, done.stderr
    for stage in ("read", "decode (2 threads)", "detect", "track", "measure", "store", "estimate"):
        assert stage in done.stdout
    assert "people.mcap" in done.stdout
    assert "x.duckdb" in done.stdout
    return folder


def test_queries_in_every_form(workplace: Path) -> None:
    view = ("query", "--db", "x.duckdb", "--view", "accuracy.by_method")
    table = stadimeter(*view, cwd=workplace)
    assert table.returncode == 0
    assert "ground" in table.stdout
    csv = stadimeter(*view, "--csv", cwd=workplace).stdout.splitlines()
    assert csv[0].split(",")[0].strip('"') == "method"
    rows = [
        json.loads(line) for line in stadimeter(*view, "--json", cwd=workplace).stdout.splitlines()
    ]
    assert {row["method"] for row in rows} == {"fused", "ground", "size"}
    assert stadimeter(*view, "--parquet", "out.parquet", cwd=workplace).returncode == 0
    assert pq.read_table(workplace / "out.parquet").num_rows == 3


def test_the_catalogue_says_what_each_view_answers(workplace: Path) -> None:
    listed = stadimeter("query", "--db", "x.duckdb", "--list", cwd=workplace).stdout
    for name in ("accuracy.by_aperture", "paper.k_by_aperture", "observations"):
        assert name in listed


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (("query", "--db", "none.duckdb", "SELECT 1"), 1, "no such database"),
        (("query", "--db", "x.duckdb", "SELEC 1"), 2, "syntax error"),
        (("query", "--db", "x.duckdb", "--view", "nope"), 2, "no view or table 'nope'"),
        (("query", "--db", "x.duckdb", "DELETE FROM runs"), 2, "read"),
        (("query", "--db", "x.duckdb", "COPY runs TO 'stolen.csv'"), 2, ""),
        (("query", "--db", "x.duckdb"), 2, "one of SQL"),
        (("run", "absent.mcap", "--db", "y.duckdb"), 1, "absent.mcap"),
        (("inspect", "absent.mcap"), 2, "no such file"),
        (("run", "people.mcap", "--camera", "absent.toml"), 2, "absent.toml"),
        (("import", "absent.avi", "-o", "z.mcap"), 2, "absent.avi"),
        (("run", "people.mcap", "--workers", "0"), 2, "number of workers must be at least 1"),
    ],
)
def test_errors_say_what_and_where(
    workplace: Path, arguments: tuple[str, ...], code: int, words: str
) -> None:
    done = stadimeter(*arguments, cwd=workplace)
    assert done.returncode == code, done.stderr
    assert words in done.stderr
    assert "Traceback" not in done.stderr
    assert not (workplace / "stolen.csv").exists()


def test_a_wrong_key_in_the_camera_file_is_named(workplace: Path) -> None:
    (workplace / "bad.toml").write_text('[[camera]]\nname = "c"\nfocal_lenght_mm = 5.0\n')
    done = stadimeter("run", "people.mcap", "--camera", "bad.toml", cwd=workplace)
    assert done.returncode == 2
    assert "camera[0].focal_lenght_mm" in done.stderr
    assert "bad.toml" in done.stderr


def test_damage_is_exit_code_3_and_the_last_lines_say_how_much(workplace: Path) -> None:
    write_people(workplace / "broken.mcap", broken=4)
    done = stadimeter("run", "broken.mcap", "--db", "b.duckdb", cwd=workplace)
    assert done.returncode == 3
    assert done.stdout.splitlines()[-1].startswith("1 frames were lost")
    whole = (workplace / "people.mcap").read_bytes()
    (workplace / "cut.mcap").write_bytes(whole[: len(whole) // 2])
    done = stadimeter("run", "cut.mcap", "--db", "c.duckdb", cwd=workplace)
    assert done.returncode == 3
    assert "byte" in done.stdout
    assert done.stdout.splitlines()[-1].startswith("at least 0 frames were lost")


def test_inspect_tells_what_is_there_and_what_is_missing(workplace: Path) -> None:
    done = stadimeter("inspect", "people.mcap", cwd=workplace)
    assert done.returncode == 0
    for words in ("foxglove.CompressedImage", "12 frames", "no f-number", "no damage found"):
        assert words in done.stdout


def test_estimating_again_needs_no_pictures(workplace: Path) -> None:
    recording = workplace / "people.mcap"
    hidden = recording.rename(workplace / "hidden")
    done = stadimeter("estimate", "--db", "x.duckdb", "--label", "again", cwd=workplace)
    hidden.rename(recording)
    assert done.returncode == 0
    assert "1 recordings" in done.stdout


def test_help_and_version() -> None:
    assert stadimeter("--version", cwd=ROOT).stdout.startswith("stadimeter ")
    for command in ("run", "inspect", "import", "estimate", "query", "report", "demo"):
        assert stadimeter(command, "--help", cwd=ROOT).returncode == 0


@pytest.mark.slow
def test_the_demo_tells_the_whole_story(tmp_path: Path) -> None:
    done = stadimeter("demo", "--out", tmp_path / "out", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    for words in (
        "f/1.8",
        "paper",
        "above the ground",
        "ground",
        "stadimeter.duckdb",
        "street.rrd",
        "walkers.mcap: against the truth",
    ):
        assert words in done.stdout
    names = {p.name for p in (tmp_path / "out").iterdir()}
    assert {"stadimeter.duckdb", "staff.rrd", "street.rrd", "walkers.rrd", "report.html"} <= names


def test_calibrating_from_truth_and_using_what_was_found(tmp_path: Path) -> None:
    staff = ROOT / "recordings" / "staff.mcap"
    fitted = stadimeter(
        "calibrate",
        staff,
        "--db",
        "c.duckdb",
        "-o",
        "c.toml",
        "--exclude",
        "table4/row4",
        cwd=tmp_path,
    )
    assert fitted.returncode == 0, fitted.stderr
    assert "leave-one-out" in fitted.stdout
    done = stadimeter("estimate", "--db", "c.duckdb", "--camera", "c.toml", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    rows = stadimeter(
        "query",
        "--db",
        "c.duckdb",
        "--json",
        "SELECT sqrt(avg(depth_error_m ** 2)) AS rmse_m, corr(depth_m, true_depth_m) AS r "
        "FROM accuracy.errors WHERE method = 'size' AND object_id <> 'table4/row4'",
        cwd=tmp_path,
    )
    found = json.loads(rows.stdout)
    assert found["rmse_m"] < 0.025  # the paper: 0.0323 m
    assert found["r"] > 0.9929  # the paper: 0.9904
    stored = stadimeter(
        "query",
        "--db",
        "c.duckdb",
        "--json",
        "SELECT DISTINCT method FROM calibrations",
        cwd=tmp_path,
    )
    assert {json.loads(line)["method"] for line in stored.stdout.splitlines()} == {
        "aperture",
        "size",
        "inverse",
    }


def test_calibrating_without_truth_says_so(workplace: Path, tmp_path: Path) -> None:
    none = stadimeter("calibrate", "--db", "none.duckdb", "-o", "c.toml", cwd=tmp_path)
    assert none.returncode == 1
    assert "no such database" in none.stderr
    few = stadimeter("calibrate", "--walkers", "--db", "x.duckdb", "-o", "w.toml", cwd=workplace)
    assert few.returncode == 1
    assert "4 are needed" in few.stderr
    assert not (workplace / "w.toml").exists()


HEAVY = ("cv2", "numpy", "pandas", "rerun", "scipy")


def modules_after(arguments: list[str], names: tuple[str, ...], cwd: Path) -> str:
    """Return those of the named modules that a command has loaded at its end."""
    code = (
        "import sys; from pipeline.cli import main\n"
        f"try: main({arguments})\n"
        "except SystemExit: pass\n"
        f"print([m for m in {names} if m in sys.modules])"
    )
    done = subprocess.run(
        [sys.executable, "-c", code],
        cwd=cwd,
        env={"PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()[-1]


def test_asking_the_database_waits_for_no_library_that_it_does_not_need(workplace: Path) -> None:
    asked = ["query", "--db", "x.duckdb", "SELECT 1 AS one"]
    heavy = tuple(name for name in HEAVY if name != "numpy")
    assert modules_after(asked, heavy, workplace) == "[]"


def test_help_waits_for_no_library(tmp_path: Path) -> None:
    heavy = (*HEAVY, "pyarrow", "duckdb")
    assert modules_after(["run", "--help"], heavy, tmp_path) == "[]"
