"""One odd picture, or a first dummy message, changes nothing of the others."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from mcap.reader import make_reader
from mcap.writer import Writer

import stadimeter
from pipeline.core.records import Intrinsics
from pipeline.measure.lens_stretches import MOST, LensStretches
from tests.run.test_recordings import LEVEL, write_people

LENS = Intrinsics(640, 480, 500.0, 500.0, 319.5, 239.5)


def test_the_lens_of_most_frames_is_the_cameras() -> None:
    lenses = LensStretches()
    for focal_px, frames in ((900.0, 3), (500.0, 7), (300.0, 1)):
        for _ in range(frames):
            stated = replace(LENS, fx_px=focal_px, fy_px=focal_px)
            stretch, _new = lenses.of_frame((640, 480), stated)
            stretch.intrinsics = stated
    assert lenses.usual.intrinsics == LENS
    assert lenses.usual.frames == 7


def test_a_known_lens_goes_before_a_longer_stretch_without_one() -> None:
    lenses = LensStretches()
    for _ in range(9):
        lenses.of_frame((640, 480), None)
    stretch, is_new = lenses.of_frame((640, 480), LENS)
    assert is_new
    stretch.intrinsics = LENS
    assert lenses.usual.intrinsics == LENS


def test_rounding_is_no_other_lens_and_the_number_is_bounded() -> None:
    lenses = LensStretches()
    assert lenses.of_frame((640, 480), LENS)[1]
    assert not lenses.of_frame((640, 480), replace(LENS, fx_px=500.4))[1]
    for n in range(3 * MOST):
        lenses.of_frame((640 + n, 480), LENS)
    assert len(lenses._all) == MOST


def smaller(data: bytes, width: int, height: int) -> bytes:
    picture = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
    return cv2.imencode(".jpg", cv2.resize(picture, (width, height)))[1].tobytes()


def with_odd_pictures(source: Path, target: Path, odd: set[int], size: tuple[int, int]) -> None:
    """Copy a recording with some of its pictures in another size; boxes and calibrations stay."""
    with source.open("rb") as old, target.open("wb") as new:
        writer = Writer(new)
        writer.start()
        channels: dict[int, int] = {}
        index = -1
        for schema, channel, message in make_reader(old).iter_messages():
            if channel.id not in channels:
                known = writer.register_schema(schema.name, schema.encoding, schema.data)
                channels[channel.id] = writer.register_channel(
                    channel.topic, channel.message_encoding, known
                )
            data = message.data
            if channel.topic == "/image":
                index += 1
                if index in odd:
                    image = CompressedImage.FromString(data)
                    image.data = smaller(image.data, *size)
                    data = image.SerializeToString()
            writer.add_message(channels[channel.id], message.log_time, data, message.publish_time)
        writer.finish()


@pytest.mark.parametrize("odd", [{0}, {11}, {4, 5}])
@pytest.mark.parametrize("size", [(160, 120), (120, 160)])
def test_odd_pictures_do_not_change_the_others(
    tmp_path: Path, odd: set[int], size: tuple[int, int]
) -> None:
    write_people(tmp_path / "people.mcap")
    with_odd_pictures(tmp_path / "people.mcap", tmp_path / "odd.mcap", odd, size)
    stadimeter.measure(tmp_path / "odd.mcap", tmp_path / "x.duckdb", camera=LEVEL, strict=False)
    with stadimeter.open(tmp_path / "x.duckdb") as results:
        depths = results.query(
            "SELECT frame_index, depth_m FROM current_estimates WHERE method = 'ground'"
        ).rows()
        codes = {row["code"] for row in results.view("diagnostics").rows()}
        camera = results.view("cameras").rows()[0]
    assert (camera["width_px"], camera["height_px"]) == (320, 240)
    assert camera["fx_px"] == pytest.approx(400.0)
    assert "size_changed" in codes
    right = [row["depth_m"] for row in depths if row["frame_index"] not in odd]
    assert len(right) == 2 * (12 - len(odd))
    assert right == pytest.approx([10.0] * len(right), rel=0.05)


def test_a_zoom_by_lens_data_alone_is_another_lens() -> None:
    lenses = LensStretches()
    first, _ = lenses.of_frame((640, 480), None, 900.0)
    again, is_new = lenses.of_frame((640, 480), None, 903.0)
    assert again is first
    assert not is_new
    assert lenses.of_frame((640, 480), None, 1800.0)[1]
    assert lenses.of_frame((640, 480), None)[1]
    assert not lenses.of_frame((640, 480), None)[1]
