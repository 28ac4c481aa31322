"""Every metric against numpy, scipy or statsmodels on random data with gaps."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import statsmodels.api as sm
from scipy import stats

from pipeline.store.database import Store
from tests.sql.population import populate
from tests.store.rows import estimate, ingest, recording, start

Z50, Z80, Z95 = stats.norm.ppf([0.75, 0.9, 0.975])


@pytest.fixture(scope="module")
def filled(template: Path, tmp_path_factory: pytest.TempPathFactory):
    """A store with a random population, and the population itself."""
    folder = tmp_path_factory.mktemp("population")
    path = folder / "a.duckdb"
    path.write_bytes(template.read_bytes())
    with Store.open(path) as store:
        yield store, populate(store, folder)


def clustered(values: pd.Series, tracks: pd.Series) -> tuple[float, float, float, int]:
    """Mean, its cluster-robust standard error and Student's t by statsmodels, and the clusters."""
    codes = pd.factorize(tracks)[0]
    count = codes.max() + 1
    mean = values.mean()
    if count < 2:
        return mean, np.nan, np.nan, count
    fit = sm.OLS(values.to_numpy(), np.ones(len(values))).fit(
        cov_type="cluster", cov_kwds={"groups": codes}, use_t=True
    )
    return mean, fit.bse[0], stats.t.ppf(0.975, count - 1), count


def expected_metrics(group: pd.DataFrame) -> dict[str, float]:
    """Return the metrics of one group, written down independently of the SQL."""
    track = group["recording_id"] + group["camera"] + group["track_id"].astype(str)
    depth = group.dropna(subset=["depth_m", "true_depth_m"])
    error = depth["depth_m"] - depth["true_depth_m"]
    ratio = np.log(depth["depth_m"] / depth["true_depth_m"])
    height = group[~group["height_assumed"]].dropna(subset=["height_m", "true_height_m"])
    height_error = height["height_m"] - height["true_height_m"]
    z = (error / depth["depth_std_m"]).dropna()
    std = depth.loc[z.index, "depth_std_m"]
    height_z = (height_error / height["height_std_m"]).dropna()
    used = (depth.index).union(height.index)
    out: dict[str, float] = {
        "depth_count": len(depth),
        "depth_median_error_m": np.median(error),
        "depth_median_abs_m": np.median(abs(error)),
        "depth_p95_m": np.percentile(abs(error), 95),
        "depth_abs_rel": np.mean(abs(error) / depth["true_depth_m"]),
        "depth_sq_rel_m": np.mean(error**2 / depth["true_depth_m"]),
        "depth_rmse_log": np.sqrt(np.mean(ratio**2)),
        "depth_silog": 100 * np.sqrt(np.mean(ratio**2) - np.mean(ratio) ** 2),
        "depth_loa_low_m": error.mean() - Z95 * error.std(),
        "depth_loa_high_m": error.mean() + Z95 * error.std(),
        "depth_coverage_50": np.mean(abs(z) <= Z50),
        "depth_coverage_80": np.mean(abs(z) <= Z80),
        "depth_coverage_95": np.mean(abs(z) <= Z95),
        "depth_interval_width_m": np.mean(2 * Z95 * std),
        "depth_nll": -np.mean(stats.norm.logpdf(error[z.index], scale=std)),
        "out_of_range_count": (~group.loc[used, "in_calibrated_range"]).sum(),
        "height_count": len(height),
        "height_mape_percent": 100 * np.mean(abs(height_error) / height["true_height_m"]),
        "height_coverage_95": np.mean(abs(height_z) <= Z95),
    }
    for step in (1, 2, 3):
        worse = np.maximum(
            depth["depth_m"] / depth["true_depth_m"], depth["true_depth_m"] / depth["depth_m"]
        )
        out[f"depth_delta_{step}"] = np.mean(worse < 1.25**step)
    if len(depth) > 1:
        out["depth_r"] = stats.pearsonr(depth["depth_m"], depth["true_depth_m"]).statistic
        spread = ((depth["true_depth_m"] - depth["true_depth_m"].mean()) ** 2).sum()
        out["depth_r2"] = 1 - (error**2).sum() / spread
    for name, values, tracks in (
        ("depth", error, track[depth.index]),
        ("height", height_error, track[height.index]),
    ):
        mean, se, t, count = clustered(values, tracks)
        out[f"{name}_bias_m"] = mean
        out[f"{name}_bias_low_m"], out[f"{name}_bias_high_m"] = mean - t * se, mean + t * se
        mae, se, t, _ = clustered(abs(values), tracks)
        out[f"{name}_mae_m"] = mae
        out[f"{name}_mae_low_m"] = mae * np.exp(-t * se / mae)
        out[f"{name}_mae_high_m"] = mae * np.exp(t * se / mae)
        mse, se, t, _ = clustered(values**2, tracks)
        out[f"{name}_rmse_m"] = np.sqrt(mse)
        out[f"{name}_rmse_low_m"] = np.sqrt(mse) * np.exp(-t * se / mse / 2)
        out[f"{name}_rmse_high_m"] = np.sqrt(mse) * np.exp(t * se / mse / 2)
        if name == "depth":
            out["track_count"] = count
    return out


