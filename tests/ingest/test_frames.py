"""Frames with all that belongs to their time: pairing, cameras apart, channels by schema."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from foxglove_schemas_protobuf.RawImage_pb2 import RawImage
from hypothesis import given
from hypothesis import strategies as st
from PIL.TiffImagePlugin import IFDRational

from pipeline.core.config import Config
from pipeline.core.diagnostics import Notes
from pipeline.core.records import Frame, Pairing
from pipeline.ingest.frames import FrameAssembler
from pipeline.ingest.pairing import Lane
from pipeline.mcap_file.reader import McapFile
from pipeline.mcap_file.writer import RecordingWriter, image_message, timestamp
from schemas.stadimeter_pb2 import CameraExposure, Detections, GroundTruth
from tests.images.test_exif import photo

START_NS = 1_700_000_000_000_000_000
MS = 1_000_000


def read(path: Path) -> tuple[list[Frame], Notes]:
    config, notes = Config(), Notes()
    file = McapFile(path, config.limits, notes.add)
    return list(FrameAssembler(file, config.ingest, notes)), notes


def exposure(ms: float, f_number: float, frame_id: str = "cam") -> CameraExposure:
    time_ns = START_NS + round(ms * MS)
    return CameraExposure(timestamp=timestamp(time_ns), frame_id=frame_id, f_number=f_number)


def image(ms: float, frame_id: str = "cam"):
    return image_message(b"x", "jpeg", START_NS + round(ms * MS), frame_id)


@given(
    st.lists(st.integers(0, 500), min_size=0, max_size=30),
    st.integers(-50, 550),
    st.integers(0, 40),
)
def test_pairing_is_that_of_a_search_through_all(
    times: list[int], asked: int, tolerance: int
) -> None:
    lane: Lane[int] = Lane("/t", "")
    for number, time in enumerate(times):
        lane.add(-time, time, number)
    nearest = lane.nearest(asked, tolerance, by_stamp=True)
    best = min((abs(t - asked) for t in times), default=None)
    if best is None or best > tolerance:
        assert nearest is None
    else:
        assert nearest is not None
        assert abs(nearest.offset_ns) == best
        assert times[nearest.value] - asked == nearest.offset_ns
    last = lane.last_known(asked, by_stamp=True)
    before = [t for t in times if t <= asked]
    assert (last is None) == (not before)
    if last is not None:
        assert times[last.value] == max(before)


def test_exposure_is_the_nearest_then_the_last_known_then_none(tmp_path: Path) -> None:
    path = tmp_path / "x.mcap"
    with RecordingWriter(path) as w:
        for ms in (0, 100, 200, 300):
            w.write("/i", image(ms), START_NS + ms * MS)
            if ms == 100:  # logged after the picture that it belongs to, and 5 ms late
                w.write("/e", exposure(105, 4.0), START_NS + 106 * MS)
    frames, _ = read(path)
    assert [f.exposure_pairing for f in frames] == [
        Pairing.NONE,
        Pairing.NEAREST,
        Pairing.LAST_KNOWN,
        Pairing.LAST_KNOWN,
    ]
    assert np.isnan(frames[0].exposure.f_number)
    assert [f.exposure.f_number for f in frames[1:]] == [4.0] * 3
    assert [f.exposure_offset_ns for f in frames] == [None, 5 * MS, -95 * MS, -195 * MS]


def test_channels_are_found_by_schema_whatever_their_topics_are_called(tmp_path: Path) -> None:
    path = tmp_path / "x.mcap"
    with RecordingWriter(path) as w:
        w.write("/exposure", image(0), START_NS)
        w.write("/image", exposure(0, 2.0), START_NS)
    frames, _ = read(path)
    assert len(frames) == 1
    assert frames[0].exposure.f_number == 2.0


def test_cameras_stay_apart(tmp_path: Path) -> None:
    path = tmp_path / "x.mcap"
    with RecordingWriter(path) as w:
        for ms in (0, 40, 80):
            for name, n in (("left", 2.0), ("right", 8.0)):
                w.write(f"/{name}/i", image(ms, name), START_NS + ms * MS)
                w.write("/all", exposure(ms, n, name), START_NS + ms * MS)
    frames, _ = read(path)
    by_camera = {name: [f for f in frames if f.camera == name] for name in ("left", "right")}
    for name, f_number in (("left", 2.0), ("right", 8.0)):
        assert [f.frame_index for f in by_camera[name]] == [0, 1, 2]
        assert {f.exposure.f_number for f in by_camera[name]} == {f_number}


def test_one_name_at_two_places_is_two_cameras_and_no_name_is_the_topics(tmp_path: Path) -> None:
    path = tmp_path / "x.mcap"
    with RecordingWriter(path) as w:
        w.write("/a/raw", image(0, "cam"), START_NS)
        w.write("/a/rectified", image(0, "cam"), START_NS)  # of the same camera
        w.write("/other/raw", image(0, "cam"), START_NS)
        w.write("/b/i", image(0, ""), START_NS)
        w.write("/b/e", exposure(0, 5.6, ""), START_NS)
    frames, notes = read(path)
    assert sorted(f.camera for f in frames) == ["/b/i", "/other/raw", "cam"]
    assert "same_camera" in [n.code for n in notes]
    f_numbers = {f.camera: f.exposure.f_number for f in frames}
    assert f_numbers["/b/i"] == 5.6  # by the shared namespace
    assert np.isnan(f_numbers["cam"])


def test_boxes_and_truth_belong_to_one_frame_each(tmp_path: Path) -> None:
    path = tmp_path / "x.mcap"
    box = {"x_min_px": 1, "y_min_px": 2, "x_max_px": 3, "y_max_px": 4}
    with RecordingWriter(path) as w:
        for ms in (0, 10, 20):
            w.write("/i", image(ms), START_NS + ms * MS)
        found = Detections(timestamp=timestamp(START_NS + 10 * MS), frame_id="cam")
        found.objects.add(box=box, class_name="person")
        found.objects.add(box=box | {"x_max_px": 0.5}, class_name="person")
        w.write("/d", found, START_NS + 30 * MS)
        truth = GroundTruth(timestamp=timestamp(START_NS + 10 * MS), frame_id="cam")
        truth.objects.add(object_id="a", depth_m=-1.0, height_m=1.7)
        w.write("/t", truth, START_NS + 30 * MS)
    frames, notes = read(path)
    assert sum(f.detections is not None for f in frames) == 1
    paired = next(f for f in frames if f.detections is not None)
    assert paired.detections is not None
    assert len(paired.detections) == 1  # the box whose edges are swapped was refused
    assert sum(len(f.truth) for f in frames) == 1
    assert {n.code for n in notes} == {"invalid_value"}


def test_frames_come_in_order_of_time_though_logged_out_of_it(tmp_path: Path) -> None:
    path = tmp_path / "x.mcap"
    with RecordingWriter(path) as w:
        for ms in (0, 80, 40, 160, 120):
            w.write("/i", image(ms), START_NS + ms * MS)
    frames, _ = read(path)
    assert [f.capture_time_ns for f in frames] == sorted(f.capture_time_ns for f in frames)


@pytest.mark.parametrize(
    ("field", "value", "word"),
    [
        ("f_number", 0.0, "f_number 0"),
        ("focal_length_mm", float("nan"), "focal_length_mm nan"),
        ("photographic_sensitivity", -100.0, "iso_speed -100"),
        ("exposure_time_s", float("inf"), "exposure_time_s inf"),
    ],
)
def test_absurd_exposure_is_refused_value_by_value(
    tmp_path: Path, field: str, value: float, word: str
) -> None:
    path = tmp_path / "x.mcap"
    known = {"f_number": 4.0, "focal_length_mm": 50.0} | {field: value}
    message = CameraExposure(timestamp=timestamp(START_NS), frame_id="cam", **known)
    with RecordingWriter(path) as w:
        w.write("/i", image(0), START_NS)
        w.write("/e", message, START_NS)
    frames, notes = read(path)
    note = next(iter(notes))
    assert (note.code, note.topic, note.log_time_ns) == ("invalid_exposure", "/e", START_NS)
    assert word in note.message
    good = "focal_length_mm" if field == "f_number" else "f_number"
    assert getattr(frames[0].exposure, good) == known[good]


def test_exif_conventions_of_the_focus_distance(tmp_path: Path) -> None:
    path = tmp_path / "x.mcap"
    with RecordingWriter(path) as w:
        for ms, value in ((0, 0.0), (100, float(0xFFFFFFFF)), (200, 3.5)):
            w.write("/i", image(ms), START_NS + ms * MS)
            message = CameraExposure(
                timestamp=timestamp(START_NS + ms * MS), frame_id="cam", focus_distance_m=value
            )
            w.write("/e", message, START_NS + ms * MS)
    frames, notes = read(path)
    focus = [f.exposure.focus_distance_m for f in frames]
    assert np.isnan(focus[0])
    assert focus[1:] == [np.inf, 3.5]
    assert len(notes) == 0


def test_an_image_encoding_that_is_not_read_is_said_once(tmp_path: Path) -> None:
    from mcap.writer import Writer

    path = tmp_path / "x.mcap"
    with path.open("wb") as stream:
        w = Writer(stream)
        w.start()
        schema = w.register_schema("foxglove.RawImage", "flatbuffer", b"")
        channel = w.register_channel("/camera", "flatbuffer", schema)
        for index in range(5):
            w.add_message(channel, index, b"\0", index)
        w.finish()
    frames, notes = read(path)
    assert frames == []
    assert [(n.code, n.topic, n.count) for n in notes] == [("unsupported_channel", "/camera", 1)]


def test_the_exif_of_a_picture_fills_what_no_message_tells(tmp_path: Path) -> None:
    own = photo(FNumber=IFDRational(8, 1), FocalLength=IFDRational(35, 1))
    path = tmp_path / "x.mcap"
    with RecordingWriter(path) as w:
        for ms in (0, 100):
            w.write("/i", image_message(own, "jpeg", START_NS + ms * MS, "cam"), START_NS + ms * MS)
        w.write("/e", exposure(100, 2.0), START_NS + 100 * MS)
    frames, _ = read(path)
    assert [f.exposure_pairing for f in frames] == [Pairing.EMBEDDED, Pairing.NEAREST]
    assert [f.exposure.f_number for f in frames] == [8.0, 2.0]
    assert [f.exposure.focal_length_mm for f in frames] == [35.0, 35.0]


def test_the_bits_of_wide_samples_are_those_of_the_brightest_picture_so_far(
    tmp_path: Path,
) -> None:
    path = tmp_path / "x.mcap"
    with RecordingWriter(path) as w:
        for ms, largest in ((0, 0), (100, 4000), (200, 100)):
            pixels = np.full((4, 6), largest, "<u2")
            time_ns = START_NS + ms * MS
            message = RawImage(
                timestamp=timestamp(time_ns),
                frame_id="cam",
                width=6,
                height=4,
                encoding="mono16",
                step=12,
                data=pixels.tobytes(),
            )
            w.write("/i", message, time_ns)
    frames, notes = read(path)
    assert [f.layout and f.layout.bits for f in frames] == [10, 12, 12]
    assert {n.code for n in notes} == {"assumed_bit_depth"}
