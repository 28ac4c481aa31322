"""Class names that a recording states for the numbers of its boxes (vision_msgs/LabelInfo)."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from mcap.writer import Writer

from pipeline.core.config import Config
from pipeline.core.diagnostics import Notes
from pipeline.ingest.frames import FrameAssembler
from pipeline.mcap_file.reader import McapFile
from pipeline.messages.content import ClassLabels
from pipeline.messages.labels import label_info

START_NS, STEP_NS, COUNT = 1_700_000_000_000_000_000, 100_000_000, 4
NAMES = {"0": "person", "2": "car"}


def labels(names: dict[str, str]) -> dict[str, Any]:
    rows = [{"class_id": int(number), "class_name": name} for number, name in names.items()]
    return {"header": {"stamp": {"sec": 0, "nanosec": 0}}, "class_map": rows, "threshold": 0.5}


def found(time_ns: int, classes: list[str]) -> dict[str, Any]:
    rows = [
        {
            "results": [{"hypothesis": {"class_id": name, "score": 0.9}}],
            "bbox": {
                "center": {"position": {"x": 50.0 + 20 * i, "y": 50.0}},
                "size_x": 9,
                "size_y": 30,
            },
        }
        for i, name in enumerate(classes)
    ]
    return {"header": header(time_ns), "detections": rows}


def header(time_ns: int) -> dict[str, Any]:
    return {"stamp": {"sec": time_ns // 10**9, "nanosec": time_ns % 10**9}, "frame_id": "cam"}


def classes_read(path: Path, lists: dict[str, dict[str, str]], stated: list[str]) -> list[str]:
    """Write boxes on /left/found and lists of names on the topics given; return the names read."""
    with path.open("wb") as out:
        writer = Writer(out)
        writer.start()

        def channel(topic: str, schema: str) -> int:
            return writer.register_channel(
                topic, "json", writer.register_schema(schema, "jsonschema", b"{}")
            )

        for topic, names in lists.items():
            data = json.dumps(labels(names)).encode()
            writer.add_message(
                channel(topic, "vision_msgs/msg/LabelInfo"), START_NS, data, START_NS
            )
        boxes = channel("/left/found", "vision_msgs/msg/Detection2DArray")
        pictures = channel("/left/image", "sensor_msgs/msg/CompressedImage")
        for number in range(COUNT):
            time_ns = START_NS + number * STEP_NS
            picture = {"header": header(time_ns), "format": "jpeg", "data": [0xFF, 0xD8, number]}
            for which, tree in ((pictures, picture), (boxes, found(time_ns, stated))):
                writer.add_message(which, time_ns, json.dumps(tree).encode(), time_ns)
        writer.finish()
    config, notes = Config(), Notes()
    file = McapFile(path, config.limits, notes.add)
    frames = list(FrameAssembler(file, config.ingest, notes))
    assert len(frames) == COUNT
    return [name for frame in frames if frame.detections for name in frame.detections.class_name]


def test_the_message_is_read_and_empty_names_are_left_out() -> None:
    tree = labels({**NAMES, "7": " "})
    assert label_info(tree).payload == ClassLabels(NAMES)
    assert label_info({"class_map": []}).payload is None


@pytest.mark.parametrize("stated", ["0", "00", " 0", "0.0"])
def test_numbers_get_the_names_that_the_recording_states(tmp_path: Path, stated: str) -> None:
    read = classes_read(tmp_path / "x.mcap", {"/left/labels": NAMES}, [stated, "2", "5", "dog"])
    assert read == ["person", "car", "5", "dog"] * COUNT


def test_of_two_lists_the_one_of_the_boxes_namespace_is_used(tmp_path: Path) -> None:
    lists = {"/right/labels": {"0": "van"}, "/left/labels": NAMES}
    assert classes_read(tmp_path / "x.mcap", lists, ["0"]) == ["person"] * COUNT


def test_without_a_list_numbers_stay(tmp_path: Path) -> None:
    assert classes_read(tmp_path / "x.mcap", {}, ["0"]) == ["0"] * COUNT