def check(store: Store, sql: str, groups: dict[tuple, pd.DataFrame], keys: list[str]) -> None:
    """Compare every row and every metric of a view with the independent figures."""
    found = {tuple(_key(row[k]) for k in keys): row for row in store.query(sql).to_pylist()}
    assert set(found) == set(groups)
    for key, group in groups.items():
        expected = expected_metrics(group)
        row = found[key]
        metrics = [n for n in row if n.startswith(("depth_", "height_", "track_count", "out_of"))]
        assert set(metrics) == set(expected)
        for name in metrics:
            value = np.nan if row[name] is None else row[name]
            np.testing.assert_allclose(
                value, expected[name], rtol=1e-8, atol=1e-12, err_msg=f"{key} {name}"
            )


def _key(value: object) -> object:
    return None if isinstance(value, float) and np.isnan(value) else value


def grouped(rows: pd.DataFrame, keys: list[str]) -> dict[tuple, pd.DataFrame]:
    return {tuple(_key(k) for k in key): group for key, group in rows.groupby(keys, dropna=False)}


@pytest.mark.parametrize(
    ("view", "keys"),
    [
        ("by_method", ["method"]),
        ("by_camera", ["method", "camera"]),
        ("by_class", ["method", "class_name"]),
        ("by_aperture", ["method", "f_number"]),
        ("by_recording", ["method", "recording_id", "file_name"]),
        ("by_run", ["method", "run_id"]),
        ("by_track", ["method", "recording_id", "camera", "track_id"]),
    ],
)
def test_views(filled: tuple[Store, pd.DataFrame], view: str, keys: list[str]) -> None:
    store, rows = filled
    check(store, f"FROM accuracy.{view}", grouped(rows, keys), keys)


@pytest.mark.parametrize("edges", [[0, 5, 10, 20, 40], [7.5, 2]])
def test_range_bins(filled: tuple[Store, pd.DataFrame], edges: list[float]) -> None:
    store, rows = filled
    borders = [*sorted(edges), np.inf]
    position = np.searchsorted(borders, rows["true_depth_m"], side="right") - 1
    # A true depth that is unknown, or nearer than the first edge, is in no bin.
    low = [
        np.nan if np.isnan(d) or p < 0 else float(borders[p])
        for p, d in zip(position, rows["true_depth_m"], strict=True)
    ]
    rows = rows.assign(true_depth_from_m=low)
    rows = rows[rows["depth_m"].notna() & rows["true_depth_m"].notna()]
    keys = ["method", "true_depth_from_m"]
    found = {
        tuple(_key(r[k]) for k in keys): r
        for r in store.query(f"FROM accuracy.by_range_bins({edges})").to_pylist()
        if r["depth_count"]
    }
    expected = grouped(rows, keys)
    assert set(found) == set(expected)
    for key, group in expected.items():
        error = group["depth_m"] - group["true_depth_m"]
        assert found[key]["depth_count"] == len(error)
        np.testing.assert_allclose(found[key]["depth_bias_m"], error.mean())
        np.testing.assert_allclose(found[key]["depth_rmse_m"], np.sqrt((error**2).mean()))
        if key[1] is not None:
            high = borders[borders.index(key[1]) + 1]
            assert found[key]["true_depth_to_m"] == (None if np.isinf(high) else high)


