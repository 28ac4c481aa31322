"""Time that each stage of a run takes: counters so cheap that they always run.

A stage has two times. Elapsed time is what a person waits for; processor time is what the stage itself
costs, without its waiting for a disk, for another thread or for a busy machine.
"""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from types import TracebackType
from typing import NamedTuple, TypeVar

T = TypeVar("T")


class Spent(NamedTuple):
    """Seconds, elapsed and of a processor."""

    elapsed_s: float
    cpu_s: float

    def __add__(self, other: object) -> Spent:
        if not isinstance(other, Spent):
            return NotImplemented
        return Spent(self.elapsed_s + other.elapsed_s, self.cpu_s + other.cpu_s)


NOTHING = Spent(0.0, 0.0)


class Stopwatch:
    """Times what is inside `with`, in the thread that runs it."""

    __slots__ = ("_cpu", "_elapsed", "spent")

    def __enter__(self) -> Stopwatch:
        self._elapsed, self._cpu = time.perf_counter(), time.thread_time()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        cpu_s = time.thread_time() - self._cpu
        self.spent = Spent(time.perf_counter() - self._elapsed, cpu_s)


class _Stage(Stopwatch):
    """A stopwatch that adds to a stage's time."""

    __slots__ = ("_stage", "_times")

    def __init__(self, times: StageTimes, stage: str) -> None:
        self._times, self._stage = times, stage

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        super().__exit__(kind, error, trace)
        self._times.add(self._stage, self.spent)


@dataclass(slots=True)
class StageTimes:
    """Time that the stages of one recording have taken so far; each is added to by one thread only."""

    spent: dict[str, Spent] = field(default_factory=dict)  # in the order of their first use
    threads: dict[str, int] = field(default_factory=dict)  # of stages that run in several

    def add(self, stage: str, spent: Spent) -> None:
        """Add to a stage's time."""
        self.spent[stage] = self.spent.get(stage, NOTHING) + spent

    def add_all(self, other: StageTimes) -> None:
        """Add the times of a part of the work that was done elsewhere."""
        for stage, spent in other.spent.items():
            self.add(stage, spent)
        self.threads.update(other.threads)

    def stage(self, name: str) -> Stopwatch:
        """Return a context in which time counts for a stage."""
        return _Stage(self, name)

    def each(self, name: str, items: Iterable[T]) -> Iterator[T]:
        """Yield items; the time that it takes to make them counts for a stage."""
        iterator, end = iter(items), object()
        while True:
            with self.stage(name):
                item: T | object = next(iterator, end)
            if item is end:
                return
            yield item  # type: ignore[misc]

    def share_s(self, stage: str) -> float:
        """Return the elapsed time of a stage, as if its threads had shared the work evenly."""
        return self.spent.get(stage, NOTHING).elapsed_s / self.threads.get(stage, 1)

    @property
    def slowest(self) -> str:
        """Name the stage that takes most of the time, or nothing before there is any."""
        return max(self.spent, key=self.share_s, default="")
