"""Impossible values are left out one by one; the rest of the message stays."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from pipeline.core.config import Config
from pipeline.core.diagnostics import Notes
from pipeline.core.records import Boxes, Frame, Intrinsics, LensClaim, Severity, TrueObject
from pipeline.ingest.frames import FrameAssembler
from pipeline.ingest.plausibility import inside_picture, refuse_implausible
from pipeline.mcap_file.reader import McapFile
from pipeline.mcap_file.writer import (
    RecordingWriter,
    calibration_message,
    image_message,
    timestamp,
)
from pipeline.messages.content import Decoded
from pipeline.run.recordings import run
from pipeline.store.database import Store
from schemas.stadimeter_pb2 import CameraExposure, Detections, GroundTruth
from tests.run.test_recordings import jpeg

START_NS = 1_700_000_000_000_000_000
GOOD = Intrinsics(640, 480, 500.0, 500.0, 319.5, 239.5)


def test_what_is_plausible_passes_untouched() -> None:
    message = Decoded(
        START_NS, "cam", LensClaim(640, 480, (500.0, 0, 319.5, 0, 500, 239.5, 0, 0, 1))
    )
    assert refuse_implausible(message) is message


def test_boxes_and_truths_lose_what_is_absurd() -> None:
    boxes = Boxes(
        np.array([[0.0, 0, 10, 10]] * 3),
        np.array([0.5, 7.0, np.nan]),
        ("a", "b", "c"),
        np.array([[1.0] * 4, [1.0] * 4, [1e9] * 4]),
        (None, None, None),
    )
    found = refuse_implausible(Decoded(None, "", boxes))
    assert isinstance(found.payload, Boxes)
    assert found.payload.class_name == ("a", "b")
    assert np.isnan(found.payload.score[1])
    assert len(found.refused) == 2
    truth = (TrueObject("p", "person", depth_m=1e300, height_m=1.8, x_m=-math.inf),)
    found = refuse_implausible(Decoded(None, "", truth))
    assert isinstance(found.payload, tuple)
    assert found.payload[0].height_m == 1.8
    assert math.isnan(found.payload[0].depth_m)
    assert math.isnan(found.payload[0].x_m)


@given(st.integers(-(2**70), 2**70))
def test_times_are_in_this_era_or_unknown(time_ns: int) -> None:
    found = refuse_implausible(Decoded(time_ns, "", None)).capture_time_ns
    assert found == (time_ns if 0 < time_ns < 2**63 else None)


@given(st.lists(st.tuples(*[st.floats(-100, 800)] * 2, *[st.floats(1, 300)] * 2), max_size=5))
def test_only_boxes_without_a_pixel_of_the_picture_are_outside(
    rows: list[tuple[float, float, float, float]],
) -> None:
    edges = np.array([[x, y, x + w, y + h] for x, y, w, h in rows]).reshape(-1, 4)
    count = len(rows)
    boxes = Boxes(edges, np.ones(count), ("p",) * count, np.ones((count, 4)), (None,) * count)
    inside, outside = inside_picture(boxes, 640, 480)
    assert len(inside) + len(outside) == count
    for x0, y0, x1, y1 in outside:
        assert x1 <= -0.5 or y1 <= -0.5 or x0 >= 639.5 or y0 >= 479.5


def read(path: Path) -> tuple[list[Frame], Notes]:
    config, notes = Config(), Notes()
    file = McapFile(path, config.limits, notes.add)
    return list(FrameAssembler(file, config.ingest, notes)), notes


def write_absurd(path: Path) -> None:
    """One frame of which almost every value is impossible, and a box and a height that are not."""
    with RecordingWriter(path) as writer:
        for index in range(6):
            time_ns = START_NS + index * 100_000_000
            image = image_message(jpeg(), "jpeg", time_ns, "cam")
            image.timestamp.seconds = -5
            writer.write("/i", image, time_ns)
            absurd = replace(GOOD, fx_px=math.nan)
            writer.write("/c", calibration_message(absurd, time_ns, "cam"), time_ns)
            exposure = CameraExposure(
                timestamp=timestamp(time_ns),
                frame_id="cam",
                f_number=0.0,
                photographic_sensitivity=-100,
                focal_length_mm=math.nan,
                exposure_time_s=0.01,
            )
            writer.write("/e", exposure, time_ns)
            found = Detections(timestamp=timestamp(time_ns), frame_id="cam")
            for x in (100.0, 5000.0, -900.0):
                box = {"x_min_px": x, "x_max_px": x + 30, "y_min_px": 50, "y_max_px": 150}
                found.objects.add(box=box, class_name="person", score=0.9, object_id="p")
            found.objects[0].object_id = "q"
            writer.write("/d", found, time_ns)
            truth = GroundTruth(timestamp=timestamp(time_ns), frame_id="cam")
            truth.objects.add(object_id="q", class_name="person", depth_m=-3.0, height_m=1.7)
            writer.write("/t", truth, time_ns)


def test_the_rest_of_a_message_is_kept(tmp_path: Path) -> None:
    write_absurd(tmp_path / "x.mcap")
    frames, notes = read(tmp_path / "x.mcap")
    assert len(frames) == 6
    assert frames[0].capture_time_ns == START_NS
    assert frames[0].exposure.exposure_time_s == 0.01
    assert math.isnan(frames[0].exposure.f_number)
    assert frames[0].intrinsics is None
    assert frames[0].truth[0].height_m == 1.7
    text = " ".join(note.message for note in notes)
    for words in ("f_number 0", "iso_speed -100", "focal_length_mm nan", "K", "time -5", "depth_m"):
        assert words in text
    assert all(note.severity is not Severity.ERROR for note in notes)


def test_boxes_outside_the_picture_are_refused_in_a_run(tmp_path: Path) -> None:
    write_absurd(tmp_path / "x.mcap")
    result = run([tmp_path / "x.mcap"], tmp_path / "x.duckdb", Config())
    assert not result.damaged
    with Store.open(tmp_path / "x.duckdb", read_only=True) as store:
        rows = store.query("SELECT DISTINCT x_min_px, object_id FROM observations").to_pylist()
        notes = store.query("SELECT message FROM diagnostics WHERE code = 'invalid_value'")
    assert rows == [{"x_min_px": 100.0, "object_id": "q"}]
    assert sum("outside of the picture" in m for m in notes["message"].to_pylist()) == 2
