"""Whatever file operation fails: a message, an exit code, nothing half-written, nothing lost."""

from __future__ import annotations

import errno
import os
import shutil
import subprocess
import sys
from pathlib import Path

import duckdb
import pytest

from pipeline.cli.main import main
from pipeline.store.database import Store
from tests.cli.test_commands import ROOT
from tests.run.test_recordings import write_people
from tests.support.faults import failing

COMMANDS = {
    "run": ("run", "a.mcap", "--db", "new.duckdb", "--rrd", "rrd"),
    "parts": ("run", "a.mcap", "--parts", "parts"),
    "report": ("report", "--db", "old.duckdb", "-o", "x.html"),
    "export": ("export", "a.mcap", "--db", "old.duckdb", "-o", "x.mcap"),
    "query": ("query", "SELECT * FROM frames", "--db", "old.duckdb", "--parquet", "x.parquet"),
    "estimate": ("estimate", "--db", "old.duckdb"),
    "review": ("review", "a.mcap", "--db", "old.duckdb", "-o", "x.rrd"),
}
WRITTEN = ("x.html", "x.mcap", "x.parquet", "x.rrd")


@pytest.fixture(scope="module")
def workplace(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("faults")
    write_people(folder / "a.mcap", frames=3)
    assert main(["run", str(folder / "a.mcap"), "--db", str(folder / "old.duckdb")]) == 0
    return folder


def attempt(
    name: str, source: Path, folder: Path, at: int | None, code: int
) -> tuple[int, list[str]]:
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(source, folder)
    before, temporary = Path.cwd(), os.environ.get("TMPDIR")
    os.chdir(folder)
    arguments = [str(folder / a) if a in _paths(folder) else a for a in COMMANDS[name]]
    try:
        with failing(folder, at, code) as fault:
            result = main(arguments)
    finally:
        os.chdir(before)
        assert os.environ.get("TMPDIR") == temporary
    return result, fault.seen


def _paths(folder: Path) -> set[str]:
    return {"a.mcap", "new.duckdb", "old.duckdb", "rrd", "parts", *WRITTEN} | {
        p.name for p in folder.iterdir()
    }


def check(name: str, folder: Path, result: int, what: str) -> None:
    left = [str(p.relative_to(folder)) for p in folder.rglob("*")]
    half = [p for p in left if ".part" in Path(p).name or p.endswith((".tmp", ".wal"))]
    assert not [p for p in half if not p.startswith("parts")], (what, left)
    assert result in (0, 1, 2, 3), what
    for database in folder.glob("*.duckdb"):
        with Store.open(database, read_only=True) as store:
            whole = store.query("SELECT recording_id FROM recordings").num_rows
            framed = store.query("SELECT DISTINCT recording_id FROM frames").num_rows
            assert (whole, framed) == (1, 1), what
    if result and ".rbl" not in what:  # a timeline without its layout is whole
        assert not any((folder / w).exists() for w in WRITTEN), (what, left)


def fail_each(name: str, workplace: Path, folder: Path, step: int, capsys: object) -> None:
    result, seen = attempt(name, workplace, folder, None, 0)
    assert result == 0
    assert seen
    for at in range(0, len(seen), step):
        code = errno.EACCES if (at // step) % 2 else errno.ENOSPC
        result, done = attempt(name, workplace, folder, at, code)
        said = capsys.readouterr()  # type: ignore[attr-defined]
        check(name, folder, result, f"{done[at] if at < len(done) else at}: {said.err}")
        if result:
            assert "stadimeter: " in said.err, (done[at], said)


@pytest.mark.parametrize("name", [*COMMANDS])
def test_some_operations_that_fail_leave_nothing_half_written(
    name: str, workplace: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    fail_each(name, workplace, tmp_path / "w", 9, capsys)


@pytest.mark.slow
@pytest.mark.parametrize("name", [*COMMANDS])
def test_any_operation_that_fails_leaves_nothing_half_written(
    name: str, workplace: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    fail_each(name, workplace, tmp_path / "w", 1, capsys)


def test_an_empty_file_is_a_new_database(workplace: Path, tmp_path: Path) -> None:
    database = tmp_path / "x.duckdb"
    database.touch()
    assert main(["run", str(workplace / "a.mcap"), "--db", str(database)]) == 0
    with duckdb.connect(str(database), read_only=True) as connection:
        assert connection.execute("SELECT count(*) FROM recordings").fetchone() == (1,)


def test_a_failed_run_leaves_no_empty_database(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "x.mcap").write_bytes(b"no recording")
    assert main(["run", str(tmp_path / "x.mcap"), "--db", str(tmp_path / "x.duckdb")]) == 1
    assert [p.name for p in tmp_path.iterdir()] == ["x.mcap"]
    assert "x.duckdb" not in capsys.readouterr().out


def test_a_run_that_cannot_have_the_database_takes_nothing_away(
    workplace: Path, tmp_path: Path
) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    for arguments in (
        ("run", workplace / "a.mcap", "--db", pipe),
        ("query", "SELECT 1 AS x", "--db", workplace / "old.duckdb", "--parquet", pipe),
        ("export", workplace / "a.mcap", "--db", workplace / "old.duckdb", "-o", pipe),
        ("report", "--db", workplace / "old.duckdb", "-o", pipe),
        ("review", workplace / "a.mcap", "--db", workplace / "old.duckdb", "-o", pipe),
        ("run", pipe, "--db", tmp_path / "x.duckdb"),
        ("inspect", pipe),
    ):
        assert main([str(a) for a in arguments]) in (1, 2), arguments
        assert pipe.is_fifo(), arguments


def test_timelines_that_cannot_be_written_are_told_before_the_work(
    workplace: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    taken = tmp_path / "taken"
    taken.write_bytes(b"")
    database = tmp_path / "x.duckdb"
    arguments = ["run", workplace / "a.mcap", "--db", database, "--rrd", taken]
    assert main([str(a) for a in arguments]) == 1
    said = capsys.readouterr()
    assert "measure" not in said.out + said.err
    assert not database.exists()


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="this system has no full device")
def test_a_full_standard_output_is_told(workplace: Path) -> None:
    import subprocess
    import sys

    command = [sys.executable, "-m", "pipeline.cli", "query", "--list", "--db"]
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(
            [*command, str(workplace / "old.duckdb")],
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
        )
    assert done.returncode == 1
    assert done.stderr.startswith("stadimeter: ")


def test_a_pipe_that_is_closed_early_is_no_error(workplace: Path) -> None:
    sql = "SELECT range AS x FROM range(200000)"
    command = [sys.executable, "-m", "pipeline.cli", "query", sql, "--csv", "--db", "old.duckdb"]
    with subprocess.Popen(
        command,
        cwd=workplace,
        env={"PYTHONPATH": str(ROOT), "PATH": "/usr/bin:/bin", "HOME": str(workplace)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as running:
        assert running.stdout is not None
        assert running.stderr is not None
        assert running.stdout.readline().strip().strip('"') == "x"
        running.stdout.close()  # as `| head -1` does
        assert running.stderr.read() == ""
        assert running.wait(60) == 0
