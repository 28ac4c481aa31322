"""One target under atheris: libFuzzer, with the coverage of our own Python code."""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import atheris

with atheris.instrument_imports(include=["pipeline"]):
    from fuzz.targets import TARGETS

from fuzz.seeds import seeds

MAX_BYTES = 8192
MEMORY_MB, SECONDS = 1024, 10


def main() -> None:
    """Run `fuzz.guided TARGET INPUTS SEED FOLDER`."""
    target, inputs, seed, found = sys.argv[1:]
    corpus = Path(tempfile.mkdtemp(prefix="corpus-"))
    for index, data in enumerate(seeds(target)):
        (corpus / f"seed-{index}").write_bytes(data)
    options = [
        f"-runs={inputs}",
        f"-seed={seed}",
        f"-max_len={MAX_BYTES}",
        f"-rss_limit_mb={MEMORY_MB}",
        f"-timeout={SECONDS}",
        f"-artifact_prefix={found}/",
        "-print_final_stats=1",
        "-verbosity=1",
    ]
    atheris.Setup([sys.argv[0], *options, str(corpus)], TARGETS[target])
    atheris.Fuzz()


if __name__ == "__main__":
    main()
