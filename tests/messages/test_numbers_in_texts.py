"""Numbers by key in diagnostics, and in JSON that a text holds."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import pytest
from mcap.writer import Writer

from pipeline.core.config import CameraConfig, Config, ExposureFields
from pipeline.core.diagnostics import Notes
from pipeline.core.errors import UsageError
from pipeline.ingest.frames import FrameAssembler
from pipeline.mcap_file.reader import McapFile
from pipeline.mcap_file.writer import image_message, schema_of
from pipeline.messages.named_numbers import named_numbers

START_NS = 1_700_000_000_000_000_000
DIAGNOSTICS = {
    "status": [
        {"name": "disk", "values": [{"key": "free", "value": "3"}]},
        {
            "name": "cam: driver",
            "values": [
                {"key": "gain", "value": "12"},
                {"key": "Exposure (us)", "value": "8000"},
                {"key": "fnumber", "value": "2.8 (auto)"},
            ],
        },
    ]
}
META = {"data": json.dumps({"lens": {"fnumber": "5.6"}, "list": [1, {"t": 0.004}], "bad": "x"})}


def value_at(tree: dict[str, Any], spec: str, field: str = "exposure_time_s") -> float:
    camera = CameraConfig("cam", exposure=ExposureFields(**{field: spec}))
    (named,) = named_numbers([camera])
    return named.value(tree, "/d")


@pytest.mark.parametrize(
    ("tree", "spec", "expected"),
    [
        (DIAGNOSTICS, '/d.status["cam: driver"].values["Exposure (us)"] us', 0.008),
        (DIAGNOSTICS, '/d.status[1].values["Exposure (us)"] us', 0.008),
        (DIAGNOSTICS, "/d.status[1].values.gain s", 12.0),
        (DIAGNOSTICS, "/d.status.disk.values.free s", 3.0),
        (META, "/d.data.list[1].t s", 0.004),
        (META, "/d.data.lens.fnumber s", 5.6),
        ({"a": {"b c": 2}}, '/d.a["b c"] s', 2.0),
        ({"a": json.dumps(json.dumps({"b": 7}))}, "/d.a.b s", math.nan),  # JSON in JSON is text
        (DIAGNOSTICS, "/d.status[1].values.fnumber s", math.nan),  # no number
        (DIAGNOSTICS, "/d.status[1].values.absent s", math.nan),
        (DIAGNOSTICS, "/d.status[7].values.gain s", math.nan),
        (META, "/d.data.bad.worse s", math.nan),
        ({"data": "[" * 100_000}, "/d.data.x s", math.nan),
        ({"data": "no JSON"}, "/d.data.x s", math.nan),
    ],
)
def test_a_number_is_found_by_key_and_inside_of_texts(
    tree: dict[str, Any], spec: str, expected: float
) -> None:
    assert value_at(tree, spec) == pytest.approx(expected, nan_ok=True)


def test_a_path_with_blanks_needs_quotes() -> None:
    with pytest.raises(UsageError):
        value_at(DIAGNOSTICS, "/d.status.cam: driver.values.gain us")


def _cdr_text(content: str) -> bytes:
    data = content.encode() + b"\0"
    return b"\0\1\0\0" + len(data).to_bytes(4, "little") + data


@pytest.mark.parametrize(
    "content",
    [{"f_number": 4.0, "exposure_time_s": 0.01}, {"focal_length_mm": 4.0, "unknown": [1]}],
)
def test_exposure_as_json_in_a_text_message_is_read(
    tmp_path: Path, content: dict[str, Any]
) -> None:
    path = tmp_path / "x.mcap"
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        text = writer.register_schema("std_msgs/msg/String", "ros2msg", b"string data")
        channel = writer.register_channel("/cam/meta", "cdr", text)
        other = writer.register_channel("/talk", "cdr", text)
        image = image_message(b"x", "jpeg", START_NS, "cam")
        kind = writer.register_schema(image.DESCRIPTOR.full_name, "protobuf", schema_of(image))
        camera = writer.register_channel("/cam/i", "protobuf", kind)
        for n in range(3):
            time_ns = START_NS + n * 10**8
            writer.add_message(other, time_ns, _cdr_text("hello"), time_ns)
            writer.add_message(channel, time_ns, _cdr_text(json.dumps(content)), time_ns)
            message = image_message(b"x", "jpeg", time_ns, "cam").SerializeToString()
            writer.add_message(camera, time_ns, message, time_ns)
        writer.finish()
    config, notes = Config(), Notes()
    file = McapFile(path, config.limits, notes.add)
    frames = list(FrameAssembler(file, config.ingest, notes))
    assert len(frames) == 3
    for name, value in content.items():
        if name != "unknown":
            assert {getattr(f.exposure, name) for f in frames} == {value}
    assert not notes.lost_data
