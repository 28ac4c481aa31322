"""The run that counts, and the comparison of two runs."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import statsmodels.api as sm
from scipy import stats

from pipeline.store.database import Store
from tests.store.rows import estimate, ingest, recording, start

TRACKS, FRAMES = 12, 20
COUNT = TRACKS * FRAMES
TRUTH = 10.0
TRACK = np.repeat(np.arange(TRACKS), FRAMES)


def fill(store: Store, folder: Path, name: str = "a.mcap") -> tuple[str, str]:
    """Take in a recording of twelve tracks; return its key and the run."""
    run_id = start(store, "before")
    objects = [f"o{t}" for t in TRACK]
    frames = list(range(COUNT))
    key = ingest(
        store,
        run_id,
        folder,
        recording(name),
        observations={"frame_index": frames, "track_id": TRACK.tolist(), "object_id": objects},
        ground_truth={"frame_index": frames, "object_id": objects, "depth_m": [TRUTH] * COUNT},
    )
    return key, run_id


def errors(rng: np.random.Generator, size: float) -> np.ndarray:
    """Errors that a track's frames share in part."""
    error = rng.normal(0, size, TRACKS)[TRACK] + rng.normal(0, size, COUNT)
    return (TRUTH + error).round(4) - TRUTH  # depths are kept to 0.1 mm


def put(store: Store, key: str, run_id: str, error: np.ndarray) -> None:
    depth = [None if np.isnan(e) else TRUTH + e for e in error.tolist()]
    estimate(store, key, run_id, {"depth_m": depth})


def test_the_newest_run_with_estimates_counts(store: Store, tmp_path: Path) -> None:
    key, first = fill(store, tmp_path)
    assert store.query("FROM current_run").num_rows == 0
    put(store, key, first, np.ones(COUNT))
    start(store, "without estimates")
    assert store.query("FROM current_run")["run_id"].to_pylist() == [first]
    second = start(store, "after")
    put(store, key, second, np.full(COUNT, 2.0))
    assert store.query("FROM current_run")["run_id"].to_pylist() == [second]
    assert store.query("FROM accuracy.by_method")["depth_bias_m"].to_pylist() == [2.0]
    by_run = store.query("SELECT run_label, depth_bias_m FROM accuracy.by_run").to_pylist()
    assert {r["run_label"]: r["depth_bias_m"] for r in by_run} == {"before": 1.0, "after": 2.0}
    current = store.query("FROM current_estimates")
    assert set(current["run_id"].to_pylist()) == {second}
    assert current.num_rows == COUNT


def test_paired_comparison_is_a_clustered_t_test(store: Store, tmp_path: Path) -> None:
    rng = np.random.default_rng(8)
    key, first = fill(store, tmp_path)
    second = start(store, "after")
    before, after = errors(rng, 1.0), errors(rng, 0.8)
    before[3] = after[77] = np.nan  # what one run lacks is left out of both
    put(store, key, first, before)
    put(store, key, second, after)
    both = ~np.isnan(before + after)
    change = (abs(after) - abs(before))[both]
    fit = sm.OLS(change, np.ones(both.sum())).fit(
        cov_type="cluster", cov_kwds={"groups": TRACK[both]}, use_t=True
    )
    rows = store.query("FROM accuracy.run_comparison").to_pylist()
    row = rows[0]
    assert len(rows) == 1
    assert (row["baseline_label"], row["run_label"], row["quantity"]) == (
        "before",
        "after",
        "depth",
    )
    assert (row["observation_count"], row["track_count"]) == (both.sum(), TRACKS)
    t = change.mean() / fit.bse[0]
    half = stats.t.ppf(0.975, TRACKS - 1) * fit.bse[0]
    expected = {
        "baseline_mae_m": abs(before[both]).mean(),
        "mae_m": abs(after[both]).mean(),
        "mae_change_m": change.mean(),
        "std_error_m": fit.bse[0],
        "mae_change_low_m": change.mean() - half,
        "mae_change_high_m": change.mean() + half,
        "better_share": (change < 0).mean(),
        "t": t,
        "p": 2 * stats.t.sf(abs(t), TRACKS - 1),
    }
    for name, value in expected.items():
        np.testing.assert_allclose(row[name], value, rtol=1e-8, err_msg=name)
    by_name = store.query("FROM accuracy.compare_runs('before', 'after')").to_pylist()
    by_id = store.query(f"FROM accuracy.compare_runs('{first}', '{second}')").to_pylist()
    for other in (by_name, by_id):
        assert len(other) == 1
        assert other[0]["run_id"] == row["run_id"]
        assert other[0]["p"] == pytest.approx(row["p"], rel=1e-9)
    back = store.query("FROM accuracy.compare_runs('after', 'before')").to_pylist()[0]
    assert back["mae_change_m"] == pytest.approx(-row["mae_change_m"])


@pytest.mark.parametrize(
    ("scale", "verdict"), [(0.3, "better"), (3.0, "worse"), (1.0, "no significant difference")]
)
def test_verdicts(store: Store, tmp_path: Path, scale: float, verdict: str) -> None:
    rng = np.random.default_rng(4)
    key, first = fill(store, tmp_path)
    put(store, key, first, errors(rng, 1.0))
    put(store, key, start(store, "after"), errors(rng, scale))
    row = store.query("FROM accuracy.run_comparison").to_pylist()[0]
    assert row["verdict"] == verdict
    assert (row["p"] < 0.05) == (verdict != "no significant difference")


def test_equal_runs_have_no_verdict(store: Store, tmp_path: Path) -> None:
    key, first = fill(store, tmp_path)
    same = errors(np.random.default_rng(1), 1.0)
    put(store, key, first, same)
    put(store, key, start(store, "after"), same)
    row = store.query("FROM accuracy.run_comparison").to_pylist()[0]
    assert (row["mae_change_m"], row["t"], row["p"], row["verdict"]) == (0.0, None, None, None)


def test_each_run_is_compared_with_the_one_before_it(store: Store, tmp_path: Path) -> None:
    rng = np.random.default_rng(6)
    key, first = fill(store, tmp_path)
    put(store, key, first, errors(rng, 1.0))
    for label in ("second", "third"):
        put(store, key, start(store, label), errors(rng, 1.0))
    rows = store.query("FROM accuracy.run_comparison").to_pylist()
    pairs = {(r["baseline_label"], r["run_label"]) for r in rows}
    assert pairs == {("before", "second"), ("second", "third")}
    against_first = store.query("FROM accuracy.compare_runs(baseline := 'before')").to_pylist()
    assert {r["run_label"] for r in against_first} == {"second", "third"}


def test_a_false_alarm_comes_as_often_as_it_should(store: Store, tmp_path: Path) -> None:
    """Thirty runs of equal quality: about one in twenty pairs is called significant."""
    rng = np.random.default_rng(12)
    key, first = fill(store, tmp_path)
    put(store, key, first, errors(rng, 1.0))
    for label in range(60):
        put(store, key, start(store, f"{label:02d}"), errors(rng, 1.0))
    p = np.array(store.query("FROM accuracy.run_comparison")["p"].to_pylist())
    assert len(p) == 60
    assert (p < 0.05).mean() < 0.15
    assert p.mean() == pytest.approx(0.5, abs=0.12)
