from __future__ import annotations

import os
import signal
from contextlib import closing
from pathlib import Path

import pytest

from pipeline.cluster.engine import RETRIES, Engine, LocalEngine, WorkerLost, local_engine
from pipeline.errors import StoreError


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


def test_an_error_of_a_task_is_raised() -> None:
    with local_engine(1) as engine:
        engine.submit("x", refuse)
        with pytest.raises(StoreError, match="no"):
            drained(engine)
