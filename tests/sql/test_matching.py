"""Matching of observations with true objects."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.optimize import linear_sum_assignment

from pipeline.store.database import Store
from pipeline.store.matches import add_matches
from tests.store.rows import ingest, recording, start

EDGES = ("x_min_px", "y_min_px", "x_max_px", "y_max_px")


def boxes(rows: list[tuple[float, float, float, float] | None]) -> dict[str, list[float | None]]:
    return {
        name: [None if row is None else float(row[side]) for row in rows]
        for side, name in enumerate(EDGES)
    }


def match(store: Store, folder: Path, observations: dict, truth: dict) -> list[dict]:
    count = max(len(v) for v in truth.values())
    truth = {**boxes([None] * count), **truth}
    key = ingest(
        store, start(store), folder, recording(), observations=observations, ground_truth=truth
    )
    return store.read("matches", key).to_pylist()


def pairs(rows: list[dict]) -> set[tuple[int, str, str]]:
    return {(r["observation_index"], r["object_id"], r["rule"]) for r in rows}


def test_ids_go_before_boxes(store: Store, tmp_path: Path) -> None:
    """Boxes say the contrary of the ids: each lies on the other's."""
    a, b = (0, 0, 10, 10), (100, 0, 110, 10)
    rows = match(
        store,
        tmp_path,
        {"object_id": ["a", "b"], **boxes([a, b])},
        {"object_id": ["a", "b"], **boxes([b, a])},
    )
    assert pairs(rows) == {(0, "a", "object_id"), (1, "b", "object_id")}
    assert {r["overlap"] for r in rows} == {0.0}


def test_ids_need_no_boxes(store: Store, tmp_path: Path) -> None:
    rows = match(store, tmp_path, {"object_id": ["a"]}, {"object_id": ["a"]})
    assert pairs(rows) == {(0, "a", "object_id")}
    assert rows[0]["overlap"] is None


def test_an_id_that_truth_knows_never_matches_another_object(store: Store, tmp_path: Path) -> None:
    box = (0, 0, 10, 10)
    rows = match(
        store,
        tmp_path,
        {"object_id": ["a"], "frame_index": [1], **boxes([box])},
        {"object_id": ["a", "b"], "frame_index": [0, 1], **boxes([box, box])},
    )
    assert rows == []


def test_another_numbering_falls_back_to_boxes(store: Store, tmp_path: Path) -> None:
    box = (0, 0, 10, 10)
    rows = match(
        store,
        tmp_path,
        {"object_id": ["17"], **boxes([box])},
        {"object_id": ["person_3"], **boxes([box])},
    )
    assert pairs(rows) == {(0, "person_3", "overlap")}


def test_one_id_twice_in_a_frame_is_one_match(store: Store, tmp_path: Path) -> None:
    far, near = (50, 0, 60, 10), (1, 0, 11, 10)
    rows = match(
        store,
        tmp_path,
        {"object_id": ["a", "a"], "track_id": [0, 1], **boxes([far, near])},
        {"object_id": ["a"], **boxes([(0, 0, 10, 10)])},
    )
    assert pairs(rows) == {(1, "a", "object_id")}


def test_half_is_enough_and_less_is_not(store: Store, tmp_path: Path) -> None:
    truth = (0, 0, 10, 10)
    just, under = (0, 0, 10, 20), (0, 0, 10, 20.1)
    rows = match(
        store,
        tmp_path,
        {"frame_index": [0, 1], **boxes([just, under])},
        {"frame_index": [0, 1], "object_id": ["a", "b"], **boxes([truth, truth])},
    )
    assert pairs(rows) == {(0, "a", "overlap")}
    assert rows[0]["overlap"] == 0.5


def test_each_must_be_the_others_best(store: Store, tmp_path: Path) -> None:
    """Two detections of one object: the better one has it, the other has nothing."""
    rows = match(
        store,
        tmp_path,
        {"track_id": [0, 1], **boxes([(0, 0, 10, 13), (0, 0, 10, 11)])},
        {"object_id": ["a"], **boxes([(0, 0, 10, 10)])},
    )
    assert pairs(rows) == {(1, "a", "overlap")}


def test_equal_overlaps_are_settled_once(store: Store, tmp_path: Path) -> None:
    box = (0, 0, 10, 10)
    rows = match(
        store,
        tmp_path,
        {"track_id": [0, 1], **boxes([box, box])},
        {"object_id": ["a", "b"], **boxes([box, box])},
    )
    assert pairs(rows) == {(0, "a", "overlap")}


