"""End-to-end speed beside decoding alone and beside a user's own script, in one run, as ratios.

Two lengths of a recording tell what a frame costs from what a run costs however short it is (making the
database, loading libraries). Settings that trade pixels for time show what they do to the boxes.
"""

from __future__ import annotations

import argparse
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np
import pandas as pd
import pyarrow.parquet as pq

from bench import naive
from bench.footage import (
    FULL_HD,
    HD,
    Size,
    empty_street_pictures,
    street_pictures,
    write_recording,
)
from dashboards.timeline.split import write_timelines
from pipeline.cli.console import out, print_rows
from pipeline.core.config import MIN_SIDE_PX, Config
from pipeline.core.diagnostics import Notes
from pipeline.core.timing import StageTimes
from pipeline.images.decode import Picture, decode
from pipeline.ingest.frames import FrameAssembler
from pipeline.mcap_file.reader import McapFile
from pipeline.parallel.prefetch import ahead
from pipeline.run.pass_one import measure_recording
from pipeline.run.picture_stream import READ_TOGETHER
from pipeline.run.recording import Timelines
from pipeline.run.recordings import run

FRAMES, LONG = 600, 1500
SCRIPT_FRAMES = 200  # its time is in proportion to them
ROUNDS = 3
CORES = os.cpu_count() or 1
GREY, COLOUR, SCRIPT = "decode, grey", "decode, colour", "a user's script"
RUN, RUN_LONG, RUN_RRD = "run", "run, long", "run --rrd, long"
FLOOR, RUN_EMPTY = "read and decode, as the run", "run, long, nobody there"
FLAGS = {
    GREY: cv2.IMREAD_GRAYSCALE,
    COLOUR: cv2.IMREAD_COLOR,
    "decode, colour at half size": cv2.IMREAD_REDUCED_COLOR_2,
    "decode, colour at a quarter": cv2.IMREAD_REDUCED_COLOR_4,
}
# What is shown of a setting: at which share of the picture motion is looked for.
REDUCTIONS = (1, 2, 4)
SAME_IOU = 0.5


class Took(NamedTuple):
    """Seconds of a job: elapsed, and of all processors."""

    elapsed_s: float
    cpu_s: float


