"""Recordings through both passes and into the database, as the command does it."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Collection
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

import pipeline.run.recording
from dashboards.timeline.split import write_timelines
from pipeline.cluster.shared_run import run_shared
from pipeline.core.config import CameraConfig, Config
from pipeline.core.errors import RecordingFailed, StoreError
from pipeline.core.progress import Progress
from pipeline.core.records import Intrinsics
from pipeline.mcap_file.writer import (
    RecordingWriter,
    calibration_message,
    image_message,
    timestamp,
)
from pipeline.optics.silhouette import mean_reach
from pipeline.run.pass_two import estimate_recording
from pipeline.run.recording import Timelines
from pipeline.run.recordings import estimate_again, run
from pipeline.store.database import Store
from pipeline.store.recordings import RecordingRow
from schemas.stadimeter_pb2 import Detections, GroundTruth
from tests.support.tables import assert_same, everything

START_NS = 1_700_000_000_000_000_000
INTRINSICS = Intrinsics(320, 240, 400.0, 400.0, 159.5, 119.5)
CAMERA = "cam"


def jpeg(value: int = 90) -> bytes:
    image = np.full((240, 320, 3), value, np.uint8)
    return cv2.imencode(".jpg", image)[1].tobytes()


def write_people(
    path: Path, frames: int = 12, *, broken: int | None = None, first: int = 0
) -> None:
    """Two recorded people of 1.6 and 1.8 m, 10 m away, before a level camera at 1.5 m."""
    with RecordingWriter(path) as writer:
        for index in range(first, first + frames):
            time_ns = START_NS + index * 100_000_000
            data = b"\xff\xd8broken" if index == broken else jpeg()
            writer.write("/image", image_message(data, "jpeg", time_ns, CAMERA), time_ns)
            writer.write("/calib", calibration_message(INTRINSICS, time_ns, CAMERA), time_ns)
            found = Detections(timestamp=timestamp(time_ns), frame_id=CAMERA, detector="hand")
            truth = GroundTruth(timestamp=timestamp(time_ns), frame_id=CAMERA)
            for number, height_m in enumerate((1.6, 1.8)):
                y_max = 119.5 + 400 * 1.5 / 10
                x = 100 + 60 * number
                box = {
                    "x_min_px": x,
                    "x_max_px": x + 20,
                    "y_min_px": y_max - 400 * height_m / 10,
                    "y_max_px": y_max,
                }
                found.objects.add(
                    box=box, class_name="person", object_id=f"p{number}", box_std_px=0.5
                )
                truth.objects.add(
                    object_id=f"p{number}",
                    class_name="person",
                    depth_m=10.0,
                    height_m=height_m,
                    box=box,
                )
            writer.write("/found", found, time_ns + 5_000_000)
            writer.write("/truth", truth, time_ns + 6_000_000)


@pytest.fixture
def people(tmp_path: Path) -> Path:
    path = tmp_path / "people.mcap"
    write_people(path)
    return path


LEVEL = Config(camera=(CameraConfig(CAMERA, camera_height_m=1.5, tilt_deg=0.0),))


def test_the_ground_method_is_right_where_the_pose_is_given(people: Path, tmp_path: Path) -> None:
    db = tmp_path / "x.duckdb"
    result = run([people], db, LEVEL)
    assert [o.path for o in result.stored] == [people]
    with Store.open(db, read_only=True) as store:
        rows = store.query(
            "SELECT true_depth_m, depth_m, true_height_m, height_m FROM accuracy.errors "
            "WHERE method = 'ground'"
        ).to_pylist()
    assert len(rows) == 24
    for row in rows:
        # the boxes are of lines, people are bodies: their axis is behind their toes
        reach_m = float(mean_reach(0.0)) * row["true_height_m"]
        assert row["depth_m"] == pytest.approx(10.0 + reach_m, rel=0.005)
        assert row["height_m"] == pytest.approx(row["true_height_m"], rel=0.01)


def test_a_height_from_a_prior_is_marked_as_assumed(people: Path, tmp_path: Path) -> None:
    db = tmp_path / "x.duckdb"
    run([people], db, Config())
    with Store.open(db, read_only=True) as store:
        rows = store.query("FROM estimates WHERE method = 'size'").to_pylist()
        counted = store.query(
            "SELECT sum(height_count) AS n FROM accuracy.by_method WHERE method = 'size'"
        ).to_pylist()
    assert rows
    assert all(row["height_assumed"] for row in rows)
    assert not counted[0]["n"]


def test_a_second_run_replaces_the_first(people: Path, tmp_path: Path) -> None:
    db = tmp_path / "x.duckdb"
    counts = []
    for name in ("people.mcap", "renamed.mcap"):
        path = tmp_path / name
        if path != people:
            people.rename(path)
        run([path], db, LEVEL)
        with Store.open(db, read_only=True) as store:
            counts.append(
                [
                    store.query(f"SELECT count(*) AS n FROM {t}").to_pylist()[0]["n"]
                    for t in ("recordings", "frames", "observations", "estimates", "ground_truth")
                ]
            )
    assert counts[0] == counts[1] == [1, 12, 24, counts[0][3], 24]


def test_estimating_again_keeps_the_old_run_beside_the_new_one(
    people: Path, tmp_path: Path
) -> None:
    db = tmp_path / "x.duckdb"
    run([people], db, Config())
    _, count = estimate_again(db, LEVEL, "with pose")
    assert count == 1
    with Store.open(db, read_only=True) as store:
        runs = store.query("SELECT count(DISTINCT run_id) AS n FROM estimates").to_pylist()
        current = store.query("SELECT DISTINCT method FROM current_estimates").to_pylist()
    assert runs[0]["n"] == 2
    assert {"method": "ground"} in current


def test_every_observation_is_judged_in_every_run(people: Path, tmp_path: Path) -> None:
    db = tmp_path / "x.duckdb"
    run([people], db, Config())
    estimate_again(db, LEVEL, "with pose")
    with Store.open(db, read_only=True) as store:
        rows = store.query(
            "SELECT run_id, count(*) AS n, count(DISTINCT observation_index) AS observations, "
            "min(quality) AS worst, bool_and(contact_visible) AS feet "
            "FROM observation_quality GROUP BY run_id"
        ).to_pylist()
        methods = store.query("SELECT DISTINCT method FROM current_estimates").to_pylist()
    assert [(r["n"], r["observations"], r["worst"], r["feet"]) for r in rows] == [
        (24, 24, 1.0, True)
    ] * 2
    assert {"method": "fused"} in methods


def test_an_undecodable_picture_costs_that_picture_only(tmp_path: Path) -> None:
    path, db = tmp_path / "broken.mcap", tmp_path / "x.duckdb"
    write_people(path, broken=3)
    result = run([path], db, LEVEL)
    assert result.damaged
    assert result.damaged[0].recording is not None
    assert result.damaged[0].recording.frames_lost == 1
    with Store.open(db, read_only=True) as store:
        frames = store.query("SELECT count(*) AS n FROM frames WHERE decoded").to_pylist()
        notes = store.query(
            "SELECT topic, byte_offset, log_time_ns FROM diagnostics "
            "WHERE code = 'undecodable_image'"
        ).to_pylist()
    assert frames[0]["n"] == 11
    assert notes[0]["topic"] == "/image"
    assert notes[0]["log_time_ns"] == START_NS + 300_000_000
    assert notes[0]["byte_offset"] > 0


def test_a_file_that_is_no_recording_does_not_stop_the_others(people: Path, tmp_path: Path) -> None:
    bad, empty, db = tmp_path / "bad.mcap", tmp_path / "empty.mcap", tmp_path / "x.duckdb"
    bad.write_bytes(jpeg())
    empty.touch()
    result = run([bad, people, empty, tmp_path / "absent.mcap"], db, LEVEL)
    assert [o.path.name for o in result.stored] == ["people.mcap"]
    assert len(result.failed) == 3
    assert str(bad) in str(result.failed[0].error)
    with Store.open(db, read_only=True) as store:
        rows = store.query(
            "SELECT file_name FROM diagnostics WHERE code = 'unreadable_file'"
        ).to_pylist()
    assert {row["file_name"] for row in rows} == {"bad.mcap", "empty.mcap", "absent.mcap"}


@pytest.mark.slow
def test_workers_give_the_same_rows_as_one_process(tmp_path: Path) -> None:
    paths = [tmp_path / f"{number}.mcap" for number in range(3)]
    for number, path in enumerate(paths):
        write_people(path, frames=10 + number, broken=number)
    copy, bad = tmp_path / "copy.mcap", tmp_path / "bad.mcap"
    shutil.copy(paths[0], copy)
    bad.write_bytes(b"no recording")
    paths += [copy, bad]
    found = []
    for workers in (1, 2):
        folder = tmp_path / f"by {workers}"
        said: list[Progress] = []
        result = run(
            paths,
            folder / "x.duckdb",
            LEVEL,
            timelines=Timelines(folder / "rrd", write_timelines),
            workers=workers,
            label="night",
            report=said.append,
        )
        assert [o.path for o in result.outcomes] == paths
        assert [o.path for o in result.failed] == [bad]
        stages = {"decode", "estimate", "store", "timeline"}
        assert all(stages <= set(o.times.spent) for o in result.stored)
        assert {(p.file_name, p.stage) for p in said} >= {
            (path.name, stage) for path in paths[:4] for stage in ("measure", "estimate", "done")
        }
        assert {p.name for p in folder.iterdir()} == {"x.duckdb", "rrd"}
        assert {p.stem for p in (folder / "rrd").iterdir()} == {"0", "1", "2", "copy"}
        with Store.open(folder / "x.duckdb", read_only=True) as store:
            found.append(everything(store))
    assert_same(found[1], found[0])
    assert len(found[0]["estimates"]) > 0
    assert set(found[0]["recordings"].file_name) == {"copy.mcap", "1.mcap", "2.mcap"}


def test_nothing_is_left_beside_the_database(people: Path, tmp_path: Path) -> None:
    folder = tmp_path / "out"
    run([people], folder / "x.duckdb", LEVEL)
    assert [p.name for p in folder.iterdir()] == ["x.duckdb"]


@pytest.mark.parametrize("new", [True, False])
def test_a_database_that_cannot_be_prepared_ends_the_run(
    people: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, new: bool
) -> None:
    database = tmp_path / "out.duckdb"
    if not new:
        run([people], database, LEVEL)
    measured: list[Path] = []
    measure = pipeline.run.recording.measure_recording

    def seen(path: Path, *rest: Any, **named: Any) -> RecordingRow:
        measured.append(path)
        return measure(path, *rest, **named)

    def refuse(store: Store, views: Collection[str] = ()) -> None:
        raise StoreError("no room for tables")

    monkeypatch.setattr(pipeline.run.recording, "measure_recording", seen)
    monkeypatch.setattr(Store, "prepare", refuse)
    with pytest.raises(StoreError, match="no room for tables"):
        run([people], database, LEVEL)
    # Who has a database already is told before anything is measured.
    assert measured == ([people] if new else [])
    monkeypatch.undo()
    assert len(run([people], database, LEVEL).stored) == 1  # it is let go of, and of use again


def fail_on(name: str) -> Callable[..., None]:
    """Estimate as always, but for one recording, which meets an error that nobody foresaw."""

    def estimate(store: Store, key: str, run_id: str, file_name: str, config: Config) -> None:
        if file_name == name:
            raise np.linalg.LinAlgError("Singular matrix")
        estimate_recording(store, key, run_id, file_name, config)

    return estimate


def test_an_unforeseen_error_costs_one_recording(
    people: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    bad, database = tmp_path / "bad.mcap", tmp_path / "x.duckdb"
    write_people(bad, frames=9)
    monkeypatch.setattr(pipeline.run.recording, "estimate_recording", fail_on("bad.mcap"))
    result = run([bad, people], database, LEVEL)
    assert [o.path for o in result.stored] == [people]
    (failed,) = result.failed
    assert isinstance(failed.error, RecordingFailed)
    shared = run_shared([bad, people], tmp_path / "parts", LEVEL)
    assert [f.path.name for f in shared.made] == ["people.mcap"]
    assert shared.failed[0].error is not None
    for said in (str(failed.error), str(shared.failed[0].error)):
        assert said.startswith(f"{bad}: ")
        assert "LinAlgError: Singular matrix (test_recordings.py:" in said
    with Store.open(database, read_only=True) as store:
        rows = store.query("SELECT * FROM diagnostics WHERE severity = 'error'").to_pylist()
        assert store.query("SELECT DISTINCT recording_id FROM frames").num_rows == 1
    assert [(r["code"], r["file_name"], r["recording_id"]) for r in rows] == [
        ("recording_failed", "bad.mcap", None)
    ]


def test_a_timeline_that_cannot_be_written_costs_no_numbers(people: Path, tmp_path: Path) -> None:
    def refuse(store: Store, key: str, file: Path, folder: Path, config: Config) -> list[Path]:
        raise PermissionError(13, "Permission denied", str(folder))

    result = run(
        [people], tmp_path / "x.duckdb", LEVEL, timelines=Timelines(tmp_path / "no", refuse)
    )
    assert [o.path for o in result.stored] == [o.path for o in result.failed] == [people]
    assert str(tmp_path / "no") in str(result.failed[0].error)
    with Store.open(tmp_path / "x.duckdb", read_only=True) as store:
        rows = store.query("SELECT recording_id FROM diagnostics WHERE code = 'timeline_failed'")
        assert rows.equals(store.query("SELECT recording_id FROM recordings"))
        assert store.query("FROM estimates").num_rows > 0


def test_a_key_that_another_recording_has_costs_one_recording(
    people: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    other, database = tmp_path / "other.mcap", tmp_path / "x.duckdb"
    write_people(other, frames=9)
    monkeypatch.setattr(RecordingRow, "recording_id", property(lambda _: "same"))
    result = run([people, other], database, LEVEL)
    assert [o.path for o in result.stored] == [people]
    assert "taken by another recording" in str(result.failed[0].error)
