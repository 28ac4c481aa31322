"""The note of what a scale rests on, and what would replace it."""

import numpy as np
import pyarrow as pa
import pytest

from pipeline.core.camera_row import CameraRow
from pipeline.core.config import ADULT, CameraConfig, Config, KnownPerson
from pipeline.core.records import GroundPlane, Intrinsics, KnownLength
from pipeline.run.doubts.scale_notes import length_notes, scale_notes, unlike_prior

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


# A camera 4 m up that looks 0.2 rad down, its foot mark 10 m away: by hand, rows 0.198 below the axis
# (tan(0.3948 - 0.2), atan(4 / 9.6) = 0.3948) and, 2.4 m higher, tan(atan(1.6 / 9.6) - 0.2) = -0.0349.
LENS = Intrinsics(1280, 720, 1000.0, 1000.0, 640.0, 360.0)
ROW = CameraRow("cam", width_px=1280, height_px=720).with_lens(LENS, "recording")
POST_PX = (640.0, 360.0 + 197.3, 640.0, 360.0 - 34.9)
COVARIANCE = np.diag([0.1, 0.002, 0.002]) ** 2


def knowing(length_m: float, std_m: float = 0.01) -> Config:
    known = KnownLength(POST_PX, length_m, std_m, 0.5, upright=True)
    return Config(camera=(CameraConfig("cam", known_length=(known,)),))


def test_a_scale_from_a_known_length_or_height_is_said_to_be_that() -> None:
    plane = GroundPlane(4.0, 0.2, covariance=COVARIANCE, source="walkers")
    person = Config(camera=(CameraConfig("cam", known_person=(KnownPerson("r", 1, 1.8),)),))
    for config in (knowing(2.4), person):
        (note,) = scale_notes("cam", plane, PEOPLE, config)
        assert note.code == "scale_from_known_lengths"
        assert "1 known length " in note.message
        assert "2.5 %" in note.message


@pytest.mark.parametrize("source", ["given", "walkers"])
def test_a_length_that_the_pose_contradicts_is_told(source: str) -> None:
    plane = GroundPlane(4.0, 0.2, covariance=COVARIANCE, source=source)
    assert length_notes(ROW, plane, knowing(2.4)) == []
    assert length_notes(ROW, plane, Config()) == []
    (note,) = length_notes(ROW, plane, knowing(2.0))
    assert note.code == "known_length_contradicted"
    assert "2.40 m by the camera's pose" in note.message
    assert length_notes(ROW, plane, knowing(2.0, std_m=0.3)) == []


def test_lengths_without_a_pose_are_told_to_be_unused() -> None:
    (note,) = length_notes(ROW, None, knowing(2.4))
    assert note.code == "known_length_unused"


@pytest.mark.parametrize(("ratio", "told"), [(1.05, 0), (0.95, 0), (0.8, 1), (1.2, 1)])
def test_people_whom_known_lengths_make_unlike_the_prior_are_told(ratio: float, told: int) -> None:
    notes = unlike_prior("cam", ratio, ADULT)
    assert len(notes) == told
    assert all(f"{ratio * ADULT.mean_m:.2f} m tall" in note.message for note in notes)
