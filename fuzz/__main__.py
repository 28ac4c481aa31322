"""Fuzz each target in a process of its own, under the bounds that a user may count on.

    python -m fuzz [--inputs N] [TARGET...]

No crash, no input that takes over ten seconds, no more than a gigabyte. With `atheris` inputs are
found by the code that they reach; where it has no wheel for the Python, by mutation alone.
What is found lies in `out/fuzz`, and belongs into `tests/fuzzed/TARGET` when it is mended.
"""

from __future__ import annotations

import argparse
import importlib.util
import re
import subprocess
import sys
import time
from pathlib import Path

SHARES = {"reader": 0.4, "message": 0.4, "picture": 0.1, "config": 0.1}
INPUTS = 120_000


def main() -> int:
    """Run the targets one after the other; return 1 if anything was found."""
    parser = argparse.ArgumentParser(prog="python -m fuzz")
    parser.add_argument("targets", nargs="*", metavar="TARGET", help=f"of {', '.join(SHARES)}")
    parser.add_argument("--inputs", type=int, default=INPUTS, help="in all, over the targets")
    parser.add_argument("--seed", type=int, default=0, help="of chance; 0: another one each time")
    parser.add_argument("--mutate", action="store_true", help="by mutation alone")
    arguments = parser.parse_args()
    targets = arguments.targets or [*SHARES]
    guided = importlib.util.find_spec("atheris") is not None and not arguments.mutate
    share = sum(SHARES[t] for t in targets)
    print(f"fuzzing {'guided by coverage (atheris)' if guided else 'by mutation'}", flush=True)
    total, failed = 0, []
    for target in targets:
        count = round(arguments.inputs * SHARES[target] / share)
        worker = "fuzz.guided" if guided else "fuzz.mutating"
        found = Path("out/fuzz") / target
        found.mkdir(parents=True, exist_ok=True)
        command = [
            sys.executable,
            "-m",
            worker,
            target,
            str(count),
            str(arguments.seed),
            str(found),
        ]
        started = time.monotonic()
        done = subprocess.run(command, capture_output=True, text=True, errors="replace")
        took_s = time.monotonic() - started
        ran = _ran(done.stdout + done.stderr)
        total += ran
        print(f"{target:8} {ran:>8,} inputs  {took_s:6.1f} s  {_peak(done.stderr)}", flush=True)
        if done.returncode:
            failed.append(target)
            print(done.stdout[-1000:], done.stderr[-6000:], sep="\n")
    print(
        f"{total:,} inputs in all; " + (f"failed: {', '.join(failed)}" if failed else "no failure")
    )
    return 1 if failed else 0


def _ran(text: str) -> int:
    found = re.findall(r"Done (\d+) runs|stat::number_of_executed_units: *(\d+)", text)
    return max((int(n) for pair in found for n in pair if n), default=0)


def _peak(text: str) -> str:
    found = re.findall(r"stat::peak_rss_mb: *(\d+)", text)
    return f"peak {found[-1]} MB" if found else ""


if __name__ == "__main__":
    sys.exit(main())
