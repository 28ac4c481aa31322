"""Processes that end when the one that started them ends, however it ended."""

from __future__ import annotations

import multiprocessing
import os
import threading


def die_with_parent() -> None:
    """Watch the parent from a thread; a worker whose parent was killed would wait for ever."""
    parent = multiprocessing.parent_process()
    if parent is None:
        return

    def watch() -> None:
        parent.join()
        os._exit(1)

    threading.Thread(target=watch, name="lifeline", daemon=True).start()
