"""`stadimeter` with faults: a stage fails on a recording whose name has the stage in it.

    python tests/support/poisoned_run.py run bad-estimate.mcap good.mcap --db x.duckdb

Tasks go out inside a function of this module, so that whichever process runs them imports it, and with
it the faults.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from typing import Any

import cv2
import duckdb
import numpy as np

import pipeline.cluster.results_folder
import pipeline.cluster.tasks
import pipeline.run.recording
import pipeline.run.recordings
import pipeline.run.windows.tasks
from pipeline.core.errors import StoreError
from pipeline.parallel.processes import Engine
from pipeline.store.database import Store

# stage, functions of it (as the modules that call them know them), and the error
STAGES: dict[str, tuple[str, BaseException]] = {
    "measure": ("measure_recording", MemoryError("9,000 boxes")),
    "replace": ("replace_recording", duckdb.ConversionException("a row that is none")),
    "inside": ("keep_tables_sha256", duckdb.InternalException("an error inside DuckDB")),
    "estimate": ("estimate_recording", np.linalg.LinAlgError("Singular matrix")),
    "judge": ("judge_tracking", cv2.error("after a clock jump")),
    "rows": ("write_rows", StoreError("rows that are none")),
    "take": ("take_once", duckdb.ConstraintException("a row twice")),
}
MODULES = (
    pipeline.run.recording,
    pipeline.run.recordings,
    pipeline.run.windows.tasks,
    pipeline.cluster.tasks,
    pipeline.cluster.results_folder,
)


def _is_bad(stage: str, values: tuple[object, ...]) -> bool:
    names = [str(value) for value in values if not isinstance(value, Store)]
    if not any("bad-" in name for name in names):
        for store in values:
            if isinstance(store, Store):
                names += [
                    r[0] for r in store.connection.execute("SELECT path FROM recordings").fetchall()
                ]
    return any(f"bad-{stage}" in name for name in names)


def failing(stage: str, whole: Callable[..., Any]) -> Callable[..., Any]:
    """Return a function of a stage that fails on recordings with the stage in their names."""
    error = STAGES[stage][1]

    def call(*arguments: object, **named: object) -> object:
        if _is_bad(stage, (*arguments, *named.values())):
            raise error
        return whole(*arguments, **named)

    call.is_poisoned = True  # type: ignore[attr-defined]
    return call


def poison() -> None:
    """Put the faults into the stages of this process, once."""
    for stage, (name, _) in STAGES.items():
        for module in MODULES:
            whole = getattr(module, name, None)
            if whole is not None and not getattr(whole, "is_poisoned", False):
                setattr(module, name, failing(stage, whole))


def call(task: Callable[..., Any], *arguments: object) -> object:
    """Do a task where the faults are."""
    poison()
    return task(*arguments)


class PoisonedEngine:
    """An engine whose tasks go through `call`."""

    def __init__(self, engine: Engine) -> None:
        self._engine = engine

    def submit(self, name: object, task: Callable[..., Any], *arguments: object) -> None:
        """Begin a task."""
        self._engine.submit(name, call, task, *arguments)

    def results(self) -> Iterator[tuple[Any, Any]]:
        """Yield what the engine yields."""
        return self._engine.results()


def _poisoned(
    engine_of: Callable[..., AbstractContextManager[Engine]],
) -> Callable[..., AbstractContextManager[Engine]]:
    @contextmanager
    def give(*arguments: object, **named: object) -> Iterator[Engine]:
        with engine_of(*arguments, **named) as engine:
            yield PoisonedEngine(engine)

    return give


def main() -> int:
    """Run the command line with engines whose tasks fail."""
    import pipeline.cluster.shared_run as shared_run

    poison()
    from pipeline.cli import main as command_line

    for module, name in (
        (pipeline.run.recordings, "local_engine"),
        (shared_run, "local_engine"),
        (shared_run, "ray_engine"),
    ):
        setattr(module, name, _poisoned(getattr(module, name)))
    return command_line()


if __name__ == "__main__":
    from tests.support import poisoned_run  # under the name by which a worker finds `call`

    sys.exit(poisoned_run.main())