def main() -> None:
    """Measure 720p and 1080p, several rounds, and print medians and ratios; then workers."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--rounds", type=int, default=ROUNDS)
    arguments = parser.parse_args(sys.argv[1:] if __name__ == "__main__" else [])
    for size in (HD, FULL_HD):
        with tempfile.TemporaryDirectory(prefix="stadimeter-bench-") as name:
            _one_size(size, Path(name), arguments.rounds)


def _one_size(size: Size, folder: Path, rounds: int) -> None:
    pictures = street_pictures(150, size)
    short, long, script = (folder / f"{name}.mcap" for name in ("short", "long", "script"))
    for path, frames in ((short, FRAMES), (long, LONG), (script, SCRIPT_FRAMES)):
        write_recording(path, pictures, frames, size)
    kilobytes = np.mean([len(p) for p in pictures]) / 1e3
    what = f"{size.width_px}x{size.height_px}"
    out.print(f"JPEG of {what}, {kilobytes:.0f} KB a frame, {CORES} cores")
    empty = folder / "empty.mcap"
    write_recording(empty, empty_street_pictures(20, size), LONG, size)
    times = measure(_jobs(folder, pictures, short, long, script, empty), rounds)
    _print_speed(what, times)
    _print_share_of_output(long, folder)
    _print_settings(size, short, folder)
    if size == HD:
        _print_workers(pictures, folder, rounds)


def _jobs(
    folder: Path, pictures: list[bytes], short: Path, long: Path, script: Path, empty: Path
) -> dict[str, Callable[[], object]]:
    def fresh() -> Path:
        (folder / "a.duckdb").unlink(missing_ok=True)
        return folder / "a.duckdb"

    jobs: dict[str, Callable[[], object]] = {
        label: lambda flag=flag: decode_all(pictures, FRAMES, flag)  # type: ignore[misc]
        for label, flag in FLAGS.items()
    }
    jobs[FLOOR] = lambda: read_and_decode(short)
    jobs[RUN] = lambda: run([short], fresh(), Config())
    jobs[RUN_LONG] = lambda: run([long], fresh(), Config())
    jobs[RUN_RRD] = lambda: run(
        [long], fresh(), Config(), timelines=Timelines(folder, write_timelines)
    )
    jobs[RUN_EMPTY] = lambda: run([empty], fresh(), Config())
    jobs[SCRIPT] = lambda: naive.main(script, folder / "c.duckdb")
    return jobs


def decode_all(pictures: list[bytes], frames: int, flag: int) -> None:
    """Decode as many pictures as the recording has, in threads, and do nothing else."""
    arrays = [np.frombuffer(p, np.uint8) for p in pictures]
    with ThreadPoolExecutor(CORES) as pool:
        for _ in pool.map(
            lambda i: cv2.imdecode(arrays[i % len(arrays)], flag) is None, range(frames)
        ):
            pass


def read_and_decode(recording: Path) -> None:
    """Read and decode a recording as a run does, and do nothing else: no run can be faster."""
    config = Config()
    file = McapFile(recording, config.limits, lambda note: None)
    frames = FrameAssembler(file, config.ingest, Notes())
    waiting: deque[Future[Picture]] = deque()
    with ThreadPoolExecutor(CORES) as pool:
        for frame in ahead(frames, READ_TOGETHER):
            waiting.append(pool.submit(decode, frame.image, max_pixels=config.limits.image_pixels))
            if len(waiting) > 2 * CORES + 2:
                waiting.popleft().result()
        for left in waiting:
            left.result()


def measure(jobs: dict[str, Callable[[], object]], rounds: int) -> dict[str, Took]:
    """Return the medians of each job over rounds in which each runs once."""
    took: dict[str, list[Took]] = {label: [] for label in jobs}
    for _ in range(rounds):
        for label, job in jobs.items():
            elapsed, cpu = time.perf_counter(), time.process_time()
            job()
            took[label].append(Took(time.perf_counter() - elapsed, time.process_time() - cpu))
    return {
        label: Took(*(statistics.median(one) for one in zip(*all_of, strict=True)))
        for label, all_of in took.items()
    }


def _print_speed(what: str, times: dict[str, Took]) -> None:
    frames = dict.fromkeys(times, FRAMES) | dict.fromkeys((RUN_LONG, RUN_RRD, RUN_EMPTY), LONG)
    frames[SCRIPT] = SCRIPT_FRAMES
    each = {
        label: Took(took.elapsed_s / frames[label], took.cpu_s / frames[label])
        for label, took in times.items()
    }
    more = LONG - FRAMES
    frame = Took(*((b - a) / more for a, b in zip(times[RUN], times[RUN_LONG], strict=True)))
    fixed = Took(*(t - FRAMES * f for t, f in zip(times[RUN], frame, strict=True)))
    each["run, one more frame"] = frame
    rows = [
        [
            label,
            f"{frames.get(label, '')}",
            f"{1 / took.elapsed_s:,.0f}",
            f"{took.elapsed_s * 1e3:.2f}",
            f"{took.cpu_s * 1e3:.2f}",
            f"{took.elapsed_s / each[GREY].elapsed_s:.2f}",
            f"{took.cpu_s / each[GREY].cpu_s:.2f}",
            f"{took.elapsed_s / each[COLOUR].elapsed_s:.2f}",
        ]
        for label, took in each.items()
    ]
    header = ("", "frames", "frames/s", "ms", "cpu ms", "/ grey", "cpu / grey", "/ colour")
    print_rows(f"Speed at {what}, a frame", header, rows)
    out.print(
        f"a run's fixed cost: {fixed.elapsed_s:.2f} s, {fixed.cpu_s:.2f} s of a processor "
        "(a new database, libraries, the learning of the background)"
    )
    out.print(
        "to read and decode alone, as the run does, takes "
        f"{each[FLOOR].elapsed_s / each[GREY].elapsed_s:.2f} times as long as to decode to grey, and "
        f"{each[FLOOR].cpu_s / each[GREY].cpu_s:.2f} times the processor time"
    )
    faster = each[SCRIPT].elapsed_s / each[RUN].elapsed_s
    out.print(
        f"{FRAMES} frames end to end: {faster:.1f} times as fast as the script; "
        f"{LONG}: {each[SCRIPT].elapsed_s / each[RUN_LONG].elapsed_s:.1f} times"
    )


def _print_share_of_output(recording: Path, folder: Path) -> None:
    shown = Timelines(folder, write_timelines)
    begin = time.perf_counter()
    result = run([recording], folder / "share.duckdb", Config(), timelines=shown)
    whole_s = time.perf_counter() - begin
    times = result.outcomes[0].times
    shares = {s: times.spent[s].elapsed_s / whole_s for s in ("store", "timeline")}
    out.print(
        f"of the time of `run --rrd`, {shares['store']:.1%} goes into the database and "
        f"{shares['timeline']:.1%} into the timeline"
    )


def _print_settings(size: Size, recording: Path, folder: Path) -> None:
    """Show what smaller pictures do to the boxes, beside those found in every pixel."""
    found, times = {}, {}
    for reduction in REDUCTIONS:
        config = Config()
        side_px = size.height_px // reduction
        config = replace(config, detect=replace(config.detect, min_side_px=side_px))
        times[reduction] = StageTimes()
        parts = folder / f"by {reduction}"
        measure_recording(recording, config, parts, threads=CORES, times=times[reduction])
        found[reduction] = pq.read_table(parts / "observations.parquet").to_pandas()
    usual = next(r for r in (8, 4, 2, 1) if size.height_px // r >= MIN_SIDE_PX)
    rows = []
    for reduction in REDUCTIONS:
        cpu_ms = sum(spent.cpu_s for spent in times[reduction].spent.values()) / FRAMES * 1e3
        cells = _difference(found[1], found[reduction])
        rows.append(
            [
                f"1/{reduction}" + (" (default)" if reduction == usual else ""),
                f"{cpu_ms:.2f}",
                *cells,
            ]
        )
    header = (
        "size",
        "cpu ms",
        "boxes",
        "matched",
        "foot px",
        "head px",
        "height",
        "95 % of heights",
    )
    print_rows(
        f"Boxes at {size.height_px} lines by the size of the picture, against 1/1 (medians)",
        header,
        rows,
    )


def _difference(full: pd.DataFrame, other: pd.DataFrame) -> list[str]:
    """Return how many boxes there are, and how those of the same person and frame differ."""
    pairs = full.merge(other, on="frame_index", suffixes=("", "_b"))
    width = np.minimum(pairs.x_max_px, pairs.x_max_px_b) - np.maximum(
        pairs.x_min_px, pairs.x_min_px_b
    )
    tall = np.minimum(pairs.y_max_px, pairs.y_max_px_b) - np.maximum(
        pairs.y_min_px, pairs.y_min_px_b
    )
    shared = np.clip(width, 0, None) * np.clip(tall, 0, None)
    area = (pairs.x_max_px - pairs.x_min_px) * (pairs.y_max_px - pairs.y_min_px)
    area_b = (pairs.x_max_px_b - pairs.x_min_px_b) * (pairs.y_max_px_b - pairs.y_min_px_b)
    same = pairs[shared / (area + area_b - shared) > SAME_IOU]
    height, height_b = same.y_max_px - same.y_min_px, same.y_max_px_b - same.y_min_px_b
    off = np.abs(height_b / height - 1)
    return [
        f"{len(other):,}",
        f"{same.observation_index.nunique() / len(full):.1%}",
        f"{np.abs(same.y_max_px_b - same.y_max_px).median():.2f}",
        f"{np.abs(same.y_min_px_b - same.y_min_px).median():.2f}",
        f"{off.median():.1%}",
        f"{off.quantile(0.95):.1%}",
    ]


# One worker on one core, then as many on all: a recording each.
WORKERS = """
import os, sys, time
from pathlib import Path
from pipeline.core.config import MIN_SIDE_PX, Config
from pipeline.run.recordings import run
workers = int(sys.argv[1])
if hasattr(os, "sched_setaffinity"):
    os.sched_setaffinity(0, range(workers))
if __name__ == "__main__":
    start = time.perf_counter()
    run(map(Path, sys.argv[3:]), Path(sys.argv[2]), Config(), workers=workers)
    print(time.perf_counter() - start)
"""


def _print_workers(pictures: list[bytes], folder: Path, rounds: int) -> None:
    copies = []
    for index in range(2 * CORES):
        copies.append(folder / f"copy {index}.mcap")
        write_recording(copies[-1], pictures, FRAMES + index)  # no two are the same file
    script = folder / "workers.py"
    script.write_text(WORKERS)
    seconds: dict[int, list[float]] = {1: [], CORES: []}
    for _ in range(rounds):
        for workers, all_of in seconds.items():
            database = folder / "workers.duckdb"
            database.unlink(missing_ok=True)
            command = [sys.executable, script, str(workers), database, *copies]
            done = subprocess.run(command, check=True, capture_output=True, text=True)
            all_of.append(float(done.stdout))
    one, several = (statistics.median(s) for s in seconds.values())
    out.print(
        f"{len(copies)} recordings: {one:.1f} s by one worker on one core, "
        f"{several:.1f} s by {CORES} on {CORES}: {one / several:.2f} times as fast"
    )


if __name__ == "__main__":
    main()
