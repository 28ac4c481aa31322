from __future__ import annotations

from pathlib import Path

import numpy as np

from pipeline.core.tables import PASS_ONE, PASS_TWO
from pipeline.store.database import Store
from pipeline.store.precision import DECIMALS, kept
from tests.store.rows import estimate, ingest, recording, start


def test_every_column_that_is_cut_exists() -> None:
    schemas = PASS_ONE | PASS_TWO
    for table, columns in DECIMALS.items():
        assert set(columns) <= set(schemas[table].names), table


def test_other_columns_are_kept_whole() -> None:
    assert kept("frames", "luminance", "luminance") == "luminance"
    assert kept("estimates", "depth_m", "depth_m") == "round(depth_m, 4)"


def test_no_value_moves_by_more_than_half_its_last_digit(store: Store, tmp_path: Path) -> None:
    rng = np.random.default_rng(5)
    true = {"depth_m": rng.uniform(0.3, 90, 500), "depth_std_m": rng.uniform(1e-4, 3, 500)}
    sides_px = rng.uniform(-5, 7680, 500)
    run_id = start(store)
    key = ingest(
        store,
        run_id,
        tmp_path / "p",
        recording(),
        observations={"x_min_px": sides_px.tolist()},
        cameras={},
    )
    estimate(store, key, run_id, {name: values.tolist() for name, values in true.items()})
    found = store.read("estimates", key)
    for name, decimals in (("depth_m", 4), ("depth_std_m", 5)):
        off = np.abs(found[name].to_numpy() - true[name])
        assert 0 < off.max() <= 0.5 * 10**-decimals * (1 + 1e-9)
    off_px = np.abs(store.read("observations", key)["x_min_px"].to_numpy() - sides_px)
    assert 0 < off_px.max() <= 0.5e-3 * (1 + 1e-6)
