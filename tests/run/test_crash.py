"""Killed runs, full disks, a second writer: all that was committed is there, whole."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import duckdb
import numpy as np
import pytest

from pipeline.store.columns import RECORDING_TABLES
from pipeline.store.database import Store
from tests.cli.test_commands import ROOT, stadimeter
from tests.run.test_recordings import write_people

KILLS = 16


class CrashServer:
    """Starts runs at once, and kills them."""

    def __init__(self, database: Path, recordings: list[Path]) -> None:
        command = [
            sys.executable,
            "-m",
            "tests.support.crash_server",
            str(database),
            *map(str, recordings),
        ]
        self._process = subprocess.Popen(
            command, cwd=ROOT, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )

    def run(self, kill_after_s: float | None = None) -> tuple[int, float]:
        """Start a run; return how it ended, and how long it took."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.write("\n")
        self._process.stdin.flush()
        child, started = int(self._process.stdout.readline()), time.monotonic()
        if kill_after_s is not None:
            time.sleep(kill_after_s)
            with suppress(ProcessLookupError):
                os.kill(child, signal.SIGKILL)
        return int(self._process.stdout.readline()), time.monotonic() - started

    def close(self) -> None:
        assert self._process.stdin is not None
        self._process.stdin.close()
        self._process.wait(timeout=20)


@contextmanager
def crash_server(database: Path, recordings: list[Path]) -> Iterator[CrashServer]:
    server = CrashServer(database, recordings)
    try:
        yield server
    finally:
        server.close()


def rows_by_recording(store: Store) -> dict[str, dict[str, int]]:
    """Return how many rows each recording has in each table.

    Without those that compare it with the recordings that were there before it.
    """
    found: dict[str, dict[str, int]] = {}
    for table in RECORDING_TABLES:
        own = "WHERE code <> 'overlapping_recordings'" if table == "diagnostics" else ""
        counts = store.query(f"SELECT recording_id, count(*) AS n FROM {table} {own} GROUP BY ALL")
        for row in counts.to_pylist():
            found.setdefault(row["recording_id"], {})[table] = row["n"]
    return found


def count_whole(database: Path, whole: dict[str, dict[str, int]]) -> int:
    """Return how many recordings are there; each must be whole, and the views must work."""
    if database.stat().st_size and not has_tables(database):
        return 0  # killed before its tables were committed
    with Store.open(database, read_only=True) as store:
        found = rows_by_recording(store)
        assert found.items() <= whole.items()
        store.query("FROM accuracy.by_method")
        store.query("FROM current_estimates")
    return len(found)


def has_tables(database: Path) -> bool:
    with duckdb.connect(str(database), read_only=True) as connection:
        return bool(connection.execute("FROM duckdb_tables()").fetchall())


def contents(database: Path) -> dict[str, list[dict[str, object]]]:
    """Return all rows of the recordings, but for what names the run."""
    with Store.open(database, read_only=True) as store:
        return {
            table: store.query(f"SELECT * EXCLUDE (run_id) FROM {table} ORDER BY ALL").to_pylist()
            if "run_id" in store.query(f"FROM {table} LIMIT 0").column_names
            else store.query(f"FROM {table} ORDER BY ALL").to_pylist()
            for table in RECORDING_TABLES
        }


@pytest.fixture(scope="module")
def recordings(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    folder = tmp_path_factory.mktemp("crash")
    paths = [folder / f"{number}.mcap" for number in range(3)]
    for number, path in enumerate(paths):
        write_people(path, frames=8 + 4 * number, broken=number)
    return paths


@pytest.mark.slow
def test_a_run_killed_at_any_moment_leaves_each_recording_whole_or_absent(
    recordings: list[Path], tmp_path: Path
) -> None:
    reference, database = tmp_path / "reference.duckdb", tmp_path / "killed" / "x.duckdb"
    with crash_server(reference, recordings) as server:
        _, duration_s = server.run()
    with Store.open(reference, read_only=True) as store:
        whole = rows_by_recording(store)
        views = store.catalog()["name"].to_pylist()
    assert len(whole) == len(recordings)

    moments = np.random.default_rng().permutation(KILLS)  # each in its own part of the run
    killed, seen = 0, set()
    with crash_server(database, recordings) as server:
        while killed < KILLS:
            if killed % 10 == 0 and database.exists():  # also a first run into a new database
                for path in database.parent.glob("x.duckdb*"):
                    path.unlink()
            share = (moments[killed] + np.random.default_rng().random()) / KILLS
            status, took_s = server.run(kill_after_s=share * duration_s)
            if os.WIFSIGNALED(status):
                killed += 1
            else:  # the machine has become faster: the parts are of what a run takes now
                duration_s = took_s * 0.98
            if database.exists():
                seen.add(count_whole(database, whole))
        assert len(seen) > 1, "no kill came between two recordings"
        assert server.run()[0] == 0
    assert contents(database) == contents(reference)
    assert [p.name for p in database.parent.iterdir()] == ["x.duckdb"]
    with Store.open(database, read_only=True) as store:
        for view in views:
            if "(" not in view:
                store.query(f"FROM {view}")


@pytest.mark.slow
def test_a_killed_run_leaves_no_processes_behind(recordings: list[Path], tmp_path: Path) -> None:
    command = [sys.executable, "-m", "pipeline.cli", "run", *map(str, recordings)]
    command += ["--workers", "2", "--db", str(tmp_path / "x.duckdb")]
    run = subprocess.Popen(command, cwd=ROOT, start_new_session=True, stderr=subprocess.DEVNULL)
    deadline = time.monotonic() + 60
    while len(_session(run.pid)) < 4 and time.monotonic() < deadline and run.poll() is None:
        time.sleep(0.02)
    assert len(_session(run.pid)) >= 4, "the workers did not start"
    run.kill()
    run.wait()
    deadline = time.monotonic() + 15
    while _session(run.pid) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert _session(run.pid) == []
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=120)
    assert done.returncode == 3, done.stderr  # each has a broken picture
    assert [p.name for p in tmp_path.iterdir()] == ["x.duckdb"]


