"""End-to-end speed beside decoding alone and beside a user's own script, in one run, as ratios."""

from __future__ import annotations

import statistics
import tempfile
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import cv2
import numpy as np

from bench import naive
from bench.footage import street_pictures, write_recording
from pipeline.config import Config
from pipeline.console import out, print_rows
from pipeline.run import run

FRAMES = 600
ROUNDS = 3
SCRIPT = "a user's script"
THREADS = 2
FLAGS = {
    "decode, colour": cv2.IMREAD_COLOR,
    "decode, grey": cv2.IMREAD_GRAYSCALE,
    "decode, colour at half size": cv2.IMREAD_REDUCED_COLOR_2,
}


def main() -> None:
    """Measure in turn, several rounds, and print medians and ratios."""
    with tempfile.TemporaryDirectory(prefix="stadimeter-bench-") as name:
        folder = Path(name)
        recording = folder / "bench.mcap"
        pictures = street_pictures(150)
        write_recording(recording, pictures, FRAMES)
        jobs: dict[str, Callable[[], object]] = {
            label: lambda flag=flag: decode_all(pictures, FRAMES, flag)  # type: ignore[misc]
            for label, flag in FLAGS.items()
        }
        jobs["stadimeter run"] = lambda: run([recording], folder / "a.duckdb", Config())
        jobs["stadimeter run --rrd"] = lambda: run(
            [recording], folder / "b.duckdb", Config(), timelines=folder
        )
        jobs[SCRIPT] = lambda: naive.main(recording, folder / "c.duckdb")
        times = measure(jobs)
    size_kb = np.mean([len(p) for p in pictures]) / 1e3
    ours = times["stadimeter run"]
    rows = [
        [
            label,
            f"{FRAMES / seconds:,.0f}",
            f"{seconds / FRAMES * 1e3:.2f}",
            f"{seconds / ours:.2f}",
        ]
        for label, seconds in times.items()
    ]
    out.print(f"{FRAMES} frames of 1280x720 JPEG, {size_kb:.0f} KB each, {THREADS} threads")
    print_rows("Speed", ("", "frames/s", "ms a frame", "time / ours"), rows)
    out.print(f"end to end takes {ours / times['decode, colour']:.2f} times decoding in colour,")
    out.print(f"{ours / times['decode, grey']:.2f} times decoding in grey,")
    out.print(f"and is {times[SCRIPT] / ours:.1f} times as fast as the script")


def decode_all(pictures: list[bytes], frames: int, flag: int) -> None:
    """Decode as many pictures as the recording has, in threads, and do nothing else."""
    arrays = [np.frombuffer(p, np.uint8) for p in pictures]
    with ThreadPoolExecutor(THREADS) as pool:
        for _ in pool.map(
            lambda i: cv2.imdecode(arrays[i % len(arrays)], flag) is None, range(frames)
        ):
            pass


def measure(jobs: dict[str, Callable[[], object]]) -> dict[str, float]:
    """Return the median seconds of each job over rounds in which each runs once."""
    seconds: dict[str, list[float]] = {label: [] for label in jobs}
    for _ in range(ROUNDS):
        for label, job in jobs.items():
            start = time.perf_counter()
            job()
            seconds[label].append(time.perf_counter() - start)
    return {label: statistics.median(values) for label, values in seconds.items()}


if __name__ == "__main__":
    main()
