"""Tasks side by side: functions and their arguments go out, results come back under their names.

An engine runs them: this process, several processes of this machine, or Ray (`cluster.engine`).
"""

from __future__ import annotations

import multiprocessing
import os
import select
import sys
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection
from multiprocessing.context import BaseContext
from multiprocessing.reduction import ForkingPickler
from typing import Any, Protocol

from pipeline.core.errors import StadimeterError
from pipeline.parallel.lifeline import die_with_parent

# A task whose machine dies is begun again elsewhere; one that kills whatever it runs on is given up.
RETRIES = 3
# Whoever ran beside it was killed with it. From the second time on, suspects run alone.
DEATHS_TOGETHER = 2
LISTEN_S = 0.2  # how long messages may wait to be heard
# POSIX writes so much into a pipe in one piece (Linux 4096 bytes), with no lock that the dead could keep.
_IN_ONE_PIECE = getattr(select, "PIPE_BUF", 512) - 4

Listener = Callable[[Any], None]


class WorkerLost(StadimeterError):
    """A task that is given up, as the process or machine that ran it died each time."""


def lost(name: object, why: object) -> WorkerLost:
    """Return the error of a task that is given up."""
    return WorkerLost(
        f"what worked on it died {RETRIES + 1} times: {why}",
        remedy=f"See whether memory ran out; `stadimeter inspect` tells what is in {name}",
    )


class Engine(Protocol):
    """Anything that runs tasks."""

    def submit(self, name: object, task: Callable[..., Any], *arguments: object) -> None:
        """Begin a task, or let it wait for its turn."""

    def results(self) -> Iterator[tuple[Any, Any]]:
        """Yield name and result of each task as it ends, of those begun meanwhile too.

        A result may be a `WorkerLost`.
        """


class LocalEngine:
    """Processes of this machine.

    No more tasks are handed to the pool than it has processes: when one dies, the pool goes with it,
    and whoever was in it is suspected of it.
    """

    def __init__(
        self, workers: int, listener: Listener | None = None, loads: Sequence[str] = ()
    ) -> None:
        self._workers = workers
        self._listener = listener
        self._context = _context(loads)
        self._heard, self._told = _one_way(self._context)
        self._pool: ProcessPoolExecutor | None = None
        self._waiting: deque[_Task] = deque()
        self._running: dict[Future[Any], _Task] = {}

    def submit(self, name: object, task: Callable[..., Any], *arguments: object) -> None:
        """Let a task wait for its turn."""
        self._waiting.append(_Task(name, task, arguments))

    def results(self) -> Iterator[tuple[Any, Any]]:
        """Yield name and result of each task as it ends."""
        while self._waiting or self._running:
            self._begin()
            done, _ = wait(self._running, timeout=LISTEN_S, return_when=FIRST_COMPLETED)
            self._listen()
            for future in done:
                task = self._running.pop(future)
                if not isinstance(future.exception(), BrokenProcessPool):
                    yield task.name, future.result()
                    continue
                self._pool = None
                task.deaths += 1
                if task.deaths > RETRIES:
                    yield task.name, lost(task.name, "its process ended")
                else:
                    self._waiting.append(task)

    def _begin(self) -> None:
        with _main_hidden():
            self._hand_out()

    def _hand_out(self) -> None:
        if self._pool is None:
            self._pool = ProcessPoolExecutor(
                self._workers,
                mp_context=self._context,
                initializer=_begin_process,
                initargs=(self._told,),
            )
        while self._waiting and len(self._running) < self._workers:
            together = [self._waiting[0], *self._running.values()]
            if len(together) > 1 and any(t.deaths >= DEATHS_TOGETHER for t in together):
                return
            task = self._waiting.popleft()
            try:
                self._running[self._pool.submit(task.function, *task.arguments)] = task
            except BrokenProcessPool:  # those that run will say so
                self._waiting.appendleft(task)
                if not self._running:
                    self._pool = None
                return

    def _listen(self) -> None:
        while self._heard.poll():
            message = self._heard.recv()
            if self._listener is not None:
                self._listener(message)

    def close(self) -> None:
        """End the processes."""
        if self._pool is not None:
            self._pool.shutdown(cancel_futures=True)
        self._heard.close()
        self._told.close()


# Where `tell` goes: from a process of an engine, or from a task in this process.
_to_parent: Connection | None = None
_to_here: Listener | None = None


def _context(loads: Sequence[str]) -> BaseContext:
    """Return the way in which processes begin: with none of this one's threads and locks.

    Linux copies them from one that has loaded the modules and done nothing else: once for all.
    """
    if sys.platform != "linux":
        return multiprocessing.get_context("spawn")
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(list(loads))
    return context


@contextmanager
def _main_hidden() -> Iterator[None]:
    """Let processes begin without running the main script again, which has none of their tasks.

    `multiprocessing` would import it into each of them by its file or name
    (`spawn.get_preparation_data`): a script that calls the library with no
    `if __name__ == "__main__"` would call it over and over.
    """
    main = sys.modules["__main__"]
    known = {name: getattr(main, name) for name in ("__spec__", "__file__") if hasattr(main, name)}
    for name in known:
        setattr(main, name, None)
    try:
        yield
    finally:
        for name, value in known.items():
            setattr(main, name, value)


def _one_way(context: BaseContext) -> tuple[Connection, Connection]:
    """Return the ends of a pipe; a sender that finds it full does not wait."""
    heard, told = context.Pipe(duplex=False)
    if os.name == "posix":
        os.set_blocking(told.fileno(), False)
    return heard, told


def _begin_process(told: Connection) -> None:
    global _to_parent
    _to_parent = told
    die_with_parent()


def tell(message: object) -> None:
    """Tell the listener of the engine that runs this task something small that it may also miss."""
    if _to_here is not None:
        _to_here(message)
    if _to_parent is None:
        return
    data = ForkingPickler.dumps(message)
    if len(data) <= _IN_ONE_PIECE:
        with suppress(BlockingIOError):
            _to_parent.send_bytes(data)


class InlineEngine:
    """This process, one task after another."""

    def __init__(self, listener: Listener | None = None) -> None:
        self._listener = listener
        self._waiting: deque[_Task] = deque()

    def submit(self, name: object, task: Callable[..., Any], *arguments: object) -> None:
        """Let a task wait for its turn."""
        self._waiting.append(_Task(name, task, arguments))

    def results(self) -> Iterator[tuple[Any, Any]]:
        """Yield name and result of each task as it ends."""
        global _to_here
        while self._waiting:
            task = self._waiting.popleft()
            _to_here = self._listener
            try:
                found = task.function(*task.arguments)
            finally:
                _to_here = None
            yield task.name, found


@dataclass(slots=True)
class _Task:
    name: object
    function: Callable[..., Any]
    arguments: tuple[object, ...]
    deaths: int = 0


@contextmanager
def local_engine(
    workers: int, listener: Listener | None = None, loads: Sequence[str] = ()
) -> Iterator[Engine]:
    """Give an engine.

    Args:
        workers: how many processes; one is this process.
        listener: hears what tasks tell.
        loads: modules that all tasks need.
    """
    if workers <= 1:
        yield InlineEngine(listener)
        return
    engine = LocalEngine(workers, listener, loads)
    try:
        yield engine
    finally:
        engine.close()
