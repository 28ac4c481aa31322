from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from contextlib import closing
from pathlib import Path

import pytest

from pipeline.core.errors import StoreError
from pipeline.parallel.processes import RETRIES, Engine, LocalEngine, WorkerLost, local_engine, tell


def double(number: int) -> int:
    return 2 * number


def die_once(folder: Path, name: str) -> str:
    """Kill the process that runs this, the first time."""
    mark = folder / name
    with mark.open("a") as stream:
        stream.write("x")
    if mark.stat().st_size == 1:
        os.kill(os.getpid(), signal.SIGKILL)
    return name


def die(folder: Path) -> None:
    with (folder / "deaths").open("a") as stream:
        stream.write("x")
    os.kill(os.getpid(), signal.SIGKILL)


def refuse() -> None:
    raise StoreError("no")


def drained(engine: Engine) -> dict[object, object]:
    return dict(engine.results())


@pytest.mark.parametrize("workers", [1, 2])
def test_results_come_with_their_names(workers: int) -> None:
    with local_engine(workers) as engine:
        for number in range(5):
            engine.submit(f"n{number}", double, number)
        assert drained(engine) == {f"n{n}": 2 * n for n in range(5)}


def test_tasks_may_follow_from_results() -> None:
    with local_engine(1) as engine:
        engine.submit("first", double, 1)
        found = {}
        for name, result in engine.results():
            found[name] = result
            if name == "first":
                engine.submit("second", double, result)
        assert found == {"first": 2, "second": 4}


def test_a_killed_process_costs_its_task_a_second_start(tmp_path: Path) -> None:
    with local_engine(2) as engine:
        for name in ("a", "b"):
            engine.submit(name, die_once, tmp_path, name)
        for number in range(4):
            engine.submit(number, double, number)
        found = drained(engine)
    assert found == {"a": "a", "b": "b", 0: 0, 1: 2, 2: 4, 3: 6}


def test_what_kills_every_process_is_given_up_and_the_others_are_done(tmp_path: Path) -> None:
    with closing(LocalEngine(1)) as engine:
        engine.submit("bad", die, tmp_path)
        engine.submit("good", double, 4)
        found = drained(engine)
    assert found["good"] == 8
    assert isinstance(found["bad"], WorkerLost)
    assert (tmp_path / "deaths").stat().st_size == RETRIES + 1


def die_with(folder: Path, mark: str) -> None:
    """Kill the process that runs this, but never before the other is there to be killed with it."""
    (folder / mark).touch()
    deadline = time.monotonic() + 5
    while not (folder / "slow").exists() and time.monotonic() < deadline:
        time.sleep(0.01)
    os.kill(os.getpid(), signal.SIGKILL)


def slow(folder: Path) -> str:
    (folder / "slow").touch()
    time.sleep(0.5)
    (folder / "slow").unlink()
    return "done"


@pytest.mark.slow
def test_who_runs_beside_what_kills_is_not_given_up_with_it(tmp_path: Path) -> None:
    with closing(LocalEngine(2)) as engine:
        engine.submit("bad", die_with, tmp_path, "x")
        engine.submit("good", slow, tmp_path)
        found = drained(engine)
    assert found["good"] == "done"
    assert isinstance(found["bad"], WorkerLost)


def talk(count: int) -> int:
    for number in range(count):
        tell({"number": number})
    tell("x" * 100_000)  # too long to be one piece
    return count


def test_what_tasks_tell_is_heard() -> None:
    heard: list[object] = []
    with local_engine(2, heard.append) as engine:
        for count in (1, 3):
            engine.submit(count, talk, count)
        assert drained(engine) == {1: 1, 3: 3}
    assert sorted(m["number"] for m in heard if isinstance(m, dict)) == [0, 0, 1, 2]
    assert len(heard) == 4


def test_nobody_waits_for_one_who_does_not_listen() -> None:
    with local_engine(2) as engine:
        engine.submit("much", talk, 50_000)
        assert drained(engine) == {"much": 50_000}


def test_an_error_of_a_task_is_raised() -> None:
    with local_engine(1) as engine:
        engine.submit("x", refuse)
        with pytest.raises(StoreError, match="no"):
            drained(engine)


SCRIPT = """
from operator import mul
from pipeline.parallel.processes import local_engine
print("began")
with local_engine(2) as engine:
    engine.submit("a", mul, 2, 3)
    engine.submit("b", mul, 4, 5)
    print(sorted(engine.results()))
print(__file__ is not None, __spec__)
"""


def test_a_script_without_a_guard_is_run_once(tmp_path: Path) -> None:
    """A script that calls the library at its top level must not be run again in every process."""
    script = tmp_path / "script.py"
    script.write_text(SCRIPT)
    root = Path(__file__).parents[2]
    done = subprocess.run(
        [sys.executable, str(script)],
        capture_output=True,
        text=True,
        timeout=60,
        env=os.environ | {"PYTHONPATH": str(root)},
    )
    assert done.stderr == ""
    assert done.stdout.splitlines() == ["began", "[('a', 6), ('b', 20)]", "True None"]
