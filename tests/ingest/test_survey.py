"""The output of `inspect`; a large recording is not read whole for it."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
from foxglove_schemas_protobuf.Quaternion_pb2 import Quaternion
from foxglove_schemas_protobuf.Vector3_pb2 import Vector3

from pipeline.cli.console import out
from pipeline.cli.inspect import print_survey
from pipeline.core.config import Config
from pipeline.ingest import survey as survey_module
from pipeline.ingest.survey import survey
from pipeline.mcap_file.writer import image_message, timestamp
from tests.support.damage import SmallChunks

START_NS, FRAME_NS, COUNT = 10**18, 40_000_000, 60


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    """Write a recording whose clock is set back by a minute in the middle, and a later channel."""
    path = tmp_path / "x.mcap"
    image = np.random.default_rng(0).integers(0, 255, (48, 64, 3), np.uint8)
    jpeg = cv2.imencode(".jpg", image)[1].tobytes()
    with SmallChunks(path) as writer:
        moved = FrameTransform(
            timestamp=timestamp(START_NS),
            parent_frame_id="map",
            child_frame_id="cam",
            translation=Vector3(z=3.0),
            rotation=Quaternion(x=-0.8660254037844387, w=0.5),
        )
        writer.write("/tf", moved, START_NS)
        for index in range(COUNT):
            time_ns = START_NS + index * FRAME_NS
            set_back_ns = 60_000_000_000 if index >= 10 else 0
            writer.write("/i", image_message(jpeg, "jpeg", time_ns - set_back_ns, "cam"), time_ns)
        writer.write("/late", moved, time_ns)
    return path


def shown(path: Path, *, whole: bool) -> str:
    with out.capture() as captured:
        print_survey(survey(path, Config(), whole=whole))
    return " ".join(captured.get().split())


def test_a_small_recording_is_read_whole(recording: Path) -> None:
    text = shown(recording, whole=False)
    for words in (
        "60 frames",
        "pictures jpeg 64x48",
        "clock was set by -60.0 s",
        "3.00 m above 'map', tilted by 30.0 degrees",
        "sha256",
    ):
        assert words in text


def test_of_a_large_recording_the_summary_tells_the_rest(
    recording: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(survey_module, "QUICK_BYTES", recording.stat().st_size // 4)
    found = survey(recording, Config(), whole=False)
    assert not found.is_whole
    assert recording.stat().st_size // 4 < found.read_bytes < recording.stat().st_size // 2
    assert found.cameras[0].frame_count < COUNT
    counts = {c.topic: c.message_count for c in found.channels}
    assert counts == {"/i": COUNT, "/tf": 1, "/late": 1}
    assert found.span_ns == (COUNT - 1) * FRAME_NS
    text = shown(recording, whole=False)
    assert "--whole" in text
    assert "no damage found" not in text
    assert "--whole" not in shown(recording, whole=True)


def test_a_large_recording_without_a_summary_says_so(
    recording: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(survey_module, "QUICK_BYTES", 5000)
    data = recording.read_bytes()
    recording.write_bytes(data[: len(data) // 2])
    assert "it has no summary" in shown(recording, whole=False)
