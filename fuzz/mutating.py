"""One target under mutation alone: for a Python for which there is no atheris."""

from __future__ import annotations

import hashlib
import random
import resource
import signal
import sys
import time
from pathlib import Path

from fuzz.seeds import seeds
from fuzz.targets import TARGETS

MAX_BYTES = 8192
MEMORY_MB, SECONDS = 1024, 10
_TELLING = (0, 1, 0x7F, 0x80, 0xFF)


def mutated(data: bytes, others: list[bytes], chance: random.Random) -> bytes:
    """Return bytes with a few changes: of bits, bytes, lengths, pieces left out, put in, doubled."""
    out = bytearray(data)
    for _ in range(chance.randint(1, 6)):
        at = chance.randrange(len(out) + 1)
        size = min(chance.choice((1, 2, 4, 8, 16, 64)), len(out) - at)
        kind = chance.randrange(6)
        if kind == 0 and at < len(out):
            out[at] ^= 1 << chance.randrange(8)
        elif kind == 1:
            out[at : at + size] = bytes(chance.choice(_TELLING) for _ in range(size))
        elif kind == 2:
            del out[at : at + size]
        elif kind == 3:
            out[at:at] = out[at : at + size]
        elif kind == 4:
            out[at : at + size] = chance.randrange(1 << 64).to_bytes(8, "little")[:size]
        else:
            other = chance.choice(others)
            start = chance.randrange(len(other) + 1)
            out[at:at] = other[start : start + 64]
    return bytes(out[:MAX_BYTES])


def main() -> None:
    """Run `fuzz.mutating TARGET INPUTS SEED FOLDER`."""
    name, inputs, seed, found = sys.argv[1], int(sys.argv[2]), int(sys.argv[3]), Path(sys.argv[4])
    target, known = TARGETS[name], list(seeds(name))
    chance = random.Random(seed or time.time_ns())  # noqa: S311
    signal.signal(signal.SIGALRM, _hangs)
    for count in range(inputs):
        data = mutated(chance.choice(known), known, chance) if count >= len(known) else known[count]
        try:
            signal.alarm(SECONDS)
            target(data)
            signal.alarm(0)
            peak_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024
            if peak_mb > MEMORY_MB:
                raise MemoryError(f"{peak_mb} MB")
        except BaseException:
            path = found / f"crash-{hashlib.sha1(data).hexdigest()}"  # noqa: S324
            path.write_bytes(data)
            print(f"Done {count} runs; the input that failed is {path}")
            raise
    peak_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024
    print(f"Done {inputs} runs")
    print(f"stat::peak_rss_mb: {peak_mb}", file=sys.stderr)


def _hangs(*_: object) -> None:
    raise TimeoutError(f"an input takes over {SECONDS} s")


if __name__ == "__main__":
    main()
