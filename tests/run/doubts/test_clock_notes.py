"""Clocks and scales that people contradict."""

import numpy as np
import pyarrow as pa
import pytest

from pipeline.core.config import Config
from pipeline.core.records import GroundPlane
from pipeline.core.tables import TRACK_CADENCES
from pipeline.run.doubts.clock_notes import clock_notes

FOUND = GroundPlane(6.0, 0.3, source="walkers")
GIVEN = GroundPlane(6.0, 0.3, source="camera file")


def table(people=10, clock=1.0, scale=1.0, seed=0):
    """Return cadences and speeds of people of one place, by a clock and a scale."""
    random = np.random.default_rng(seed)
    hz = 1.9 * np.exp(random.normal(0, 0.05) + random.normal(0, 0.09, people))
    speed = 1.385 * (hz / 1.9) ** 1.5
    speed *= np.exp(random.normal(0, 0.04) + random.normal(0, 0.11, people))
    columns = [["cam"] * people, range(people), hz * clock, [0.04] * people, [1] * people]
    columns.append(speed * clock * scale)
    arrays = [pa.array(c, type=f.type) for c, f in zip(columns, TRACK_CADENCES, strict=True)]
    return pa.Table.from_arrays(arrays, schema=TRACK_CADENCES)


def codes(plane, **made):
    return [n.code for n in clock_notes("cam", table(**made), plane, Config())]


@pytest.mark.parametrize("plane", [FOUND, GIVEN, None], ids=["found", "given", "none"])
def test_right_clocks_raise_nothing(plane):
    assert sum(len(codes(plane, seed=seed)) for seed in range(300)) <= 3


def test_ten_said_for_seven_is_found():
    for plane in (FOUND, GIVEN):
        found = [codes(plane, clock=10 / 7, seed=seed) for seed in range(50)]
        assert sum(f == ["frame_rate_contradicted"] for f in found) >= 48


def test_a_clock_half_as_fast_is_found():
    found = [codes(FOUND, clock=0.5, seed=seed) for seed in range(20)]
    assert found == [["frame_rate_contradicted"]] * 20


def test_a_given_scale_that_is_impossible_is_found():
    found = [codes(GIVEN, scale=1.6, seed=seed) for seed in range(20)]
    assert found.count(["scale_contradicted"]) >= 19
    # Where the scale comes from the people themselves nothing was given.
    assert "scale_contradicted" not in [
        c for s in range(20) for c in codes(FOUND, scale=1.6, seed=s)
    ]


def test_few_people_say_nothing():
    assert codes(FOUND, people=3, clock=2.0) == []
