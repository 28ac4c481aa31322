"""A database of its own for a recording, whose rows then go elsewhere as files.

One process at a time writes to a database. Processes and machines that work side by side therefore write
to one each, for as long as a recording takes, and whoever collects what they made takes it in unchanged.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from pipeline import __version__
from pipeline.store.database import Store
from pipeline.store.runs import start_run

# What is asked of a database while rows go into it; to make all views takes five times as long.
_VIEWS = ("accuracy.match_candidates", "main.current_run", "main.exposure_checks")


@dataclass(frozen=True, slots=True)
class Begun:
    """A run, as the databases of all of its recordings know it."""

    run_id: str
    label: str | None
    configuration: str
    libraries: str

    def enter(self, store: Store) -> None:
        """Enter the run."""
        start_run(
            store, "run", self.label, self.configuration, self.libraries, __version__, self.run_id
        )


@contextmanager
def own_store(begun: Begun, folder: Path | None = None, *, roomy: bool = False) -> Iterator[Store]:
    """Give an empty database that is gone afterwards, with the run's row; it lies in a folder."""
    with tempfile.TemporaryDirectory(prefix="stadimeter-", dir=folder) as name:
        path = Path(name) / "one.duckdb"
        path.write_bytes(empty_database())
        with Store.hold(path, roomy=roomy) as store:
            begun.enter(store)
            yield store


@cache
def empty_database() -> bytes:
    """Return a database without rows; to make one takes longer than to copy it."""
    with tempfile.TemporaryDirectory(prefix="stadimeter-") as name:
        path = Path(name) / "empty.duckdb"
        with Store.hold(path) as store:
            store.prepare(_VIEWS)
        return path.read_bytes()
