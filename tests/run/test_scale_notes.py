"""The note of what a scale rests on, and what would replace it."""

import pyarrow as pa
import pytest

from pipeline.core.config import Config
from pipeline.core.records import GroundPlane
from pipeline.run.scale_notes import scale_notes

PEOPLE = pa.table({"class_count": [40, 0, 12]})


@pytest.mark.parametrize("plane", [None, GroundPlane(4.0, 0.2, source="walkers")])
def test_a_scale_from_statures_is_said_with_its_figures(plane: GroundPlane | None) -> None:
    (note,) = scale_notes("cam", plane, PEOPLE, Config())
    assert note.code == "scale_from_statures"
    assert "1.74 \u00b1 0.06 m" in note.message
    assert "3.3 %" in note.message
    assert "country" in note.message
    (dutch,) = scale_notes("cam", plane, PEOPLE, Config(country="NL").of_camera("cam"))
    assert "1.80 \u00b1 0.04 m" in dutch.message
    assert "adults of NL" in dutch.message
    assert "narrows" not in dutch.message


@pytest.mark.parametrize("source", ["given", "transforms"])
def test_a_surveyed_pose_has_a_scale_of_its_own(source: str) -> None:
    assert scale_notes("cam", GroundPlane(4.0, 0.2, source=source), PEOPLE, Config()) == []


def test_nothing_is_said_of_nobody_or_without_a_prior() -> None:
    nobody = pa.table({"class_count": [0, 0]})
    assert scale_notes("cam", None, nobody, Config()) == []
    assert scale_notes("cam", None, PEOPLE, Config(size_prior=())) == []
