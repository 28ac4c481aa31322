"""Ray as an engine that runs tasks, on this machine or on many.

A task is a function of a module, with arguments that can be pickled; what it makes, it leaves on shared
storage.
"""

from __future__ import annotations

import logging
import os
import socket
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from pipeline.core.errors import MissingLibrary, StadimeterError
from pipeline.core.extras import how_to_install
from pipeline.parallel.processes import RETRIES, lost


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
                yield name, lost(name, str(error).splitlines()[0])


def _knock(address: str) -> None:
    """Refuse an address that does not answer: Ray would go on trying for minutes."""
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
            remedy=how_to_install("ray"),
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
            f"no Ray cluster could be started or reached at {address or 'this machine'}: {error}",
            remedy="`ray start` begins one; without --address a local one is started",
        ) from error
    try:
        yield RayEngine(ray)
    finally:
        ray.shutdown()
