"""The distributions in SQL against scipy's."""

from __future__ import annotations

from collections.abc import Iterator
from importlib.resources import files

import duckdb
import numpy as np
import pytest
from scipy import special, stats

from pipeline.optics.ground_plane import foot_depth_m, ground_position_m, remove_roll


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


PLACE = """SELECT {{'recording_id': 'r', 'camera': 'c', 'x_m': {x}, 'y_m': {y}, 'depth_m': {z},
    'depth_std_m': {s}, 'camera_height_m': {h}, 'tilt_rad': {t}, 'pose_loadings': {f}}}"""


def places_m(points: np.ndarray, pose: np.ndarray) -> np.ndarray:
    """Return where on the ground picture points, (n, 2), are seen to stand; log height, tilt, roll."""
    foot = remove_roll(points, pose[2])
    depth_m = foot_depth_m(np.exp(pose[0]), pose[1], foot[:, 1])
    return np.stack(ground_position_m(depth_m, foot[:, 0], foot[:, 1], pose[1]), axis=1)


def test_a_distance_on_the_ground_is_as_sure_as_poses_that_are_drawn(sql) -> None:
    """The pose drawn from its covariance, and each place along its line of sight."""
    random = np.random.default_rng(2)
    pose = np.array([np.log(5.0), 0.3, 0.0])
    factor = np.diag([0.02, 0.004, 0.006]) @ random.normal(size=(3, 6)) / 2
    points = np.array([[-0.1, 0.12], [0.15, 0.05]])
    own = np.array([0.01, 0.02])
    at = places_m(points, pose)
    apart = []
    for _ in range(6000):
        moved = places_m(points, pose + factor @ random.normal(size=6))
        moved = moved * np.exp(own * random.normal(size=2))[:, None]
        apart.append(np.linalg.norm(moved[0] - moved[1]))
    depth_m = foot_depth_m(5.0, 0.3, points[:, 1])
    of_pose = [
        np.linalg.norm(
            factor[0] - at[i, 1] / 5.0 * factor[1] - at[i, 0] * np.cos(0.3) / 5.0 * factor[2]
        )
        for i in range(2)
    ]
    rows = [
        PLACE.format(
            x=at[i, 0],
            y=at[i, 1],
            z=depth_m[i],
            s=depth_m[i] * np.hypot(own[i], of_pose[i]),
            h=5.0,
            t=0.3,
            f=factor.ravel().tolist(),
        )
        for i in range(2)
    ]
    found = sql.execute(
        f"SELECT ground_distance(a, b) FROM ({rows[0]} AS a), ({rows[1]} AS b)"
    ).fetchone()[0]
    assert found["value_m"] == pytest.approx(np.linalg.norm(at[0] - at[1]))
    assert found["std_m"] == pytest.approx(np.std(apart), rel=0.05)


def heights(sql, one: str, other: str) -> tuple[dict, float]:
    row = sql.execute(
        f"SELECT height_difference(a, b), taller(a, b) FROM (SELECT {one} AS a), (SELECT {other} AS b)"
    ).fetchone()
    return row[0], row[1]


def height(tall_m: float, loadings: list[float] | None, own_m: float, recording: str = "r") -> str:
    given = "NULL" if loadings is None else f"{loadings}"
    total = np.hypot(own_m, np.linalg.norm(loadings or [0.06]))
    return (
        f"{{'recording_id': '{recording}', 'camera': 'c', 'height_m': {tall_m}::DOUBLE, "
        f"'height_std_m': {total}::DOUBLE, 'own_std_m': {own_m}::DOUBLE, "
        f"'common_loadings_m': ({given})::FLOAT[6]}}"
    )


def test_what_two_heights_share_cancels_in_their_difference(sql) -> None:
    share = [0.06, 0.01, 0.0, 0.0, 0.0, 0.0]
    other = [0.058, 0.01, 0.005, 0.0, 0.0, 0.0]
    found, likely = heights(sql, height(1.80, share, 0.01), height(1.75, other, 0.02))
    std_m = np.sqrt(0.002**2 + 0.005**2 + 0.01**2 + 0.02**2)
    assert found["value_m"] == pytest.approx(0.05)
    assert found["std_m"] == pytest.approx(std_m, rel=1e-5)
    assert found["low_m"] == pytest.approx(0.05 - 1.96 * std_m, rel=1e-3)
    assert likely == pytest.approx(stats.norm.cdf(0.05 / std_m), abs=1e-6)


@pytest.mark.parametrize(("loadings", "recording"), [(None, "r"), ([0.06, 0, 0, 0, 0, 0], "s")])
def test_heights_of_two_cameras_share_nothing(sql, loadings, recording) -> None:
    one = height(1.80, [0.06, 0, 0, 0, 0, 0], 0.01)
    found, _ = heights(sql, one, height(1.75, loadings, 0.01, recording))
    assert found["std_m"] == pytest.approx(np.sqrt(2) * np.hypot(0.06, 0.01), rel=1e-5)
