"""One long recording on one core and on all: elapsed and processor time, and the same tables.

The parts of the work that are done once (a look for damage, stitching, estimating, storing) are printed
too: with the windows that are read twice they tell what many cores can give.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from bench.footage import FRAME_RATE, street_pictures, write_recording
from pipeline.cli.console import out, print_rows
from pipeline.core.config import Config
from pipeline.run.windows.course import usable_cores
from pipeline.run.windows.split import OVERLAP_S, WINDOW_S, windows_by_index

CHILD = """
import json, os, resource, sys, time
from pathlib import Path
from pipeline.core.config import Config
from pipeline.run.recordings import run
from pipeline.run.windows.split import hash_if_undamaged
path, database, workers = Path(sys.argv[1]), Path(sys.argv[2]), int(sys.argv[3])
if hasattr(os, "sched_setaffinity"):
    os.sched_setaffinity(0, sorted(os.sched_getaffinity(0))[:workers])
start, cpu = time.perf_counter(), os.times()
(outcome,) = run([path], database, Config(), workers=workers).outcomes
found = {"elapsed_s": time.perf_counter() - start, "sha256": outcome.tables_sha256}
found["stages"] = {name: spent.cpu_s for name, spent in outcome.times.spent.items()}
look = time.process_time()
hash_if_undamaged(path, Config())
found["look_s"] = time.process_time() - look
print(json.dumps(found))
"""
ONCE = ("stitch", "refine tracks", "store", "estimate")
MANY = 16


def measured(recording: Path, folder: Path, workers: int) -> dict[str, Any]:
    """Return times and the hash of the tables of a run by so many workers, a core each."""
    database = folder / f"{workers}.duckdb"
    command = [sys.executable, "-c", CHILD, str(recording), str(database), str(workers)]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    found: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return found


def modelled_efficiency(stages: dict[str, float], look_s: float, windows: int, cores: int) -> float:
    """Return the share of so many cores that does what one core would do as well.

    Amdahl's law, by processor times: windows in rounds of `cores`, then what is done once.

    Args:
        stages: seconds of each stage, of the windows of one core.
        look_s: seconds of the look for damage.
        windows: how many there are.
        cores: how many work.
    """
    once_s = sum(stages.get(name, 0.0) for name in ONCE)
    apart_s = sum(stages.values()) - once_s + look_s
    rounds = -(-windows // cores)
    beside_s = max(apart_s / cores, rounds * apart_s / windows)
    return (apart_s + once_s) / (cores * (beside_s + once_s))


def main() -> None:
    """Print the times by one worker and by one a core, and what the parts say of more cores."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--minutes", type=float, default=10.0)
    arguments = parser.parse_args(sys.argv[1:] if __name__ == "__main__" else [])
    cores = usable_cores()
    with tempfile.TemporaryDirectory(prefix="stadimeter-bench-") as name:
        folder = Path(name)
        recording = folder / "long.mcap"
        write_recording(recording, street_pictures(150), round(60 * arguments.minutes * FRAME_RATE))
        found = {n: measured(recording, folder, n) for n in sorted({1, cores})}
        made = len(windows_by_index(recording, Config(), WINDOW_S)) or 1
    rows = [
        [f"{n}", f"{f['elapsed_s']:.1f}", f"{sum(f['stages'].values()):.1f}", f["sha256"][:12]]
        for n, f in found.items()
    ]
    title = f"{arguments.minutes:g} minutes of 720p by workers, a core each"
    print_rows(title, ("workers", "elapsed s", "cpu s of stages", "tables"), rows)
    out.print(f"{found[1]['elapsed_s'] / found[cores]['elapsed_s']:.2f} times as fast")
    one = found[1]
    once = ", ".join(f"{name} {one['stages'].get(name, 0.0):.1f} s" for name in ONCE)
    out.print(f"done once: {once}; the look for damage {one['look_s']:.1f} s beside the windows")
    for windows in (2, MANY, 10 * MANY):
        n = min(windows, MANY)
        longer = windows / made  # all parts grow with the recording
        stages = {name: seconds * longer for name, seconds in one["stages"].items()}
        share = modelled_efficiency(stages, one["look_s"] * longer, windows, n)
        out.print(f"by these parts, {windows} windows on {n} cores: efficiency {share:.2f}")
    out.print(f"{OVERLAP_S / WINDOW_S:.0%} of a very long recording is read twice")


if __name__ == "__main__":
    main()
