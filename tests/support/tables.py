"""All rows of a database or a folder of finished recordings, for comparison with another."""

from __future__ import annotations

import pandas as pd

from pipeline.store.database import Store


def everything(store: Store) -> dict[str, pd.DataFrame]:
    """Rows of all tables and views, without what is different in every run."""
    different = "run_id|measured_by|baseline_run_id|started_at|finished_at|path|review_command"
    names = [v.name for v in store.views() if "(" not in v.name]
    found = {}
    for name in names:
        columns = next(v.columns for v in store.views() if v.name == name)
        if set(columns) <= set(different.split("|")):
            continue
        found[name] = store.query(
            f"SELECT COLUMNS(lambda c: NOT regexp_full_match(c, '{different}')) FROM {name} ORDER BY ALL"
        ).to_pandas()
    return found


def assert_same(found: dict[str, pd.DataFrame], expected: dict[str, pd.DataFrame]) -> None:
    """Sums may be taken in another order."""
    assert set(found) == set(expected)
    for name, rows in expected.items():
        pd.testing.assert_frame_equal(found[name], rows, rtol=1e-12, atol=1e-12, obj=name)
