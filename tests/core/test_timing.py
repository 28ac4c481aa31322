from __future__ import annotations

import pickle
import time
from collections.abc import Iterator

import pytest

from pipeline.core.timing import NOTHING, Spent, StageTimes, Stopwatch


def busy(seconds: float) -> None:
    end = time.thread_time() + seconds
    while time.thread_time() < end:
        pass


def test_waiting_takes_time_but_no_processor() -> None:
    with Stopwatch() as asleep:
        time.sleep(0.03)
    with Stopwatch() as awake:
        busy(0.03)
    assert asleep.spent.elapsed_s >= 0.03
    assert asleep.spent.cpu_s < 0.01
    assert awake.spent.cpu_s == pytest.approx(0.03, abs=0.01)
    assert awake.spent.elapsed_s >= awake.spent.cpu_s - 1e-3


def test_what_fails_is_counted_too() -> None:
    times = StageTimes()

    def fail() -> None:
        with times.stage("read"):
            busy(0.01)
            raise ValueError

    with pytest.raises(ValueError):  # noqa: PT011  (ours, without a text)
        fail()
    assert times.spent["read"].cpu_s >= 0.01


def test_making_items_counts_and_using_them_does_not() -> None:
    times = StageTimes()

    def numbers() -> Iterator[int]:
        for number in range(3):
            busy(0.005)
            yield number

    got = []
    for number in times.each("make", numbers()):
        busy(0.02)
        got.append(number)
    assert got == [0, 1, 2]
    assert 0.015 <= times.spent["make"].cpu_s < 0.04


def test_none_is_an_item() -> None:
    assert list(StageTimes().each("make", [None, None])) == [None, None]


def test_threads_share_their_stage() -> None:
    times = StageTimes(threads={"decode": 2})
    assert times.slowest == ""
    times.add("decode", Spent(3.0, 3.0))
    times.add("detect", Spent(1.0, 1.0))
    times.add("detect", Spent(1.0, 1.0))
    assert times.spent["detect"] == Spent(2.0, 2.0)
    assert times.share_s("decode") == 1.5
    assert times.share_s("never ran") == NOTHING.elapsed_s
    assert times.slowest == "detect"


def test_times_go_from_process_to_process() -> None:
    times = StageTimes()
    with times.stage("read"):
        pass
    assert pickle.loads(pickle.dumps(times)) == times  # noqa: S301  (made a line above)