def test_any_dimensions_together(filled: tuple[Store, pd.DataFrame]) -> None:
    store, rows = filled
    keys = ["method", "camera", "class_name"]
    sql = "SELECT * EXCLUDE (file_name) FROM accuracy.metrics(['camera', 'class'])"
    check(store, sql, grouped(rows, keys), keys)


def test_sums_that_are_finer_than_the_groups_add_up(filled: tuple[Store, pd.DataFrame]) -> None:
    store, rows = filled
    fine = "accuracy.sums(['class', 'aperture', 'depth'], edges := [0, 5, 10, 20])"
    for dimensions, keys in (([], ["method"]), (["aperture"], ["method", "f_number"])):
        sql = (
            f"WITH fine AS (FROM {fine}) "
            f"SELECT * EXCLUDE (file_name) FROM accuracy.from_sums('fine', {dimensions})"
        )
        check(store, sql, grouped(rows, keys), keys)


def test_coverage(filled: tuple[Store, pd.DataFrame]) -> None:
    store, rows = filled
    found = {
        (r["method"], r["quantity"], r["nominal"]): r
        for r in store.query("FROM accuracy.coverage").to_pylist()
    }
    assert len(found) == 12
    track = rows["recording_id"] + rows["camera"] + rows["track_id"].astype(str)
    for (method, quantity, nominal), row in found.items():
        use = rows[rows["method"] == method]
        if quantity == "height":
            use = use[~use["height_assumed"]]
        error = use[f"{quantity}_m"] - use[f"true_{quantity}_m"]
        std = use[f"{quantity}_std_m"]
        z = (error / std).dropna()
        half = stats.norm.ppf(0.5 + nominal / 2)
        mean, se, t, count = clustered((abs(z) <= half).astype(float), track[z.index])
        assert (row["estimate_count"], row["track_count"]) == (len(z), count)
        expected = {
            "observed": mean,
            "observed_low": max(mean - t * se, 0),
            "observed_high": min(mean + t * se, 1),
            "mean_width_m": 2 * half * std[z.index].mean(),
            "mean_nll": -stats.norm.logpdf(error[z.index], scale=std[z.index]).mean(),
        }
        for name, value in expected.items():
            np.testing.assert_allclose(row[name], value, err_msg=name)


def test_worst_are_the_worst(filled: tuple[Store, pd.DataFrame]) -> None:
    store, rows = filled
    found = store.query("FROM accuracy.worst").to_pandas()
    relative = abs(rows["depth_m"] - rows["true_depth_m"]) / rows["true_depth_m"]
    for method, group in rows.assign(relative=relative).groupby("method"):
        worst = group.nlargest(20, "relative")
        ours = found[found["method"] == method]
        np.testing.assert_allclose(ours["depth_relative_error"], worst["relative"])
        assert ours["observation_index"].tolist() == worst["observation_index"].tolist()
        assert ours["file_name"].tolist() == worst["file_name"].tolist()


def test_errors_of_single_estimates(filled: tuple[Store, pd.DataFrame]) -> None:
    store, rows = filled
    keys = ["recording_id", "observation_index", "method"]
    found = store.query("FROM accuracy.errors").to_pandas().set_index(keys).sort_index()
    rows = rows.set_index(keys).sort_index()
    assert found.index.equals(rows.index)
    error = rows["depth_m"] - rows["true_depth_m"]
    np.testing.assert_allclose(found["depth_error_m"], error)
    np.testing.assert_allclose(found["depth_z"], error / rows["depth_std_m"])
    height = (rows["height_m"] - rows["true_height_m"]).where(~rows["height_assumed"])
    np.testing.assert_allclose(found["height_error_m"], height)
    assert (found["f_number"].isna() == rows["f_number"].isna()).all()


def single(store: Store, folder: Path, depths: list[float], truths: list[float]) -> dict:
    """Return accuracy.by_method for one track."""
    run_id, n = start(store), len(depths)
    key = ingest(
        store,
        run_id,
        folder,
        recording(),
        observations={"frame_index": list(range(n)), "object_id": ["a"] * n},
        ground_truth={"frame_index": list(range(n)), "object_id": ["a"] * n, "depth_m": truths},
    )
    estimate(store, key, run_id, {"depth_m": depths})
    return store.query("FROM accuracy.by_method").to_pylist()[0]


