"""Inputs that fuzzing once found, and a little fuzzing: hypothesis on bytes, through the same targets."""

from __future__ import annotations

import random
import time
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fuzz.mutating import mutated
from fuzz.seeds import seeds
from fuzz.targets import TARGETS

FOUND = Path(__file__).parents[1] / "fuzzed"


@pytest.mark.parametrize(
    "path", sorted(FOUND.glob("*/*")), ids=lambda p: f"{p.parent.name}-{p.name}"
)
def test_what_was_found_once_does_no_harm_again(path: Path) -> None:
    started = time.process_time()
    TARGETS[path.parent.name](path.read_bytes())
    assert time.process_time() - started < 5


@pytest.mark.parametrize("name", [*TARGETS])
def test_seeds_and_their_mutations_do_no_harm(name: str) -> None:
    known, chance = list(seeds(name)), random.Random(0)  # noqa: S311
    assert known
    for data in known:
        TARGETS[name](data)
    for _ in range(300):
        TARGETS[name](mutated(chance.choice(known), known, chance))


@given(st.sampled_from([*TARGETS]), st.binary(max_size=400))
def test_no_bytes_do_harm(name: str, data: bytes) -> None:
    TARGETS[name](data)