@pytest.mark.slow
def test_a_killed_worker_is_replaced(recordings: list[Path], tmp_path: Path) -> None:
    reference, database = tmp_path / "reference.duckdb", tmp_path / "x.duckdb"
    command = [sys.executable, "-m", "pipeline.cli", "run", *map(str, recordings), "--workers"]
    subprocess.run([*command, "1", "--db", str(reference)], cwd=ROOT, capture_output=True)
    run = subprocess.Popen(
        [*command, "2", "--db", str(database)],
        cwd=ROOT,
        start_new_session=True,
        stderr=subprocess.PIPE,
        text=True,
    )
    deadline = time.monotonic() + 60
    while len(_workers(run.pid)) < 2 and time.monotonic() < deadline and run.poll() is None:
        time.sleep(0.02)
    os.kill(_workers(run.pid)[0], signal.SIGKILL)
    _, said = run.communicate(timeout=120)
    assert run.returncode == 3, said  # each has a broken picture
    assert contents(database) == contents(reference)
    assert {p.name for p in tmp_path.iterdir()} == {"x.duckdb", "reference.duckdb"}


def _workers(leader: int) -> list[int]:
    """Return the processes of a run that do recordings: they are copies of one that it began."""
    found = []
    for process in _session(leader):
        with suppress(OSError):
            stat = Path(f"/proc/{process}/stat").read_text()
            parent = int(stat.rsplit(")", 1)[1].split()[1])
            if process != leader and parent != leader:
                found.append(process)
    return found


def _session(leader: int) -> list[int]:
    """Return the living processes of a session."""
    found = []
    for folder in Path("/proc").glob("[0-9]*"):
        with suppress(OSError, ValueError):
            state, _, _, session = (folder / "stat").read_text().rsplit(")", 1)[1].split()[:4]
            if int(session) == leader and state != "Z":
                found.append(int(folder.name))
    return found


@contextmanager
def small_disk(folder: Path, size: str) -> Iterator[Path]:
    """Give a file system of its own with so little room; skip where that is not permitted."""
    folder.mkdir()
    mounted = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", f"size={size}", "tmpfs", str(folder)], capture_output=True
    )
    if mounted.returncode:
        pytest.skip("mounting a file system is not permitted here")
    try:
        yield folder
    finally:
        subprocess.run(["umount", "--lazy", str(folder)], check=True)


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="tmpfs is Linux's")
@pytest.mark.parametrize("room_kb", [0, 40])
def test_a_full_disk_is_told_and_the_same_command_finishes_the_work(
    recordings: list[Path], room_kb: int, tmp_path: Path
) -> None:
    with small_disk(tmp_path / "disk", "24m") as disk:
        database = disk / "x.duckdb"
        with crash_server(database, recordings[:1]) as server:
            server.run()
        before = contents(database)
        fill(disk / "ballast", leave_kb=room_kb)
        full = stadimeter("run", *recordings[:2], "--db", database, cwd=tmp_path)
        assert full.returncode == 1, full.stdout
        assert "Traceback" not in full.stderr
        assert "No space left" in full.stderr
        assert "run the same command again" in full.stderr
        assert contents(database) == before
        (disk / "ballast").unlink()
        with crash_server(database, recordings[:2]) as server:
            assert server.run()[0] == 0
        with Store.open(database, read_only=True) as store:
            assert len(rows_by_recording(store)) == 2
        assert [p.name for p in disk.iterdir()] == ["x.duckdb"]


def fill(ballast: Path, *, leave_kb: int) -> None:
    """Fill a file system, but for a little."""
    with ballast.open("wb", buffering=0) as stream, suppress(OSError):
        while stream.write(bytes(4096)):
            pass
    os.truncate(ballast, ballast.stat().st_size - leave_kb * 1024)


def test_a_second_writer_is_told_who_has_the_database(
    recordings: list[Path], tmp_path: Path
) -> None:
    database = tmp_path / "x.duckdb"
    with Store.open(database):
        second = stadimeter("run", recordings[0], "--db", database, cwd=tmp_path)
        reader = stadimeter("query", "--db", database, "SELECT 1", cwd=tmp_path)
    for done in (second, reader):
        assert done.returncode == 1
        assert str(database) in done.stderr
        assert str(os.getpid()) in done.stderr
        assert "Wait until it ends" in done.stderr
    done = stadimeter("run", recordings[0], "--db", database, cwd=tmp_path)
    assert done.returncode == 3


@pytest.mark.slow
@pytest.mark.parametrize("most_kb", [64, 400, 900])
def test_a_file_that_may_not_grow_is_told_as_the_disks_refusal(
    tmp_path: Path, most_kb: int
) -> None:
    """A limit on the size of files stops DuckDB's own writing; whatever was stored can be read."""
    source = ROOT / "recordings" / "staff.mcap"
    command = (
        f"ulimit -f {most_kb}; exec {sys.executable} -m pipeline.cli run {source} --db x.duckdb -q"
    )
    done = subprocess.run(
        ["bash", "-c", command],
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert "Traceback" not in done.stderr
    assert done.returncode in (1, 3)
    if done.returncode == 1:
        assert "does not take its rows" not in done.stderr
        assert any(word in done.stderr for word in ("too large", "room", "disk", "space"))
    database = tmp_path / "x.duckdb"
    if database.exists():
        with Store.open(database, read_only=True) as store:
            assert store.query("SELECT count(*) AS n FROM recordings").to_pylist()[0]["n"] <= 1
