"""From trees to records: boxes, calibrations, images, named numbers."""

from __future__ import annotations

import contextlib
import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from mcap.writer import Writer

from pipeline.core.camera_file import write_camera_file
from pipeline.core.config import CameraConfig, Config, ExposureFields, load_config
from pipeline.core.diagnostics import Notes
from pipeline.core.errors import UsageError
from pipeline.core.records import Boxes, LensClaim, Pairing
from pipeline.ingest.frames import FrameAssembler
from pipeline.mcap_file.reader import McapFile
from pipeline.mcap_file.writer import RecordingWriter, image_message, schema_of, timestamp
from pipeline.messages.boxes import detection_2d_array, image_annotations
from pipeline.messages.calibration import camera_calibration
from pipeline.messages.content import VideoPacket
from pipeline.messages.images import compressed_image, raw_image
from pipeline.messages.named_numbers import in_unit, named_numbers
from pipeline.messages.registry import FAMILIES
from pipeline.messages.tree import UndecodableMessage, blob
from schemas.stadimeter_pb2 import CameraExposure

K = [500.0, 0, 320.5, 0, 510.0, 240.5, 0, 0, 1]


def drawn(points: list[tuple[float, float]], kind: int = 2) -> dict[str, Any]:
    return {"points": [{"type": kind, "points": [{"x": x, "y": y} for x, y in points]}]}


SQUARE = [(10.0, 20.0), (30.0, 20.0), (30.0, 60.0), (10.0, 60.0)]


@pytest.mark.parametrize(
    ("tree", "count"),
    [
        (drawn(SQUARE), 1),
        (drawn([*SQUARE, SQUARE[0]], 3), 1),
        (drawn(SQUARE, 1), None),  # points
        (drawn([(0, 0), (10, 5), (20, 20), (5, 10)]), None),  # not upright
        ({}, None),
    ],
)
def test_only_upright_rectangles_are_boxes(tree: dict[str, Any], count: int | None) -> None:
    found = image_annotations(tree).payload
    assert (None if found is None else len(found)) == count
    if isinstance(found, Boxes):
        assert found.bbox_xyxy_px.tolist() == [[9.5, 19.5, 29.5, 59.5]]


@pytest.mark.parametrize("centre", [{"x": 50, "y": 40}, {"position": {"x": 50, "y": 40}}])
def test_boxes_of_every_version_of_vision_msgs(centre: dict[str, Any]) -> None:
    row = {"bbox": {"center": centre | {"theta": math.pi / 2}, "size_x": 20, "size_y": 10}}
    old = row | {"results": [{"id": "car", "score": 0.5}], "tracking_id": "9"}
    found = detection_2d_array({"detections": [old]}).payload
    assert isinstance(found, Boxes)
    assert found.bbox_xyxy_px[0] == pytest.approx([44.5, 29.5, 54.5, 49.5])
    assert (found.class_name, found.object_id) == (("car",), ("9",))


def test_an_unknown_distortion_model_is_told() -> None:
    tree = {"K": K, "D": [0.1, 0.2], "distortion_model": "inverse_brown_conrady"}
    found = camera_calibration(tree)
    assert isinstance(found.payload, LensClaim)
    assert (found.payload.distortion_model, found.payload.distortion) == ("", ())
    assert "inverse_brown_conrady" in found.refused[0]


@pytest.mark.parametrize(
    ("count", "model"), [(5, "plumb_bob"), (8, "rational_polynomial"), (4, ""), (3, "")]
)
def test_coefficients_without_a_model_are_of_the_only_model_that_has_so_many(
    count: int, model: str
) -> None:
    """Four may be those of a fisheye or of Brown's model: neither is assumed, and that is told."""
    found = camera_calibration({"k": K, "d": [-0.1] * count, "distortion_model": ""})
    assert isinstance(found.payload, LensClaim)
    assert found.payload.distortion_model == model
    assert len(found.payload.distortion) == (count if model else 0)
    assert len(found.refused) == 1


@pytest.mark.parametrize("k", [[], [0.0] * 9])
def test_a_camera_that_was_not_calibrated_has_no_calibration(k: list[float]) -> None:
    found = camera_calibration({"k": k})
    assert (found.payload, found.code) == (None, "no_calibration")
    broken = camera_calibration({"k": [math.nan, *K[1:]]})
    assert broken.payload is None
    assert "finite" in broken.refused[0]


def test_depth_pictures_are_not_light_and_video_hides_in_images() -> None:
    for tree in ({"encoding": "16UC1"}, {"encoding": "32FC1"}):
        assert raw_image(tree).code == "depth_image"
    for stated in (
        "16UC1; compressedDepth png",
        "16UC1; png compressed ",
        "32FC1; compressedDepth",
    ):
        assert compressed_image({"format": stated}).code == "depth_image"
    assert compressed_image({"format": "h264", "data": b"x"}).payload == VideoPacket("h264", b"x")


def test_bytes_in_json() -> None:
    assert blob({"data": "AQI="}, "data") == blob({"data": [1, 2]}, "data") == b"\1\2"
    for bad in ("?", [1, 300], ["a"], 7, {"a": 1}):
        with pytest.raises(UndecodableMessage):
            blob({"data": bad}, "data")


