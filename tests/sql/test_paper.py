"""The paper's tables from the paper's rows, put into a store as measurements with truth."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import statsmodels.api as sm
from scipy import stats

from pipeline.optics.aperture_size import TABLE_8, depth_eq16_m
from pipeline.store.database import Store
from tests.store.rows import estimate, ingest, recording, start

PAPER = Path(__file__).parents[2] / "recordings" / "paper"
FOCAL_MM, PITCH_UM, SCALE = 50.0, 3.9, 0.2  # pictures stored at a fifth of their size


def rows_3_to_7() -> pd.DataFrame:
    table = pd.read_csv(PAPER / "depth_tables_3_to_7.csv")
    return table.assign(
        f_number=table["f_number"].astype(float),
        object_id=[f"t{t}r{r}" for t, r in zip(table["paper_table"], table["row"], strict=True)],
        true_depth_m=table["actual_depth_cm"] / 100,
        size_mm=table["object_width_px"] * PITCH_UM / 1000,
    )


def rows_9_10() -> pd.DataFrame:
    table = pd.read_csv(PAPER / "height_tables_9_10.csv")
    return table.assign(
        f_number=table["f_number"].astype(float),
        object_id=[f"h{r}" for r in table["row"]],
        depth_m=table["estimated_depth_cm"] / 100,
        true_height_m=table["actual_height_cm"] / 100,
        size_mm=table["image_height_px"] * PITCH_UM / 1000,
    )


def put(
    store: Store, folder: Path, table: pd.DataFrame, side: str, truth: dict, estimates: dict
) -> None:
    """Store rows as one frame each, the object's box as wide or high as the row says."""
    n, run_id = len(table), start(store)
    size_px = table["size_mm"] * 1000 / PITCH_UM * SCALE
    width = size_px if side == "width" else pd.Series(np.full(n, 50.0))
    height = size_px if side == "height" else pd.Series(np.full(n, 500.0))
    frames = {"camera": ["nikon"] * n, "frame_index": list(range(n))}
    ids = {"object_id": table["object_id"].tolist(), "class_name": ["staff"] * n}
    key = ingest(
        store,
        run_id,
        folder,
        recording(),
        frames={
            **frames,
            "f_number": table["f_number"].tolist(),
            "focal_length_mm": [FOCAL_MM] * n,
            "pixel_pitch_x_um": [PITCH_UM / SCALE] * n,
            "pixel_pitch_y_um": [PITCH_UM / SCALE] * n,
        },
        observations={
            **frames,
            **ids,
            "track_id": list(range(n)),
            "x_min_px": [100.0] * n,
            "x_max_px": (100.0 + width).tolist(),
            "y_min_px": [100.0] * n,
            "y_max_px": (100.0 + height).tolist(),
        },
        ground_truth={**frames, **ids, **truth},
    )
    estimate(store, key, run_id, estimates)


@pytest.fixture(scope="module")
def depths(template: Path, tmp_path_factory) -> Iterator[tuple[Store, pd.DataFrame]]:
    """Tables 3-7, estimated by Eq. 16 with the k that the printed figures imply."""
    folder = tmp_path_factory.mktemp("depths")
    (folder / "a.duckdb").write_bytes(template.read_bytes())
    table = rows_3_to_7()
    depth = depth_eq16_m(table["size_mm"], FOCAL_MM, table["f_number"], table["k_implied"])
    depth = depth.round(4)  # as they are kept
    table = table.assign(depth_m=depth)
    with Store.open(folder / "a.duckdb") as store:
        put(
            store,
            folder,
            table,
            "width",
            {"depth_m": table["true_depth_m"].tolist()},
            {"depth_m": depth.tolist(), "method": ["aperture"] * len(table)},
        )
        yield store, table


def test_tables_3_to_7(depths: tuple[Store, pd.DataFrame]) -> None:
    store, table = depths
    found = store.query("FROM paper.depth_by_aperture").to_pandas().set_index("object_id")
    assert len(found) == 35
    found = found.loc[table["object_id"]].reset_index()
    # Depths of half a metre are kept to 0.1 mm, sides of the boxes to a thousandth of a pixel.
    np.testing.assert_allclose(found["k"], table["k_implied"], rtol=2e-4)
    np.testing.assert_allclose(found["true_depth_m"], table["true_depth_m"])
    np.testing.assert_allclose(found["object_size_mm"], table["size_mm"])
    np.testing.assert_allclose(found["object_size_px"], table["object_width_px"] * SCALE)
    np.testing.assert_allclose(found["aperture_radius_mm"], 25 / table["f_number"])
    assert (found["observation_count"] == 1).all()
    consistent = table["erratum"].isna()
    printed_cm = table.loc[consistent, "estimated_depth_cm"]
    assert abs(100 * found.loc[consistent, "depth_m"] - printed_cm).max() < 0.02


