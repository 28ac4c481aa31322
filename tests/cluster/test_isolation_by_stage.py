"""An error in any stage of one recording costs that recording, however recordings are worked."""

from __future__ import annotations

import importlib.util
import os
import subprocess
import sys
from pathlib import Path

import pytest

import pipeline.cluster.results_folder
from pipeline.cli.exit_codes import DAMAGED
from pipeline.cluster.manifest import read_manifests
from pipeline.cluster.results_folder import merge
from pipeline.store.database import Store
from tests.run.test_recordings import write_people
from tests.support import poisoned_run
from tests.support.poisoned_run import STAGES

ROOT = Path(__file__).parents[2]
needs_ray = pytest.mark.skipif(
    importlib.util.find_spec("ray") is None, reason="the extra `ray` is not installed"
)


def poisoned(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run one bad recording a stage between good ones."""
    for number, name in enumerate(["a", *(f"bad-{stage}" for stage in STAGES), "z"]):
        write_people(folder / f"{name}.mcap", 2, first=100 * number)
    paths = sorted(str(path) for path in folder.glob("*.mcap"))
    environment = dict(os.environ, PYTHONPATH=str(ROOT), RAY_USAGE_STATS_ENABLED="0")
    command = [sys.executable, str(ROOT / "tests/support/poisoned_run.py"), "run"]
    return subprocess.run(
        [*command, *paths, *arguments],
        capture_output=True,
        text=True,
        env=environment,
        timeout=240,
        check=False,
    )


def expect(database: Path, failed: set[str]) -> None:
    """Check that the others are stored, and that each failure has one row with its reason."""
    with Store.open(database, read_only=True) as store:
        names = set(store.query("SELECT file_name FROM recordings")["file_name"].to_pylist())
        rows = store.query(
            "SELECT file_name, message FROM diagnostics WHERE severity = 'error'"
        ).to_pylist()
        sure = store.query("SELECT DISTINCT recording_id FROM estimates").num_rows
    whole = {"a", "z", *(f"bad-{stage}" for stage in STAGES)} - failed
    assert names == {f"{name}.mcap" for name in whole}
    assert sure == len(whole)
    assert sorted(row["file_name"] for row in rows) == sorted(f"{name}.mcap" for name in failed)
    for row in rows:
        stage = row["file_name"].removeprefix("bad-").removesuffix(".mcap")
        assert str(STAGES[stage][1].args[0]).rstrip(".") in row["message"]
        assert row["file_name"] in row["message"]


ALL = {f"bad-{stage}" for stage in STAGES}


@pytest.mark.parametrize("workers", ["1", "2"])
def test_an_error_in_any_stage_costs_that_recording(workers: str, tmp_path: Path) -> None:
    done = poisoned(tmp_path, "--db", str(tmp_path / "x.duckdb"), "--workers", workers)
    assert done.returncode == DAMAGED, done.stderr
    assert "Traceback" not in done.stderr
    expect(tmp_path / "x.duckdb", ALL)
    assert not list(tmp_path.glob(".x.duckdb*"))


@pytest.mark.parametrize(
    "engine", ["local", pytest.param("ray", marks=[needs_ray, pytest.mark.slow])]
)
def test_an_error_in_any_stage_costs_that_recording_in_a_folder_of_parts(
    engine: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    parts = tmp_path / "parts"
    more = ("--engine", engine) if engine == "ray" else ()
    done = poisoned(tmp_path, "--parts", str(parts), "--workers", "2", *more)
    assert done.returncode == DAMAGED, done.stderr
    assert "Traceback" not in done.stderr
    failed = ALL - {"bad-take"}
    manifests = list(read_manifests(parts))
    assert {Path(m.source.path).stem for m in manifests if m.failure is not None} == failed
    with monkeypatch.context() as patch:  # `merge` is what takes the rows in
        module = pipeline.cluster.results_folder
        patch.setattr(module, "take_once", poisoned_run.failing("take", module.take_once))
        merge(parts, tmp_path / "x.duckdb")
        expect(tmp_path / "x.duckdb", ALL)
        merge(parts, tmp_path / "x.duckdb")  # its reason is told once
        expect(tmp_path / "x.duckdb", ALL)