WORDS = """timestamp header stamp sec nsec frame_id data format encoding width height step K D
points texts type x y position objects box x_min_px detections bbox center theta size_x results
transforms translation rotation child_frame_id roi binning_x f_number depth_m"""
NAMES = st.sampled_from(WORDS.split())
json_values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=6),
    lambda inner: st.lists(inner, max_size=5) | st.dictionaries(NAMES, inner, max_size=5),
    max_leaves=20,
)


@given(st.sampled_from(sorted(FAMILIES)), st.dictionaries(NAMES, json_values, max_size=6))
def test_any_tree_is_a_record_or_refused(name: str, tree: dict[str, Any]) -> None:
    with contextlib.suppress(UndecodableMessage):
        FAMILIES[name][1](tree)


# Numbers that a camera file names


@pytest.mark.parametrize(
    ("field", "value", "unit", "expected"),
    [
        ("exposure_time_s", 8.0, "ms", 0.008),
        ("exposure_time_s", 125.0, "1/s", 0.008),
        ("focus_distance_m", 0.5, "dpt", 2.0),
        ("focus_distance_m", 0.0, "dpt", math.inf),
        ("focal_length_mm", 0.4, "cm", 4.0),
        ("gain_db", 10.0, "x", 20.0),
    ],
)
def test_units(field: str, value: float, unit: str, expected: float) -> None:
    assert in_unit(field, value, unit) == pytest.approx(expected)


@pytest.mark.parametrize("spec", ["/diag", "fnum", "/diag.fnum furlong", "a b c"])
def test_what_names_no_field_is_refused(spec: str) -> None:
    with pytest.raises(UsageError):
        named_numbers([CameraConfig("c", exposure=ExposureFields(f_number=spec))])


def test_the_exposure_of_a_camera_file_is_read_and_written(tmp_path: Path) -> None:
    path = tmp_path / "camera.toml"
    path.write_text(
        '[[camera]]\nname = "cam"\nexposure.f_number = "/diag.fnum"\n'
        'exposure.exposure_time_s = "/diag.times[1].us us"\n[ingest]\nground_frame = "yard"\n'
    )
    config = load_config(path)
    fields = config.camera[0].exposure
    assert (fields.f_number, config.ingest.ground_frame) == ("/diag.fnum", "yard")
    changed = replace(config, camera=(replace(config.camera[0], camera_height_m=3.0),))
    write_camera_file(path, changed)
    assert repr(load_config(path)) == repr(changed)


def test_named_fields_of_json_and_protobuf_channels_become_exposure(tmp_path: Path) -> None:
    path, start = tmp_path / "x.mcap", 10**18
    with RecordingWriter(path) as w:
        for number in range(3):
            time_ns = start + number * 100_000_000
            w.write("/cam/image", image_message(b"x", "jpeg", time_ns, "cam"), time_ns)
            w.write("/lens.v2", CameraExposure(timestamp=timestamp(time_ns), gain_db=2.0), time_ns)
    # a channel of another kind, and one in a protobuf schema that is only known from the file
    joined = tmp_path / "y.mcap"
    with path.open("rb") as source, joined.open("wb") as target:
        from mcap.reader import make_reader

        writer = Writer(target)
        writer.start()
        ids: dict[str, int] = {}
        for schema, channel, message in make_reader(source).iter_messages():
            assert schema is not None
            if channel.topic not in ids:
                number = writer.register_schema(schema.name, schema.encoding, schema.data)
                ids[channel.topic] = writer.register_channel(channel.topic, "protobuf", number)
            writer.add_message(ids[channel.topic], message.log_time, message.data, message.log_time)
        diag = writer.register_channel("/diag", "json", 0)
        alien = CameraExposure(focal_length_mm=5.0)
        renamed = schema_of(alien).replace(b"stadimeter", b"alienmeter")
        renamed = renamed.replace(b"CameraExposure", b"StrangeExposur")
        number = writer.register_schema("alienmeter.StrangeExposur", "protobuf", renamed)
        strange = writer.register_channel("/strange", "protobuf", number)
        for index in range(3):
            time_ns = start + index * 100_000_000
            data = json.dumps({"fnum": 2.0 + index, "times": [{"us": 1}, {"us": 8000}]}).encode()
            writer.add_message(diag, time_ns, data, time_ns)
            writer.add_message(strange, time_ns, alien.SerializeToString(), time_ns)
        writer.finish()
    fields = ExposureFields(
        f_number="/diag.fnum",
        exposure_time_s="/diag.times[1].us us",
        focal_length_mm="/strange.focal_length_mm",
        iso_speed="/diag.nothing",
        gain_db="/lens.v2.gain_db x",
    )
    notes = Notes()
    cameras = (CameraConfig("cam", exposure=fields),)
    file = McapFile(joined, Config().limits, notes.add)
    frames = list(FrameAssembler(file, Config().ingest, notes, cameras))
    assert [f.exposure.f_number for f in frames] == [2.0, 3.0, 4.0]
    assert {f.exposure.exposure_time_s for f in frames} == {0.008}
    assert {f.exposure.focal_length_mm for f in frames} == {5.0}
    assert {round(f.exposure.gain_db, 3) for f in frames} == {6.021}
    assert {f.exposure_pairing for f in frames} == {Pairing.NEAREST}
    assert {(n.code, n.count) for n in notes} == {("absent_field", 3)}