def test_table_8(depths: tuple[Store, pd.DataFrame]) -> None:
    store, table = depths
    found = store.query("FROM paper.k_by_aperture").to_pandas().set_index("f_number")
    a_mm = FOCAL_MM / 2 / table["f_number"]
    k = table["true_depth_m"] * 1000 * table["size_mm"] / (10 * a_mm * FOCAL_MM)
    for f_number, group in k.groupby(table["f_number"]):
        row = found.loc[f_number]
        np.testing.assert_allclose(row["k_mean"], group.mean())
        np.testing.assert_allclose(row["k_std"], group.std())
        np.testing.assert_allclose(row["k_std_error"], stats.sem(group))
        np.testing.assert_allclose(
            row["equivalent_object_size_mm"], group.mean() * 10 * FOCAL_MM / 2 / f_number
        )
        printed = dict(TABLE_8)[f_number]
        assert row["k_printed"] == printed
        np.testing.assert_allclose(
            row["k_difference_percent"], 100 * (group.mean() / printed - 1), atol=1e-9
        )
    assert found["observation_count"].tolist() == [7] * 5


def test_the_printed_table_8_is_the_optics_one(store: Store) -> None:
    rows = store.query("FROM paper.table_8").to_pylist()
    assert [(float(r["f_number"]), float(r["k_printed"])) for r in rows] == list(TABLE_8)
    printed = pd.read_csv(PAPER / "k_table_8.csv")
    assert list(printed.itertuples(index=False, name=None)) == list(TABLE_8)


def test_tables_11_to_13_are_ordinary_least_squares(depths: tuple[Store, pd.DataFrame]) -> None:
    store, table = depths
    x = 1 / table["size_mm"].to_numpy()
    fit = sm.OLS(table["true_depth_m"].to_numpy(), sm.add_constant(x)).fit()
    summary = store.query("FROM paper.inverse_model_summary").to_pylist()[0]
    expected = {
        "observation_count": 35,
        "r": np.sqrt(fit.rsquared),
        "r2": fit.rsquared,
        "adjusted_r2": fit.rsquared_adj,
        "std_error_m": np.sqrt(fit.mse_resid),
    }
    for name, value in expected.items():
        np.testing.assert_allclose(summary[name], value, rtol=1e-9, err_msg=name)
    anova = {r["source"]: r for r in store.query("FROM paper.inverse_model_anova").to_pylist()}
    for source, squares, df in (
        ("Regression", fit.ess, fit.df_model),
        ("Residual", fit.ssr, fit.df_resid),
        ("Total", fit.centered_tss, fit.nobs - 1),
    ):
        np.testing.assert_allclose(anova[source]["sum_of_squares_m2"], squares, rtol=1e-9)
        assert anova[source]["df"] == df
    np.testing.assert_allclose(anova["Residual"]["mean_square_m2"], fit.mse_resid)
    np.testing.assert_allclose(anova["Regression"]["mean_square_m2"], fit.mse_model)
    np.testing.assert_allclose(anova["Regression"]["f"], fit.fvalue)
    np.testing.assert_allclose(anova["Regression"]["sig"], fit.f_pvalue, rtol=1e-6)
    assert anova["Residual"]["f"] is None
    rows = store.query("FROM paper.inverse_model_coefficients").to_pylist()
    terms = {r["term"]: r for r in rows}
    for index, term in ((0, "(constant)"), (1, "1 / object size")):
        row, interval = terms[term], fit.conf_int()[index]
        np.testing.assert_allclose(row["b"], fit.params[index], rtol=1e-8)
        np.testing.assert_allclose(row["std_error"], fit.bse[index])
        np.testing.assert_allclose(row["t"], fit.tvalues[index], rtol=1e-8)
        np.testing.assert_allclose(row["sig"], fit.pvalues[index], rtol=1e-6)
        np.testing.assert_allclose([row["b_low"], row["b_high"]], interval, rtol=1e-8)
    np.testing.assert_allclose(
        terms["1 / object size"]["beta"], np.corrcoef(x, table["true_depth_m"])[0, 1]
    )


