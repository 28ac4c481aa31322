"""The distributions in SQL against scipy's."""

from __future__ import annotations

from collections.abc import Iterator
from importlib.resources import files

import duckdb
import numpy as np
import pytest
from scipy import special, stats


@pytest.fixture(scope="module")
def sql() -> Iterator[duckdb.DuckDBPyConnection]:
    connection = duckdb.connect()
    connection.execute((files("schemas") / "sql" / "functions.sql").read_text())
    yield connection
    connection.close()


def column(sql: duckdb.DuckDBPyConnection, expression: str, *values: np.ndarray) -> np.ndarray:
    """Evaluate an expression in x, y, z over arrays that are broadcast."""
    arrays = np.broadcast_arrays(*np.meshgrid(*values, indexing="ij"))
    names = "xyz"[: len(values)]
    sql.register("points", {n: a.ravel().astype(float) for n, a in zip(names, arrays, strict=True)})
    found = sql.execute(f"SELECT {expression} AS v FROM points").fetchnumpy()["v"]
    return np.ma.filled(found, np.nan).reshape(arrays[0].shape)


def test_erf_and_the_normal_distribution(sql) -> None:
    x = np.concatenate([np.linspace(-7, 7, 701), [0.0, 2.5, -2.5, 25.0, -25.0]])
    np.testing.assert_allclose(column(sql, "stats.erf(x)", x), special.erf(x), atol=2e-15)
    np.testing.assert_allclose(column(sql, "stats.normal_cdf(x)", x), stats.norm.cdf(x), atol=2e-15)


def test_incomplete_beta(sql) -> None:
    x, a, b = np.linspace(0, 1, 41), np.array([0.5, 1, 3, 40, 500]), np.array([0.5, 1, 7, 300])
    found = column(sql, "stats.beta_regularised(x, 1 - x, y, z)", x, a, b)
    expected = special.betainc(a[None, :, None], b[None, None, :], x[:, None, None])
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-13)


def test_student_significance(sql) -> None:
    t = np.array([0.0, 1e-6, 0.3, 1.0, 1.96, 2.5, 5.0, 12.0, 61.928])
    df = np.array([1, 2, 3, 5, 10, 33, 74, 1000, 100_000])
    expected = 2 * stats.t.sf(t[:, None], df[None, :])
    found = column(sql, "stats.student_p(x, y)", t, df)
    np.testing.assert_allclose(found, expected, rtol=1e-7, atol=1e-300)
    np.testing.assert_allclose(column(sql, "stats.student_p(-x, y)", t, df), found, rtol=1e-12)


def test_f_significance(sql) -> None:
    f, df1, df2 = (
        np.array([0.1, 1.0, 4.0, 50.0, 3835.0]),
        np.array([1, 2, 7]),
        np.array([3, 74, 900]),
    )
    expected = stats.f.sf(f[:, None, None], df1[None, :, None], df2[None, None, :])
    found = column(sql, "stats.f_p(x, y, z)", f, df1, df2)
    np.testing.assert_allclose(found, expected, rtol=1e-7, atol=1e-300)


def test_f_of_one_degree_is_t_squared(sql) -> None:
    t, df = np.linspace(0.1, 9, 30), np.array([3, 20])
    np.testing.assert_allclose(
        column(sql, "stats.f_p(x * x, 1, y)", t, df), column(sql, "stats.student_p(x, y)", t, df)
    )


def test_student_95(sql) -> None:
    df = np.array([1, 2, 3, 4, 5, 9, 30, 100, 200, 201, 1000, 1e6])
    found = column(sql, "stats.student_95(x)", df)
    np.testing.assert_allclose(found, stats.t.ppf(0.975, df), rtol=1e-9)
    assert np.isnan(column(sql, "stats.student_95(x)", np.array([0.0, -1.0]))).all()


def test_normal_half_widths(sql) -> None:
    found = sql.execute(
        "SELECT stats.normal_50(), stats.normal_80(), stats.normal_95()"
    ).fetchall()[0]
    np.testing.assert_allclose(found, stats.norm.ppf([0.75, 0.9, 0.975]), rtol=1e-15)


def test_unknown_and_undetermined_are_null(sql) -> None:
    expressions = (
        "stats.student_p(NULL, 3)",
        "stats.student_p(2, NULL)",
        "stats.student_p(2, 0)",
        "stats.f_p(NULL, 1, 3)",
        "stats.known('nan'::DOUBLE)",
        "stats.known('inf'::DOUBLE)",
        "stats.fisher_low(0.9, 3)",
        "stats.fisher_high(1.0, 30)",
        "stats.student_95(NULL)",
    )
    for expression in expressions:
        assert sql.execute(f"SELECT {expression}").fetchall() == [(None,)], expression


def test_fisher_interval_holds_as_often_as_it_says(sql) -> None:
    rng = np.random.default_rng(5)
    rho, n, rounds = 0.8, 25, 4000
    x = rng.standard_normal((rounds, n))
    y = rho * x + np.sqrt(1 - rho**2) * rng.standard_normal((rounds, n))
    r = np.array([np.corrcoef(a, b)[0, 1] for a, b in zip(x, y, strict=True)])
    low = column(sql, f"stats.fisher_low(x, {n})", r)
    high = column(sql, f"stats.fisher_high(x, {n})", r)
    assert np.mean((low <= rho) & (rho <= high)) == pytest.approx(0.95, abs=0.012)
