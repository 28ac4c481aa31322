"""Cameras told apart by frame_id and topic, and entries of a camera file that name them."""

from __future__ import annotations

import pytest

from pipeline.core.config import CameraConfig, Config, ExposureFields
from pipeline.core.records import Severity
from pipeline.ingest.cameras import Cameras, Why, unmatched


def names(*pictures: tuple[str, str], most: int = 8) -> list[str | Why]:
    cameras = Cameras(most)
    return [cameras.find(topic, frame_id) for topic, frame_id in pictures]


def test_cameras_on_one_topic_differ_in_their_frame_id() -> None:
    assert names(("/c", "a"), ("/c", "b"), ("/c", "a"), ("/c", "b")) == ["a", "b", "a", "b"]


@pytest.mark.parametrize(
    "other",
    ["/cam/image_raw/compressed", "/cam/image_rect", "/cam/image_rect_color", "/cam/image/h264"],
)
@pytest.mark.parametrize("frame_id", ["cam", ""])
def test_one_camera_on_two_topics_is_one_camera(other: str, frame_id: str) -> None:
    found = names(("/cam/image_raw", frame_id), (other, frame_id), ("/cam/image_raw", frame_id))
    assert found == [found[0], Why.SAME_CAMERA, found[0]]


@pytest.mark.parametrize(
    ("first", "second"),
    [
        (("/left/image_raw", "rig"), ("/right/image_raw", "rig")),  # a stereo pair names one frame
        (("/cams/image_left", "rig"), ("/cams/image_right", "rig")),
        (("/front", ""), ("/back", "")),
        (("/image", ""), ("/video", "")),
    ],
)
def test_two_cameras_that_share_a_frame_id_stay_two(
    first: tuple[str, str], second: tuple[str, str]
) -> None:
    found = names(first, second)
    assert len({*found}) == 2
    assert Why.SAME_CAMERA not in found


def test_a_frame_id_that_is_left_out_stated_late_or_counts_is_one_camera() -> None:
    assert names(("/c", "a"), ("/c", ""), ("/c", "a")) == ["a", "a", "a"]
    assert names(("/c", ""), ("/c", "a"), ("/c", "a")) == ["/c", "/c", "/c"]
    assert names(("/c", "7"), ("/c", "8"), ("/c", "9"), ("/c", "10")) == ["7"] * 4
    assert names(("/c", "0"), ("/c", "5"), ("/c", "0")) == ["0", "5", "0"]


def test_too_many_cameras_are_refused_and_those_before_go_on() -> None:
    found = names(("/c", "a"), ("/c", "b"), ("/c", "x"), ("/c", "a"), most=2)
    assert found == ["a", "b", Why.TOO_MANY, "a"]


def test_an_entry_by_topic_is_the_cameras_unless_another_names_it() -> None:
    by_topic = CameraConfig("/c/image", camera_height_m=4.0)
    assert (
        Config(camera=(by_topic,)).naming("cam", "/c/image").camera_named("cam").camera_height_m
        == 4
    )
    both = Config(camera=(by_topic, CameraConfig("cam", camera_height_m=5.0)))
    assert both.naming("cam", "/c/image").camera_named("cam").camera_height_m == 5
    assert both.naming("cam", "/other") is both


def test_entries_that_match_nothing_are_told_with_what_there_is() -> None:
    there = {"cam": "/c/image", "side": "/s/image"}
    yard, cam = CameraConfig("yard"), CameraConfig("/c/image")
    (note,) = unmatched([yard], there, [], [])
    assert (note.code, note.severity) == ("unmatched_camera", Severity.WARNING)
    assert all(word in note.message for word in ("'yard'", "'cam'", "'/c/image'", "'side'"))
    (note,) = unmatched([yard, cam], there, [], [])
    assert note.severity is Severity.WARNING  # a camera file of many cameras
    assert list(unmatched([cam], there, [], [])) == []


def test_exposure_fields_that_match_nothing_are_told_with_what_there_is() -> None:
    entry = CameraConfig("cam", exposure=ExposureFields(f_number="/diag.fnum", iso_speed="/no.iso"))
    there, topics = {"cam": "/c"}, ["/c", "/diag"]
    field, topic = sorted(unmatched([entry], there, topics, []), key=lambda n: n.message)
    assert {field.code, topic.code} == {"unmatched_exposure"}
    assert "no such number" in field.message
    assert "/c, /diag" in topic.message
    found = [("cam", "f_number"), ("cam", "iso_speed")]
    assert list(unmatched([entry], there, topics, found)) == []
