"""Classes by their names: a person is a person, however a detector writes it."""

from __future__ import annotations

from pathlib import Path

import pytest

import stadimeter
from pipeline.core.calibration import Dimension
from pipeline.core.config import ClassName, Config, SizePrior
from pipeline.core.records import Intrinsics
from pipeline.mcap_file.writer import (
    RecordingWriter,
    calibration_message,
    image_message,
    timestamp,
)
from pipeline.measure.class_names import ClassNames
from schemas.stadimeter_pb2 import Detections
from stadimeter.advice import advice_for
from tests.run.test_recordings import CAMERA, INTRINSICS, LEVEL, START_NS, jpeg


@pytest.mark.parametrize(
    "stated",
    [
        *("person", "Person", "PERSON", "pedestrian", "Pedestrian", "human", "People", "persons"),
        *("person 0.87", "Person: 93%", "person #12", "person_3", "pedestrian (0.5)", " person "),
        *("Human body", "full_body", "man"),
    ],
)
def test_people_are_persons(stated: str) -> None:
    assert ClassNames(Config()).of(stated) == "person"


@pytest.mark.parametrize(
    "stated",
    ["car", "0", "1", "", "unknown", "personal computer", "Person_sitting", "DontCare", "cyclist"],
)
def test_other_things_keep_their_names(stated: str) -> None:
    assert ClassNames(Config()).of(stated) == stated


def test_the_camera_file_names_classes_and_goes_first() -> None:
    config = Config(
        class_name=(ClassName("0", "person"), ClassName("Pedestrian", "child")),
        size_prior=(*Config().size_prior, SizePrior("van", Dimension.HEIGHT, 2.0, 0.2)),
    )
    names = ClassNames(config)
    assert names.of("0") == "person"
    assert names.of("pedestrian") == "child"
    assert names.of("Van 0.9") == "van"
    assert set(names.told()) == {("0", "person"), ("pedestrian", "child"), ("Van 0.9", "van")}
    assert not list(names.told())


def write_named(path: Path, name: str) -> None:
    with RecordingWriter(path) as writer:
        for index in range(12):
            time_ns = START_NS + index * 100_000_000
            writer.write("/image", image_message(jpeg(), "jpeg", time_ns, CAMERA), time_ns)
            lens: Intrinsics = INTRINSICS
            writer.write("/calib", calibration_message(lens, time_ns, CAMERA), time_ns)
            found = Detections(timestamp=timestamp(time_ns), frame_id=CAMERA, detector="hand")
            box = {"x_min_px": 100, "x_max_px": 120, "y_min_px": 107.5, "y_max_px": 179.5}
            found.objects.add(box=box, class_name=name, object_id="p", box_std_px=0.5)
            writer.write("/found", found, time_ns)


@pytest.mark.parametrize("name", ["Pedestrian", "person 0.9", "0"])
def test_boxes_of_any_name_are_measured_and_told(tmp_path: Path, name: str) -> None:
    write_named(tmp_path / "a.mcap", name)
    (tmp_path / "camera.toml").write_text(
        f'[[camera]]\nname = "{CAMERA}"\ncamera_height_m = 1.5\ntilt_deg = 0\n'
        '[[class_name]]\nstated = "0"\nobject_class = "person"\n'
    )
    stadimeter.measure(tmp_path / "a.mcap", tmp_path / "x.duckdb", camera=tmp_path / "camera.toml")
    with stadimeter.open(tmp_path / "x.duckdb") as results:
        rows = results.query(
            "SELECT t.class_name, p.height_m FROM people AS p JOIN tracks AS t USING (track_id)"
        ).rows()
        notes = [r for r in results.view("diagnostics").rows() if r["code"] == "class_renamed"]
    assert [row["class_name"] for row in rows] == ["person"]
    assert rows[0]["height_m"] == pytest.approx(1.8, abs=0.1)
    assert len(notes) == 1
    assert name in notes[0]["message"]


def test_a_number_without_a_name_is_told_with_what_to_do(tmp_path: Path) -> None:
    write_named(tmp_path / "a.mcap", "0")
    stadimeter.measure(tmp_path / "a.mcap", tmp_path / "x.duckdb", camera=LEVEL, strict=False)
    with stadimeter.open(tmp_path / "x.duckdb") as results:
        (finding,) = (r for r in results.view("diagnostics").rows() if r["code"] == "size_unknown")
    assert "'0'" in finding["message"]
    assert "[[class_name]]" in advice_for("size_unknown")
