"""Cost of many machines: a task's overhead, two workers beside one, and a query over many parts.

The figures are those of the model in docs/scale.md.
"""

from __future__ import annotations

import argparse
import importlib.util
import os
import shutil
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

from bench.footage import street_pictures, write_recording
from pipeline.cli.console import out, print_rows
from pipeline.cluster.engine import ray_engine
from pipeline.cluster.manifest import Part, read_manifests, write_manifest
from pipeline.cluster.results_folder import merge, open_shared
from pipeline.cluster.shared_run import run_shared
from pipeline.core.config import Config
from pipeline.parallel.processes import local_engine

EMPTY_TASKS = 200
FRAMES = 500  # of a recording at 720p: 20 s
RECORDINGS = 4
FOLDERS = 100  # finished recordings, for questions


def nothing(number: int) -> int:
    """Do nothing, so that only the engine is measured."""
    return number


def seconds_of_empty_tasks(engine: str, workers: int) -> tuple[float, float]:
    """Return seconds until the first empty task is back, and seconds a task after that."""
    began = time.perf_counter()
    with ray_engine(None, workers) if engine == "ray" else local_engine(workers) as started:
        started.submit("first", nothing, 0)
        list(started.results())
        first_s = time.perf_counter() - began
        began = time.perf_counter()
        for number in range(EMPTY_TASKS):
            started.submit(number, nothing, number)
        list(started.results())
        return first_s, (time.perf_counter() - began) / EMPTY_TASKS


def seconds_of_run(paths: list[Path], folder: Path, engine: str, workers: int) -> float:
    """Return how long recordings take into a new folder, with as many cores as workers."""
    shutil.rmtree(folder, ignore_errors=True)
    with cores(workers):
        began = time.perf_counter()
        result = run_shared(paths, folder, Config(), engine=engine, workers=workers)
        took_s = time.perf_counter() - began
    if len(result.made) != len(paths):
        raise SystemExit(str([str(f.error) for f in result.failed]))
    return took_s


@contextmanager
def cores(count: int) -> Iterator[None]:
    """Limit this process and its children to a number of cores, if the system can do that."""
    if not hasattr(os, "sched_setaffinity"):
        yield
        return
    all_of_them = os.sched_getaffinity(0)
    os.sched_setaffinity(0, sorted(all_of_them)[:count])
    try:
        yield
    finally:
        os.sched_setaffinity(0, all_of_them)


def multiply(folder: Path, count: int) -> None:
    """Let one finished recording stand `count` times in a folder, each with files of its own."""
    original = next(iter(read_manifests(folder)))
    for number in range(1, count):
        key = f"{number:016x}"
        target = folder / "parts" / key / "copy"
        shutil.copytree((folder / next(iter(original.parts.values())).path).parent, target)
        parts = {
            name: Part(f"parts/{key}/copy/{name}.parquet", p.rows, p.size_bytes, p.sha256)
            for name, p in original.parts.items()
        }
        write_manifest(folder, replace(original, key=key, parts=parts))


def main() -> None:
    """Print overheads, the scaling, and how long questions take over many parts."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--folders", type=int, default=FOLDERS)
    arguments = parser.parse_args() if __name__ == "__main__" else parser.parse_args([])
    engines = ["local", "ray"] if importlib.util.find_spec("ray") else ["local"]
    rows = []
    for engine in engines:
        first_s, each_s = seconds_of_empty_tasks(engine, 2)
        rows.append([engine, f"{first_s:.1f}", f"{1000 * each_s:.1f}"])
    print_rows("Empty tasks, two workers", ("engine", "seconds to the first", "ms each"), rows)
    with tempfile.TemporaryDirectory(prefix="stadimeter-bench-") as name:
        folder = Path(name)
        pictures = street_pictures(100)
        paths = [folder / f"{i}.mcap" for i in range(RECORDINGS)]
        for index, path in enumerate(paths):
            write_recording(path, pictures, FRAMES + index)
        small = folder / "small.mcap"
        write_recording(small, pictures, 1)
        began = time.perf_counter()
        seconds_of_run([small], folder / "small", "local", 1)
        out.print(f"a recording of one frame, whole, in this process: {_since(began):.2f} s")
        rows = []
        for engine in engines:
            one_s, two_s = (seconds_of_run(paths, folder / engine, engine, n) for n in (1, 2))
            rows.append([engine, f"{one_s:.1f}", f"{two_s:.1f}", f"{one_s / two_s:.2f}"])
        print_rows(
            f"{RECORDINGS} recordings of {FRAMES} frames at 720p, start included, a core per worker",
            ("engine", "1 worker, s", "2 workers, s", "ratio"),
            rows,
        )
        _questions(folder / "local", arguments.folders, folder / "merged.duckdb")


def _questions(folder: Path, count: int, database: Path) -> None:
    for old in list((folder / "manifests").glob("*.json"))[1:]:
        old.unlink()
    multiply(folder, count)
    size = sum(p.size_bytes for p in next(iter(read_manifests(folder))).parts.values())
    rows = []
    began = time.perf_counter()
    with open_shared(folder) as store:
        rows.append(["open", f"{_since(began):.2f}"])
        for sql in (
            "SELECT count(*) FROM estimates",
            "FROM current_run",
            "FROM accuracy.by_method",
        ):
            began = time.perf_counter()
            store.query(sql)
            rows.append([sql, f"{_since(began):.2f}"])
    began = time.perf_counter()
    merge(folder, database)
    rows.append(["merge", f"{_since(began):.2f}"])
    print_rows(
        f"A folder of {count} recordings, {size / 1e3:,.0f} KB each", ("question", "seconds"), rows
    )


def _since(began: float) -> float:
    return time.perf_counter() - began


if __name__ == "__main__":
    main()
