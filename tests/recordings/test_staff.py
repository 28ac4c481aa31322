"""The recording `staff` says what the paper's tables say, no more and no less."""

from __future__ import annotations

import csv
import io
import itertools
import math
import re

import pytest
from mcap.reader import make_reader

from recordings.simulate_staff import write
from tests.recordings.conftest import RECORDINGS

SCALE = 0.25
IMAGE, CALIBRATION = "foxglove.CompressedImage", "foxglove.CameraCalibration"
EXPOSURE, TRUTH = "stadimeter.CameraExposure", "stadimeter.GroundTruth"
DETECTIONS = "stadimeter.Detections"


def _only(message):
    assert len(message.objects) == 1
    return message.objects[0]


def _sizes_px(staff, begin, end):
    """Width and height of the boxes, in pixels of the sensor."""
    boxes = [_only(m).box for m in staff.messages[DETECTIONS][begin:end]]
    widths = [(b.x_max_px - b.x_min_px) / SCALE for b in boxes]
    return widths, [(b.y_max_px - b.y_min_px) / SCALE for b in boxes]


def _content(path):
    """Return all that a recording says; its schemas may have learned of more messages since."""
    with path.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        messages = [
            (schema.name, channel.topic, message.log_time, message.data)
            for schema, channel, message in reader.iter_messages()
        ]
        attachments = [(a.name, a.data) for a in reader.iter_attachments()]
        return messages, attachments, [(m.name, m.metadata) for m in reader.iter_metadata()]


@pytest.mark.slow
def test_regenerating_gives_the_same_messages_byte_for_byte(tmp_path):
    write(tmp_path / "staff.mcap")
    assert _content(tmp_path / "staff.mcap") == _content(RECORDINGS / "staff.mcap")


def test_it_is_small():
    assert (RECORDINGS / "staff.mcap").stat().st_size < 3_000_000


def test_every_frame_has_all_its_messages(staff):
    times = staff.log_times_ns[IMAGE]
    assert len(times) == 57
    assert {b - a for a, b in itertools.pairwise(times)} == {1_000_000_000}
    for name in (IMAGE, CALIBRATION, EXPOSURE, TRUTH, DETECTIONS):
        assert staff.log_times_ns[name] == times
        for message, time_ns in zip(staff.messages[name], times, strict=True):
            assert message.frame_id == "nikon_d5300"
            assert message.timestamp.seconds * 10**9 + message.timestamp.nanos == time_ns
    assert len(staff.messages) == 5


def test_chunks_are_small(staff):
    assert 2 <= len(staff.chunks) <= 4
    assert max(c.chunk_length for c in staff.chunks) < 1.2 * 2**20


def test_camera(staff, depth_rows, height_rows):
    f_numbers = [float(r["f_number"]) for r in depth_rows + height_rows]
    for message, f_number in zip(staff.messages[EXPOSURE], f_numbers, strict=True):
        assert message.f_number == f_number
        assert message.exposure_time_s == 0.01
        assert message.photographic_sensitivity == 1000
        assert message.focal_length_mm == 50
        assert message.focus_distance_m == math.inf
        assert message.pixel_pitch_x_um == message.pixel_pitch_y_um == 3.9
        assert (message.sensor_width_px, message.sensor_height_px) == (6000, 4000)
        for unknown in ("gain_db", "exposure_bias_ev", "brightness_ev", "digital_zoom_ratio"):
            assert not message.HasField(unknown)
    focal_px = 50e3 / 3.9 * SCALE
    for message in staff.messages[CALIBRATION]:
        assert (message.width, message.height) == (1500, 1000)
        expected = [focal_px, 0, 749.5, 0, focal_px, 499.5, 0, 0, 1]
        assert list(message.K) == pytest.approx(expected)


def test_tables_3_to_7(staff, depth_rows):
    widths, heights = _sizes_px(staff, 0, 35)
    assert widths == pytest.approx([float(r["object_width_px"]) for r in depth_rows])
    assert heights == pytest.approx([4000] * 35)
    for row, message in zip(depth_rows, staff.messages[TRUTH][:35], strict=True):
        truth = _only(message)
        assert truth.object_id == f"table{row['paper_table']}/row{row['row']}"
        assert truth.depth_m == pytest.approx(float(row["actual_depth_cm"]) / 100)
        assert {f.name for f, _ in truth.ListFields()} == {"object_id", "class_name", "depth_m"}


def test_tables_9_and_10(staff, height_rows):
    _, heights = _sizes_px(staff, 35, 57)
    assert heights == pytest.approx([float(r["image_height_px"]) for r in height_rows])
    assert max(heights) == pytest.approx(4009.99)  # as printed, larger than the picture
    for row, message in zip(height_rows, staff.messages[TRUTH][35:], strict=True):
        truth, number = _only(message), int(row["row"])
        assert truth.object_id == f"table{9 if number <= 12 else 10}/row{number}"
        assert truth.height_m == pytest.approx(float(row["actual_height_cm"]) / 100)
        assert {f.name for f, _ in truth.ListFields()} == {"object_id", "class_name", "height_m"}


def test_derived_widths_give_the_depth_column_back(staff, height_rows, table_8):
    # In the paper's own mixed units: f and O_s in cm, a_R in mm.
    used_k = {**table_8, 1.8: 0.4545, 2.8: 0.666, 3.2: 0.769, 3.5: 0.85, 4.0: 0.95}
    share = math.log(5 / 4.5) / math.log(5.6 / 4.5)
    used_k[5.0] = 0.95 + share * (1.12 - 0.95)
    widths, _ = _sizes_px(staff, 35, 57)
    errata = 0
    for row, width_px in zip(height_rows, widths, strict=True):
        f_number = float(row["f_number"])
        size_cm = width_px * 3.9e-4
        depth_cm = used_k[f_number] * 5 * (50 / f_number / 2) / size_cm
        implied = re.search(r"implies ([\d.]+) cm", row["erratum"])
        errata += implied is not None
        expected = float(implied[1] if implied else row["estimated_depth_cm"])
        assert depth_cm == pytest.approx(expected, abs=0.01)
    assert errata == 5


def test_detections_name_their_objects(staff):
    for found, truth in zip(staff.messages[DETECTIONS], staff.messages[TRUTH], strict=True):
        assert found.detector == "paper crop"
        assert _only(found).object_id == _only(truth).object_id
        assert _only(found).class_name == _only(truth).class_name == "levelling_staff"
        assert _only(found).box_std_px == SCALE
        assert not _only(found).HasField("score")
        box = _only(found).box
        assert (box.x_min_px + box.x_max_px) / 2 == pytest.approx(749.5)
        assert (box.y_min_px + box.y_max_px) / 2 == pytest.approx(499.5)


def test_errata_are_listed(staff, depth_rows, height_rows):
    listed = list(csv.DictReader(io.StringIO(staff.attachments["errata.csv"].decode())))
    errata = [r["erratum"] for r in depth_rows + height_rows if r["erratum"]]
    assert [r["erratum"] for r in listed] == errata
    assert "table4/row4" in {r["object_id"] for r in listed}


def test_provenance_is_in_the_file(staff):
    provenance = staff.metadata["provenance"]
    assert "(2021) 3:595" in provenance["what"]
    assert "CC BY 4.0" in provenance["licence"]