def test_one_estimate_has_no_spread(store: Store, tmp_path: Path) -> None:
    row = single(store, tmp_path, [11.0], [10.0])
    assert row["depth_bias_m"] == row["depth_rmse_m"] == 1.0
    unknown = [
        "depth_bias_low_m",
        "depth_rmse_high_m",
        "depth_loa_low_m",
        "depth_r",
        "depth_r2",
        "depth_coverage_95",
        "depth_nll",
        "height_bias_m",
        "height_rmse_m",
    ]
    assert {name: row[name] for name in unknown} == dict.fromkeys(unknown)


def test_one_true_depth_explains_nothing(store: Store, tmp_path: Path) -> None:
    truths = [0.1] * 7  # its mean is not exactly 0.1
    row = single(store, tmp_path, [0.1, 0.2, 0.3, 0.1, 0.2, 0.3, 0.7], truths)
    assert (row["depth_r"], row["depth_r2"]) == (None, None)


def test_perfect_and_absurd_estimates(store: Store, tmp_path: Path) -> None:
    perfect = single(store, tmp_path, [1.0, 2.0], [1.0, 2.0])
    assert (perfect["depth_rmse_m"], perfect["depth_r2"], perfect["depth_delta_1"]) == (0, 1, 1)
    absurd = single(store, tmp_path, [-1.0, 2.0], [0.0, 2.0])
    assert absurd["depth_abs_rel"] == 0.0  # a true depth of zero has no relative error
    assert absurd["depth_rmse_log"] == 0.0  # nor a logarithm
    assert all(v is None or np.isfinite(v) for v in absurd.values() if isinstance(v, float))


def test_heights_by_frame_and_by_track(store: Store, tmp_path: Path) -> None:
    run_id = start(store)
    key = ingest(
        store,
        run_id,
        tmp_path,
        recording(),
        observations={
            "frame_index": [0, 1, 2, 0, 1],
            "track_id": [0, 0, 0, 1, 1],
            "object_id": ["a", "a", "b", "b", "b"],  # track 0 jumps to b at its end
        },
        ground_truth={
            "frame_index": [0, 1, 2, 0, 1],
            "object_id": ["a", "a", "b", "b", "b"],
            "height_m": [1.8, 1.8, 1.6, 1.6, 1.6],
        },
    )
    frames = [1.9, 1.8, 1.7, 1.5, 1.4]
    estimate(
        store,
        key,
        run_id,
        {"height_m": frames},
        {
            "track_id": [0, 1, 1],
            "method": ["size", "size", "ground"],
            "height_m": [1.85, 1.5, 1.6],
            "height_std_m": [0.1, 0.02, 0.1],
            "height_assumed": [False, False, True],
        },
    )
    found = {
        (r["method"], r["unit"]): r
        for r in store.query("FROM accuracy.height_by_method").to_pylist()
    }
    assert set(found) == {("size", "frame"), ("size", "track")}  # assumed heights do not count
    frame_error = np.array(frames) - [1.8, 1.8, 1.6, 1.6, 1.6]
    np.testing.assert_allclose(
        found["size", "frame"]["height_rmse_m"], np.sqrt(np.mean(frame_error**2))
    )
    row, error = found["size", "track"], np.array([0.05, -0.1])
    np.testing.assert_allclose(row["height_bias_m"], error.mean())
    np.testing.assert_allclose(row["height_mae_m"], abs(error).mean())
    np.testing.assert_allclose(row["height_rmse_m"], np.sqrt(np.mean(error**2)))
    np.testing.assert_allclose(row["height_mape_percent"], 100 * np.mean([0.05 / 1.8, 0.1 / 1.6]))
    np.testing.assert_allclose(row["height_coverage_95"], 0.5)
    interval = stats.t.interval(0.95, 1, error.mean(), stats.sem(error))
    np.testing.assert_allclose((row["height_bias_low_m"], row["height_bias_high_m"]), interval)
