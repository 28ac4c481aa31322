"""Whether memory is flat in the length of a recording: the peak of whole processes."""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from pathlib import Path

from bench.footage import street_pictures, write_recording
from pipeline.console import out, print_rows

SECONDS = (20, 60, 240)
FRAME_RATE = 25
CHILD = """
import resource, sys
from pathlib import Path
from pipeline.config import Config
from pipeline.run import run
if len(sys.argv) > 1:
    run([Path(sys.argv[1])], Path(sys.argv[2]), Config())
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
"""


def peak_mb(*arguments: Path) -> float:
    """Return the peak memory of a process that runs on a recording, or only imports."""
    command = [sys.executable, "-c", CHILD, *map(str, arguments)]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    kilobytes = int(done.stdout.splitlines()[-1])
    return kilobytes / 1e3 if sys.platform != "darwin" else kilobytes / 1e6


def main() -> None:
    """Print peaks above the imports for recordings of several lengths."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--seconds", type=int, nargs="*", default=list(SECONDS))
    seconds = parser.parse_args().seconds if __name__ == "__main__" else list(SECONDS)
    with tempfile.TemporaryDirectory(prefix="stadimeter-bench-") as name:
        folder = Path(name)
        base_mb = peak_mb()
        pictures, rows = street_pictures(150), []
        for length_s in seconds:
            recording = folder / f"{length_s}.mcap"
            write_recording(recording, pictures, length_s * FRAME_RATE)
            above = peak_mb(recording, folder / f"{length_s}.duckdb") - base_mb
            rows.append([f"{length_s} s", f"{length_s * FRAME_RATE:,}", f"{above:.0f}"])
            recording.unlink()
    out.print(f"imports alone: {base_mb:.0f} MB")
    print_rows("Memory at 720p", ("length", "frames", "MB above imports"), rows)


if __name__ == "__main__":
    main()
