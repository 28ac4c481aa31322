"""Making the next items in a thread of their own while the last ones are used."""

from __future__ import annotations

import threading
from collections.abc import Iterable, Iterator
from queue import Empty, Queue
from typing import Generic, TypeVar

T = TypeVar("T")

LOOK_S = 0.1  # how long the thread may take to notice that nobody wants its items any more


class _End(Generic[T]):
    """Mark of the end in the queue, with the error that ended the items, if any."""

    def __init__(self, error: BaseException | None) -> None:
        self.error = error


def ahead(items: Iterable[T], limit: int) -> Iterator[T]:
    """Yield the items in order; up to `limit` of them are made before they are asked for.

    What making an item raises is raised here, after the items before it. When the caller stops early,
    so does the thread.
    """
    queue: Queue[T | _End[T]] = Queue(limit)
    stop = threading.Event()

    def make() -> None:
        error: BaseException | None = None
        try:
            for item in items:
                queue.put(item)
                if stop.is_set():
                    return
        except BaseException as problem:
            error = problem
        queue.put(_End(error))

    thread = threading.Thread(target=make, name="ahead", daemon=True)
    thread.start()
    try:
        while True:
            item = queue.get()
            if isinstance(item, _End):
                if item.error is not None:
                    raise item.error
                return
            yield item
    finally:
        stop.set()
        while thread.is_alive():
            try:
                queue.get(timeout=LOOK_S)  # it may be waiting for room
            except Empty:
                thread.join(timeout=LOOK_S)
