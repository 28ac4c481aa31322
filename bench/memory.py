"""Peak memory of whole processes for recordings of several lengths: it should not grow."""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path

from bench.footage import FRAME_RATE, street_pictures, write_people, write_recording
from pipeline.cli.console import out, print_rows

PIXELS_S, ROWS_S = (20, 60, 240), (60, 600, 3600)
# The peak that the kernel keeps for `getrusage` starts with that of the process that started this one;
# that of the status file is this program's own.
CHILD = """
import resource, sys
from pathlib import Path
from pipeline.core.config import Config
from pipeline.run.recordings import run
if len(sys.argv) > 1:
    run([Path(sys.argv[1])], Path(sys.argv[2]), Config(), workers=1)
else:
    import pandas, scipy.optimize, pyarrow.dataset  # what a run loads on its way
if sys.platform == "linux":
    status = Path("/proc/self/status").read_text()
    print(1024 * int(status.partition("VmHWM:")[2].split()[0]))
else:
    print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
"""


def peak_mb(*arguments: Path) -> float:
    """Return the peak memory of a process that runs on a recording, or only imports."""
    command = [sys.executable, "-c", CHILD, *map(str, arguments)]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    return int(done.stdout.splitlines()[-1]) / 1e6


def main() -> None:
    """Print peaks above the imports for recordings of several lengths."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--seconds", type=int, nargs="*", default=list(PIXELS_S))
    parser.add_argument("--rows-seconds", type=int, nargs="*", default=list(ROWS_S))
    arguments = parser.parse_args(sys.argv[1:] if __name__ == "__main__" else [])
    base_mb = peak_mb()
    out.print(f"imports alone: {base_mb:.0f} MB")
    pictures = street_pictures(150)
    _print_peaks(
        "Memory with pictures of 720p",
        arguments.seconds,
        lambda path, frames: write_recording(path, pictures, frames),
        base_mb,
    )
    _print_peaks(
        "Memory with five people in recorded boxes, small pictures",
        arguments.rows_seconds,
        write_people,
        base_mb,
    )


def _print_peaks(
    title: str, lengths_s: Sequence[int], write: Callable[[Path, int], None], base_mb: float
) -> None:
    rows = []
    with tempfile.TemporaryDirectory(prefix="stadimeter-bench-") as name:
        folder = Path(name)
        for length_s in lengths_s:
            recording = folder / f"{length_s}.mcap"
            write(recording, length_s * FRAME_RATE)
            above = peak_mb(recording, folder / f"{length_s}.duckdb") - base_mb
            rows.append([f"{length_s} s", f"{length_s * FRAME_RATE:,}", f"{above:.0f}"])
            recording.unlink()
    print_rows(title, ("length", "frames", "MB above imports"), rows)


if __name__ == "__main__":
    main()
