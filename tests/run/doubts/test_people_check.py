"""People as evidence on poses and lenses: impossible ones are told and not used."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
from foxglove_schemas_protobuf.Quaternion_pb2 import Quaternion
from foxglove_schemas_protobuf.Vector3_pb2 import Vector3

from pipeline.calibrate.walkers.tilt import Tilt
from pipeline.core.camera_row import CameraRow
from pipeline.core.config import ADULT, CameraConfig, Config, Dimension, SizePrior
from pipeline.core.records import GroundPlane, Intrinsics
from pipeline.estimate.types import Measured
from pipeline.mcap_file.writer import RecordingWriter, calibration_message, image_message, timestamp
from pipeline.run.doubts.people_check import lens_by_people, people_of, with_tilt
from pipeline.run.recordings import run
from pipeline.store.database import Store
from schemas.stadimeter_pb2 import Detections
from tests.estimate.scenes import VGA, measured, people
from tests.run.test_recordings import jpeg

TRUE = GroundPlane(4.0, math.radians(15.0))
KINDERGARTEN = SizePrior("person", Dimension.HEIGHT, 1.05, 0.06, mean_std_m=0.03)
LENS = Intrinsics(320, 240, 400.0, 400.0, 159.5, 119.5)
START_NS, STEP_NS = 1_700_000_000_000_000_000, 100_000_000


def crowd(stature_m: float, count: int = 5, camera: Intrinsics = VGA) -> Measured:
    """Return `count` people, five boxes each, by a camera as `TRUE` says."""
    track = np.repeat(np.arange(count), 5)
    x_m, y_m = np.linspace(-2, 2, len(track)), np.linspace(10, 25, len(track))
    boxes = people(x_m, y_m, np.full(len(track), stature_m), TRUE, camera)
    return measured(boxes, track_id=track, intrinsics=camera)


@pytest.mark.parametrize(
    ("plane", "word"),
    [
        (TRUE, None),
        (replace(TRUE, camera_height_m=234.0), "m tall"),  # a map at sea level
        (replace(TRUE, camera_height_m=1.0), "m tall"),  # the origin of the map above the ground
        (replace(TRUE, tilt_rad=math.radians(-40)), "horizon"),  # a sign
        (replace(TRUE, tilt_rad=math.radians(75)), "m tall"),  # from the vertical
    ],
)
def test_a_pose_is_judged_by_the_people(plane: GroundPlane, word: str | None) -> None:
    reason = people_of(crowd(1.75), plane, ADULT).impossible(ADULT)
    assert (reason is None) if word is None else (word in (reason or ""))


def test_children_are_people_where_they_are_alone_or_the_camera_file_says_so() -> None:
    many, one = people_of(crowd(1.05), TRUE, ADULT), people_of(crowd(1.05, 1), TRUE, ADULT)
    assert many.median_m == pytest.approx(1.05, abs=0.01)
    assert many.impossible(ADULT) is not None
    assert one.impossible(ADULT) is None
    assert many.impossible(KINDERGARTEN) is None


def test_normalised_boxes_or_a_focal_length_of_half_are_impossible_too() -> None:
    seen = crowd(1.75)
    shares = replace(seen, bbox_xyxy_px=seen.bbox_xyxy_px / [1280, 720, 1280, 720])
    assert people_of(shares, TRUE, ADULT).impossible(ADULT) is not None
    long = replace(VGA, fx_px=4 * VGA.fx_px, fy_px=4 * VGA.fy_px)
    assert people_of(replace(seen, intrinsics=long), TRUE, ADULT).impossible(ADULT) is not None


RAW = Intrinsics(1280, 720, 1000.0, 1000.0, 639.5, 359.5, "plumb_bob", (-0.3, 0.1, 0.0, 0.0, 0.0))
FLAT = Intrinsics(1280, 720, 800.0, 800.0, 639.5, 359.5)
ROW = (
    CameraRow("cam", width_px=1280, height_px=720).with_lens(RAW, "recording").with_rectified(FLAT)
)


@pytest.mark.parametrize(("true", "focal_px"), [(FLAT, 800.0), (RAW, 1000.0)])
def test_people_tell_whether_pictures_are_rectified(true: Intrinsics, focal_px: float) -> None:
    seen = replace(crowd(1.75, 8, true), intrinsics=RAW)
    row, note = lens_by_people(ROW, seen, TRUE, ADULT)
    assert row.fx_px == focal_px
    assert bool(row.distortion) == (true is RAW)
    assert (note is not None) == (true is FLAT)


def test_where_people_cannot_tell_the_definition_is_used_and_told() -> None:
    row, note = lens_by_people(ROW, crowd(1.75, 8, FLAT), None, ADULT)
    assert row == ROW
    assert note is not None
    assert "not known" in note.message
    alike = ROW.with_rectified(replace(FLAT, fx_px=990.0, fy_px=990.0))
    assert lens_by_people(alike, crowd(1.75), None, ADULT)[1] is None


def write(path: Path, height_m: float, moved_m: float = 0.0, shares: bool = False) -> None:
    """Write three people of 1.75 m, 10 m before a level camera that is 1.5 m up; it claims another."""
    with RecordingWriter(path) as writer:
        for index in range(12):
            at_ns = START_NS + index * STEP_NS
            pose = FrameTransform(
                timestamp=timestamp(at_ns),
                parent_frame_id="map",
                child_frame_id="cam",
                translation=Vector3(z=height_m + moved_m * index),
                rotation=Quaternion(x=-(0.5**0.5), w=0.5**0.5),
            )
            writer.write("/tf", pose, at_ns)
            writer.write("/k", calibration_message(LENS, at_ns, "cam"), at_ns)
            writer.write("/i", image_message(jpeg(), "jpeg", at_ns, "cam"), at_ns)
            found = Detections(timestamp=timestamp(at_ns), frame_id="cam")
            for number in range(3):
                x, foot = 60 + 80 * number + index, 119.5 + 400 * 1.5 / 10
                edges = np.array([x, foot - 400 * 1.75 / 10, x + 25, foot])
                if shares:
                    edges = edges / [320, 240, 320, 240]
                names = ("x_min_px", "y_min_px", "x_max_px", "y_max_px")
                box = dict(zip(names, edges.tolist(), strict=True))
                found.objects.add(box=box, class_name="person", object_id=str(number))
            writer.write("/d", found, at_ns)


def result(
    path: Path, config: Config | None = None
) -> tuple[dict[str, Any], list[str], float | None]:
    """Return the camera, the codes of all that is told, and the median depth by the ground."""
    database = path.with_suffix(".duckdb")
    assert not run([path], database, config or Config()).failed
    with Store.open(database, read_only=True) as store:
        (camera,) = store.query("FROM cameras").to_pylist()
        codes = [r["code"] for r in store.query("SELECT code FROM diagnostics").to_pylist()]
        depth = store.query("SELECT median(depth_m) AS m FROM estimates WHERE method = 'ground'")
    return camera, codes, depth.to_pylist()[0]["m"]


def test_possible_transforms_are_used_and_impossible_ones_told(tmp_path: Path) -> None:
    write(tmp_path / "a.mcap", 1.5)
    camera, codes, depth_m = result(tmp_path / "a.mcap")
    assert (camera["pose_source"], "impossible_people" in codes) == ("transforms", False)
    assert depth_m == pytest.approx(10.2, abs=0.3)
    write(tmp_path / "b.mcap", 230.0)
    camera, codes, depth_m = result(tmp_path / "b.mcap")
    assert camera["pose_source"] != "transforms"
    assert "impossible_people" in codes
    assert depth_m is None or depth_m < 20


def test_an_impossible_pose_of_the_camera_file_gives_way_to_the_transforms(tmp_path: Path) -> None:
    write(tmp_path / "a.mcap", 1.5)
    entry = CameraConfig("cam", camera_height_m=30.0, tilt_deg=0.0)
    camera, codes, _ = result(tmp_path / "a.mcap", Config(camera=(entry,)))
    assert (camera["pose_source"], "impossible_people" in codes) == ("transforms", True)


def test_a_camera_that_moves_has_no_one_pose(tmp_path: Path) -> None:
    write(tmp_path / "a.mcap", 1.5, moved_m=0.1)
    camera, codes, depth_m = result(tmp_path / "a.mcap")
    assert (camera["pose_source"], camera["recorded_height_m"]) == (None, None)
    assert "moving_camera" in codes
    assert depth_m is None
    entry = CameraConfig("cam", camera_height_m=1.5, tilt_deg=0.0)
    camera, _, depth_m = result(tmp_path / "a.mcap", Config(camera=(entry,)))
    assert camera["pose_source"] == "given"
    assert depth_m == pytest.approx(10.2, abs=0.3)


def test_boxes_in_shares_of_the_picture_are_refused(tmp_path: Path) -> None:
    write(tmp_path / "a.mcap", 1.5, shares=True)
    _, codes, depth_m = result(tmp_path / "a.mcap")
    assert "boxes_not_in_pixels" in codes
    assert depth_m is None


def test_a_tilt_by_people_is_told_and_used_where_none_is_stated() -> None:
    found, notes = with_tilt(Config(country="GB"), "cam", Tilt(0.2, 0.05))
    assert found.camera_named("cam").tilt_deg == pytest.approx(11.46, abs=0.01)
    assert found.camera_named("cam").tilt_std_deg == pytest.approx(2.86, abs=0.01)
    assert found.country == "GB"
    assert [note.code for note in notes] == ["tilt_from_people"]
    stated = Config(camera=(CameraConfig("cam", tilt_deg=8.0),))
    assert with_tilt(stated, "cam", Tilt(0.2, 0.05)) == (stated, [])
