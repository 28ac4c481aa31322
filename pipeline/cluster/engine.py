"""Where tasks run: processes of this machine, or Ray, on this machine or on many.

A task is a function of a module, with arguments that can be pickled; what it makes, it leaves on shared
storage. An engine hands tasks out, and hands results back as they come.
"""

from __future__ import annotations

import logging
import multiprocessing
import os
import socket
from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Protocol, TypeVar

from pipeline.errors import MissingLibrary, StadimeterError

# A task whose machine dies is begun again elsewhere; one that kills whatever it runs on is given up.
RETRIES = 3

T = TypeVar("T")


class WorkerLost(StadimeterError):
    """The process or machine that did a task died of it, or with it."""


class Engine(Protocol):
    """Runs tasks."""

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

    def __init__(self, workers: int) -> None:
        self._workers = workers
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
            done, _ = wait(self._running, return_when=FIRST_COMPLETED)
            for future in done:
                task = self._running.pop(future)
                if not isinstance(future.exception(), BrokenProcessPool):
                    yield task.name, future.result()
                    continue
                self._pool = None
                task.deaths += 1
                if task.deaths > RETRIES:
                    yield task.name, _lost(task.name, "its process ended")
                else:
                    self._waiting.append(task)

    def _begin(self) -> None:
        if self._pool is None:
            context = multiprocessing.get_context("spawn")
            self._pool = ProcessPoolExecutor(self._workers, mp_context=context)
        while self._waiting and len(self._running) < self._workers:
            task = self._waiting.popleft()
            try:
                self._running[self._pool.submit(task.function, *task.arguments)] = task
            except BrokenProcessPool:  # those that run will say so
                self._waiting.appendleft(task)
                return

    def close(self) -> None:
        """End the processes."""
        if self._pool is not None:
            self._pool.shutdown(cancel_futures=True)


class InlineEngine:
    """This process, one task after another."""

    def __init__(self) -> None:
        self._waiting: deque[_Task] = deque()

    def submit(self, name: object, task: Callable[..., Any], *arguments: object) -> None:
        """Let a task wait for its turn."""
        self._waiting.append(_Task(name, task, arguments))

    def results(self) -> Iterator[tuple[Any, Any]]:
        """Yield name and result of each task as it ends."""
        while self._waiting:
            task = self._waiting.popleft()
            yield task.name, task.function(*task.arguments)


@dataclass(slots=True)
class _Task:
    name: object
    function: Callable[..., Any]
    arguments: tuple[object, ...]
    deaths: int = 0


def _lost(name: object, why: object) -> WorkerLost:
    return WorkerLost(
        f"what worked on it died {RETRIES + 1} times: {why}",
        remedy=f"See whether memory ran out; `stadimeter inspect` tells what is in {name}",
    )


class RayEngine:
    """Tasks of Ray."""

    def __init__(self, ray: Any) -> None:
        self._ray = ray
        self._names: dict[Any, object] = {}

    def submit(self, name: object, task: Callable[..., Any], *arguments: object) -> None:
        """Begin a task, or let it wait for its turn."""
        # One core a task: threads that decode ahead would only compete with other tasks.
        remote = self._ray.remote(num_cpus=1, max_retries=RETRIES)(task)
        self._names[remote.remote(*arguments)] = name

    def results(self) -> Iterator[tuple[Any, Any]]:
        """Yield name and result of each task as it ends."""
        while self._names:
            (done, *_), _ = self._ray.wait(list(self._names), num_returns=1)
            name = self._names.pop(done)
            try:
                yield name, self._ray.get(done)
            except (
                self._ray.exceptions.WorkerCrashedError,
                self._ray.exceptions.NodeDiedError,
                self._ray.exceptions.ObjectLostError,
                self._ray.exceptions.OutOfMemoryError,
            ) as error:
                yield name, _lost(name, str(error).splitlines()[0])


@contextmanager
def local_engine(workers: int) -> Iterator[Engine]:
    """Give an engine of so many processes; one is this process."""
    if workers <= 1:
        yield InlineEngine()
        return
    engine = LocalEngine(workers)
    try:
        yield engine
    finally:
        engine.close()


def _knock(address: str) -> None:
    """Refuse an address where nobody answers: Ray would go on trying for minutes."""
    host, colon, port = address.removeprefix("ray://").rpartition(":")
    if not colon or not port.isdigit():
        return  # "auto", and names that Ray understands
    try:
        socket.create_connection((host, int(port)), timeout=10).close()
    except (OSError, OverflowError) as error:
        raise StadimeterError(
            f"no Ray cluster answers at {address}: {error}",
            remedy="`ray start --head` begins one; without --address a local one is started",
        ) from error


@contextmanager
def ray_engine(address: str | None, workers: int) -> Iterator[RayEngine]:
    """Give an engine on a running cluster, or, without an address, on a new one of this machine.

    A new one listens on the loopback interface alone, has no dashboard, and ends with the block.

    Raises:
        MissingLibrary: the extra `ray` is not installed.
        StadimeterError: there is no cluster at the address.
    """
    os.environ["RAY_USAGE_STATS_ENABLED"] = "0"
    if address is None:
        # Without this, Ray looks for the address of a network, and its servers listen to all of it.
        os.environ["RAY_ENABLE_WINDOWS_OR_OSX_CLUSTER"] = "0"
    try:
        import ray
    except ImportError as error:
        raise MissingLibrary(
            "the engine ray needs a library that is not installed: ray",
            remedy="Install stadimeter with its extra: pip install 'stadimeter[ray]'",
        ) from error
    if address is not None:
        _knock(address)
    here: dict[str, Any] = {
        "num_cpus": workers,
        "include_dashboard": False,
        "_node_ip_address": "127.0.0.1",
        "object_store_memory": 100 * 1024**2,  # tasks pass messages, not data
    }
    try:
        ray.init(
            address=address or "local",
            log_to_driver=False,
            logging_level=logging.ERROR,
            **({} if address else here),
        )
    except (ConnectionError, RuntimeError, ValueError) as error:
        raise StadimeterError(
            f"no Ray cluster could be had at {address or 'this machine'}: {error}",
            remedy="`ray start` begins one; without --address a local one is started",
        ) from error
    try:
        yield RayEngine(ray)
    finally:
        ray.shutdown()
