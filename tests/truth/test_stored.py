"""Truth of a file in a database: figures in the views, regions, survey, and a recording run again."""

from __future__ import annotations

import math
import shutil
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from pipeline.core.errors import UsageError
from pipeline.core.records import GroundPlane, Intrinsics
from pipeline.optics.ground_plane import project_person
from pipeline.run.truth import match_again
from pipeline.store.database import Store
from pipeline.truth.rows import TruthFile, TruthRow
from pipeline.truth.stored import AddedTruth, add_truth, places_by_survey
from tests.store import rows

FRAMES = 10


@pytest.fixture(scope="module")
def template(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("template") / "empty.duckdb"
    Store.open(path).__exit__(None, None, None)
    return path


@pytest.fixture
def store(template: Path, tmp_path: Path) -> Iterator[Store]:
    shutil.copyfile(template, tmp_path / "a.duckdb")
    with Store.open(tmp_path / "a.duckdb") as opened:
        yield opened


def box(x: float) -> tuple[float, float, float, float]:
    return (x, 20.0, x + 20.0, 80.0)


def measured(store: Store, folder: Path) -> str:
    """Store a recording in which one person is followed as track 0, then 1, and a post is track 2."""
    seen = [(f, 0 if f < 6 else 1, 100.0 + 2 * f) for f in range(FRAMES)]
    seen += [(f, 2, 300.0) for f in range(FRAMES)]
    run = rows.start(store)
    return rows.ingest(
        store,
        run,
        folder / f"parts{run}",
        rows.recording(),
        frames={
            "frame_index": range(FRAMES),
            "capture_time_ns": [f * 100_000_000 for f in range(FRAMES)],
        },
        observations={
            "frame_index": [f for f, _, _ in seen],
            "track_id": [t for _, t, _ in seen],
            "class_name": ["person"] * len(seen),
            "x_min_px": [x for _, _, x in seen],
            "x_max_px": [x + 20 for _, _, x in seen],
        },
        cameras={"camera": ["cam"]},
    )


def person(first: int = 0) -> TruthFile:
    truth = TruthFile("csv", first)
    for f in range(FRAMES):
        truth.add(TruthRow(f + first, "anna", "person", box(100.0 + 2 * f)))
    return truth


def added(store: Store, recording: str, truth: TruthFile, **more: object) -> AddedTruth:
    with store.transaction():
        return add_truth(store, recording, "cam", Path("gt.csv"), truth, **more)  # type: ignore[arg-type]


def figures(
    store: Store, columns: str = "recall, precision, idf1, mota, switch_count"
) -> list[float]:
    return list(store.query(f"SELECT {columns} FROM accuracy.tracking").to_pylist()[0].values())


def test_views_tell_the_figures_of_the_metrics(store: Store, tmp_path: Path) -> None:
    recording = measured(store, tmp_path)
    added(store, recording, person())
    # 10 true boxes, all found, by 6 and 4 of two tracks; 10 false boxes.
    assert figures(store) == pytest.approx([1.0, 0.5, 2 * 6 / 30, 1 - 11 / 10, 1])
    # AssA: each match's identities agree in 6 of 10, or 4 of 10 boxes.
    deta, assa = 0.5, (6 * 0.6 + 4 * 0.4) / 10
    assert figures(store, "hota, deta, assa") == pytest.approx([math.sqrt(deta * assa), deta, assa])
    assert store.query("SELECT count(*) AS n FROM accuracy.detection").to_pylist() == [{"n": 19}]
    by_class = store.query("SELECT class_name, recall FROM accuracy.tracking_by_class").to_pylist()
    assert by_class == [{"class_name": "person", "recall": 1.0}]


def test_boxes_in_ignored_regions_count_neither_way(store: Store, tmp_path: Path) -> None:
    recording = measured(store, tmp_path)
    truth = person()
    truth.add(TruthRow(None, "", None, (290.0, 0.0, 330.0, 90.0)), ignored=True)
    assert added(store, recording, truth).ignored == 1
    assert figures(store)[:2] == [1.0, 1.0]


def test_frames_that_nobody_labelled_count_neither_way(store: Store, tmp_path: Path) -> None:
    recording = measured(store, tmp_path)
    truth = TruthFile("csv", 0)
    truth.add(TruthRow(3, "anna", "person", box(106.0)))
    truth.frames.add(5)  # nobody there
    added(store, recording, truth)
    counts = figures(store, "true_count, observed_count")
    assert counts == [1, 4]


def test_frames_are_numbered_from_where_the_file_begins(store: Store, tmp_path: Path) -> None:
    recording = measured(store, tmp_path)
    assert added(store, recording, person(first=1)).outside == 0
    assert figures(store)[0] == 1.0
    shifted = added(store, recording, person(first=1), first_frame=3)
    assert shifted.outside == 2
    assert [note.code for note in shifted.notes] == ["truth_outside"]
    with pytest.raises(UsageError, match="none of it is of a frame"):
        added(store, recording, person(), first_frame=1000)


def test_heights_of_objects_hold_in_all_their_frames(store: Store, tmp_path: Path) -> None:
    recording = measured(store, tmp_path)
    truth = person()
    truth.add(TruthRow(None, "anna", "person", height_m=1.71))
    added(store, recording, truth)
    heights = store.query("SELECT DISTINCT height_m FROM ground_truth").to_pylist()
    assert heights == [{"height_m": 1.71}]
    matched = store.query(
        "SELECT count(*) AS n FROM matches WHERE true_height_m = 1.71"
    ).to_pylist()
    assert matched == [{"n": FRAMES}]


def test_truth_of_a_file_stays_when_the_recording_is_measured_again(
    store: Store, tmp_path: Path
) -> None:
    recording = measured(store, tmp_path)
    added(store, recording, person())
    assert measured(store, tmp_path) == recording
    with store.transaction():
        match_again(store, recording)
    assert figures(store)[0] == 1.0
    assert store.query("SELECT count(*) AS n FROM ground_truth").to_pylist() == [{"n": FRAMES}]


def test_a_surveyed_pose_tells_where_feet_are() -> None:
    plane = GroundPlane(6.0, math.radians(20.0), math.radians(3.0))
    lens = Intrinsics(1280, 720, 900.0, 905.0, 640.0, 360.0)
    across, ahead = np.array([-3.0, 0.0, 5.0]), np.array([12.0, 20.0, 35.0])
    foot, _ = project_person(across, ahead, 1.7, 6.0, plane.tilt_rad, plane.roll_rad)
    seen = foot * [lens.fx_px, lens.fy_px] + [lens.cx_px, lens.cy_px]
    found = places_by_survey(plane, lens)(seen)
    assert found[:, 1:] == pytest.approx(np.stack([across, ahead], axis=1))
