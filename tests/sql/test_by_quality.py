"""accuracy.by_quality against sums made by hand."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pipeline.core.tables import CALIBRATIONS, ESTIMATES, OBSERVATION_QUALITY, TRACK_HEIGHTS
from pipeline.store.database import Store
from tests.store.rows import ingest, recording, start, table, write_estimates

GOOD = [True] * 5


def test_flags_are_told_apart_and_the_first_one_counts(store: Store, tmp_path: Path) -> None:
    run_id = start(store)
    ids = [f"o{i}" for i in range(5)]
    key = ingest(
        store,
        run_id,
        tmp_path,
        recording(),
        observations={"object_id": ids, "track_id": list(range(5))},
        ground_truth={"object_id": ids, "depth_m": [10.0] * 5, "height_m": [1.7] * 5},
    )
    error_m = np.array([0.1, -0.3, 2.0, -4.0, 1.0])
    estimates = {
        "depth_m": (10 + error_m).tolist(),
        "depth_std_m": [0.1, 0.1, 1.5, 1.5, 0.1],
        "method": ["fused"] * 5,
    }
    quality = {
        "observation_index": list(range(5)),
        "quality": [1.0, 0.9, 0.1, 0.2, 0.5],
        "contact_visible": [True, True, False, False, True],
        "head_visible": GOOD,
        "alone": [True, True, False, True, True],
        "aspect_plausible": [True, True, True, True, False],
    }
    with store.transaction():
        write_estimates(
            store,
            key,
            run_id,
            table(ESTIMATES, estimates),
            table(TRACK_HEIGHTS, {}),
            table(CALIBRATIONS, {}),
            table(OBSERVATION_QUALITY, quality),
        )
    rows = {r["flag"]: r for r in store.query("FROM accuracy.by_quality").to_pylist()}
    assert {f: r["estimate_count"] for f, r in rows.items()} == {
        "nothing wrong": 2,
        "feet hidden": 2,
        "odd shape": 1,
    }
    hidden = rows["feet hidden"]
    assert hidden["depth_rmse_m"] == pytest.approx(np.sqrt((4 + 16) / 2))
    assert hidden["depth_median_abs_m"] == pytest.approx(3.0)
    assert hidden["depth_coverage_95"] == pytest.approx(0.5)
    assert hidden["mean_quality"] == pytest.approx(0.15)
    assert rows["nothing wrong"]["depth_coverage_95"] == pytest.approx(0.5)
    assert rows["odd shape"]["height_rmse_m"] is None


def test_estimating_again_replaces_the_runs_own_judgement_only(
    store: Store, tmp_path: Path
) -> None:
    first = start(store)
    key = ingest(store, first, tmp_path, recording(), observations={"object_id": ["a"]})
    second = start(store)
    empty = (table(ESTIMATES, {}), table(TRACK_HEIGHTS, {}), table(CALIBRATIONS, {}))
    for run_id, quality in ((first, 0.4), (second, 0.6), (second, 0.7)):
        judged = table(OBSERVATION_QUALITY, {"observation_index": [0], "quality": [quality]})
        with store.transaction():
            write_estimates(store, key, run_id, *empty, judged)
    rows = store.query("SELECT run_id, quality FROM observation_quality").to_pylist()
    assert {(r["run_id"], r["quality"]) for r in rows} == {(first, 0.4), (second, 0.7)}