def test_table_14(depths: tuple[Store, pd.DataFrame]) -> None:
    store, table = depths
    rows = store.query("FROM paper.correlations").to_pandas()
    ours = rows[rows["source"] == "this database"].iloc[0]
    pairs = {
        "actual_estimated_r": (table["true_depth_m"], table["depth_m"]),
        "size_estimated_r": (table["size_mm"], table["depth_m"]),
    }
    for name, (x, y) in pairs.items():
        found = stats.pearsonr(x, y)
        low, high = found.confidence_interval(0.95)
        np.testing.assert_allclose(ours[name], found.statistic)
        np.testing.assert_allclose(ours[f"{name}_low"], low)
        np.testing.assert_allclose(ours[f"{name}_high"], high)
    assert (ours["observation_count"], ours["depth_min_m"], ours["depth_max_m"]) == (35, 0.5, 1.1)
    printed = rows[rows["source"] != "this database"].set_index("camera")
    assert printed["actual_estimated_r"].to_dict() == {"Nikon D5300": 0.99213, "Canon": 0.971356}


def test_table_15(depths: tuple[Store, pd.DataFrame]) -> None:
    store, table = depths
    rows = store.query("FROM paper.comparison").to_pandas().set_index("work")
    ours = rows.loc["this database"]
    error = table["depth_m"] - table["true_depth_m"]
    np.testing.assert_allclose(ours["depth_rmse_m"], np.sqrt(np.mean(error**2)))
    assert len(rows) == 7
    # The re-computed reference row: what the paper printed, its contradictory row left out.
    kept = ~table["erratum"].fillna("").str.startswith("object_width_px")
    printed_cm = table.loc[kept, "estimated_depth_cm"] - table.loc[kept, "actual_depth_cm"]
    reference = rows.loc["the paper, Tables 3-7 re-computed"]
    assert kept.sum() == 34
    assert round(np.sqrt(np.mean(printed_cm**2)) / 100, 4) == reference["depth_rmse_m"]
    r = np.corrcoef(table.loc[kept, "estimated_depth_cm"], table.loc[kept, "actual_depth_cm"])
    assert round(r[0, 1], 4) == reference["depth_r"]


def test_tables_9_and_10(store: Store, tmp_path: Path) -> None:
    table = rows_9_10()
    put(
        store,
        tmp_path,
        table,
        "height",
        {"height_m": table["true_height_m"].tolist()},
        {
            "depth_m": table["depth_m"].tolist(),
            "height_m": [0.2] * len(table),
            "method": ["aperture"] * len(table),
        },
    )
    found = store.query("FROM paper.real_height").to_pandas().set_index("object_id")
    assert len(found) == 22
    found = found.loc[table["object_id"]].reset_index()
    np.testing.assert_allclose(found["object_height_mm"], table["size_mm"])
    np.testing.assert_allclose(found["height_eq14_m"], table["size_mm"] / 50 * table["depth_m"])
    magnification = 50 / (table["depth_m"] * 1000 - 50)
    np.testing.assert_allclose(found["height_exact_m"], table["size_mm"] / magnification / 1000)
    np.testing.assert_allclose(
        found["height_eq14_error_m"], found["height_eq14_m"] - table["true_height_m"]
    )
    assert (found["height_m"] == 0.2).all()
    consistent = table["erratum"].isna()
    assert consistent.sum() == 17
    printed_cm = table.loc[consistent, "estimated_height_cm"]
    assert abs(100 * found.loc[consistent, "height_eq14_m"] - printed_cm).max() < 0.25
    rmse_cm = {
        name: 100 * np.sqrt(np.mean(found.loc[consistent, f"height_{name}_error_m"] ** 2))
        for name in ("eq14", "exact")
    }
    assert rmse_cm["exact"] < 1.0 < 2.3 < rmse_cm["eq14"]


def test_sides_that_the_picture_cuts_are_unknown(store: Store, tmp_path: Path) -> None:
    ingest(
        store,
        start(store),
        tmp_path,
        recording(),
        frames={"pixel_pitch_x_um": [10.0], "pixel_pitch_y_um": [10.0]},
        observations={"object_id": ["a"], "truncated_right": [True]},
        ground_truth={"object_id": ["a"], "depth_m": [5.0]},
    )
    row = store.query("FROM paper.measurements").to_pylist()[0]
    assert (row["object_width_mm"], row["object_height_mm"]) == (None, 0.6)


def test_two_points_are_no_regression(store: Store, tmp_path: Path) -> None:
    table = rows_3_to_7().head(2)
    put(store, tmp_path, table, "width", {"depth_m": table["true_depth_m"].tolist()}, {})
    assert store.query("FROM paper.inverse_model").num_rows == 0
    assert store.query("FROM paper.inverse_model_anova").num_rows == 0