def test_cameras_and_frames_stay_apart(store: Store, tmp_path: Path) -> None:
    rows = match(
        store,
        tmp_path,
        {"camera": ["l", "r"], "frame_index": [0, 0]},
        {
            "camera": ["r", "l"],
            "frame_index": [0, 1],
            "object_id": ["a", "a"],
            **boxes([(10, 20, 30, 80)] * 2),
        },
    )
    assert [(r["camera"], r["observation_index"]) for r in rows] == [("r", 1)]


def test_what_is_true_comes_along(store: Store, tmp_path: Path) -> None:
    key = ingest(
        store,
        start(store),
        tmp_path,
        recording(),
        frames={"f_number": [2.8], "capture_time_ns": [123]},
        observations={"object_id": ["a"], "class_name": ["dog"], "track_id": [7]},
        ground_truth={
            "object_id": ["a"],
            "depth_m": [3.0],
            "range_m": [3.5],
            "height_m": [None],
        },
    )
    row = store.read("matches", key).to_pylist()[0]
    expected = {
        "track_id": 7,
        "class_name": "dog",  # the truth has no class
        "capture_time_ns": 123,
        "f_number": 2.8,
        "true_depth_m": 3.0,
        "true_range_m": 3.5,
        "true_height_m": None,
    }
    assert {name: row[name] for name in expected} == expected


def test_stretches_of_frames_say_what_the_whole_says(store: Store, tmp_path: Path) -> None:
    """The id `a` is known to the truth, though only in a frame of another stretch."""
    box, other = (0, 0, 10, 10), (50, 0, 60, 10)
    seen = [box, other, box, other, box, box]
    key = ingest(
        store,
        start(store),
        tmp_path,
        recording(),
        observations={
            "frame_index": [0, 0, 3, 3, 4, 9],
            "track_id": [0, 1, 0, 1, 0, 2],
            "object_id": ["a", "x", None, "x", "a", "a"],
            **boxes(seen),
        },
        ground_truth={
            "frame_index": [0, 0, 3, 3, 4, 8, 9],
            "object_id": ["b", "c", "b", "c", "b", "a", "b"],
            **boxes([*seen[:5], box, box]),
        },
    )
    whole = store.read("matches", key).to_pylist()
    assert pairs(whole) == {(1, "c", "overlap"), (2, "b", "overlap"), (3, "c", "overlap")}
    for stretch in (1, 2, 4):
        with store.transaction():
            store.connection.execute("DELETE FROM matches")
            add_matches(store, key, stretch)
        assert store.read("matches", key).to_pylist() == whole


def iou(a: np.ndarray, b: np.ndarray) -> float:
    width = min(a[2], b[2]) - max(a[0], b[0])
    height = min(a[3], b[3]) - max(a[1], b[1])
    common = max(width, 0) * max(height, 0)
    area = [(r[2] - r[0]) * (r[3] - r[1]) for r in (a, b)]
    return common / (area[0] + area[1] - common)


def test_against_optimal_assignment_where_boxes_are_clear(store: Store, tmp_path: Path) -> None:
    """Jittered copies of well-separated boxes: mutual best is the optimal assignment."""
    rng = np.random.default_rng(2)
    count = 40
    corner = rng.permutation(count)[:, None] * [60.0, 0.0]
    true = np.hstack([corner, corner + rng.uniform(20, 50, (count, 2))])
    seen = (true + rng.normal(0, 4, true.shape))[rng.permutation(count)]
    overlap = np.array([[iou(s, t) for t in true] for s in seen])
    rows, columns = linear_sum_assignment(-overlap)
    expected = {
        (int(r), f"t{c:02d}") for r, c in zip(rows, columns, strict=True) if overlap[r, c] >= 0.5
    }
    found = match(
        store,
        tmp_path,
        {"track_id": list(range(count)), **boxes([tuple(b) for b in seen])},
        {"object_id": [f"t{i:02d}" for i in range(count)], **boxes([tuple(b) for b in true])},
    )
    assert {(r["observation_index"], r["object_id"]) for r in found} == expected
    for r in found:
        expected_overlap = overlap[r["observation_index"], int(r["object_id"][1:])]
        # Sides of observed boxes are kept to a thousandth of a pixel (pipeline.store.precision).
        np.testing.assert_allclose(r["overlap"], expected_overlap, atol=1e-4)
    summary = store.query("FROM accuracy.matching").to_pylist()[0]
    assert summary["truth_count"] == summary["observation_count"] == count
    assert summary["by_overlap_count"] == len(expected)
    assert summary["found_share"] == summary["true_share"] == len(expected) / count
