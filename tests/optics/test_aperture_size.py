"""Eq. 16 and Table 8 against the rows that the paper prints."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.optics.aperture_size import (
    K_TABLE_8,
    depth_eq16_m,
    depth_eq16_std_m,
    equivalent_object_size_m,
    implied_k,
    interpolate_k,
)
from pipeline.optics.object_size import depth_from_size_m, size_on_sensor_mm
from tests.support.paper import DEPTH_ROWS, FOCAL_LENGTH_MM, PIXEL_PITCH_UM, row_id, rows

# Table 4 rows 4 and 5 contradict their own columns; two rows of Table 5 used another k.
WRONG = {("4", "4"), ("4", "5")}
OTHER_K = {("5", "3"): 0.761, ("5", "6"): 0.761}


def estimate_cm(row: dict[str, str], k: float) -> float:
    o_mm = size_on_sensor_mm(float(row["object_width_px"]), PIXEL_PITCH_UM)
    return 100 * float(depth_eq16_m(o_mm, FOCAL_LENGTH_MM, float(row["f_number"]), k))


@pytest.mark.parametrize("row", DEPTH_ROWS, ids=row_id)
def test_rows_of_tables_3_to_7(row: dict[str, str]) -> None:
    key = (row["paper_table"], row["row"])
    k = OTHER_K.get(key, float(row["k_implied"]))
    error_cm = estimate_cm(row, k) - float(row["estimated_depth_cm"])
    if key in WRONG:
        assert abs(error_cm) > 3.5  # an implementation that reproduces this row is wrong
    else:
        assert abs(error_cm) < 0.02


@pytest.mark.parametrize(
    "row", [r for r in DEPTH_ROWS if (r["paper_table"], r["row"]) not in WRONG], ids=row_id
)
def test_table_8_agrees_to_1_2_per_cent(row: dict[str, str]) -> None:
    k = float(interpolate_k(float(row["f_number"])))
    assert estimate_cm(row, k) == pytest.approx(float(row["estimated_depth_cm"]), rel=0.0125)


def test_table_8_is_the_papers() -> None:
    printed = {float(r["f_number"]): float(r["k"]) for r in rows("k_table_8")}
    for f_number, k in printed.items():
        assert interpolate_k(f_number) == pytest.approx(k)


def test_k_is_refused_outside_its_table_unless_asked() -> None:
    assert np.isnan(interpolate_k([1.4, 22.0])).all()
    f_numbers, k = K_TABLE_8
    wide = interpolate_k(22.0, f_numbers, k, extrapolate=True)
    # the equivalent object size of the last entry is kept
    assert equivalent_object_size_m(wide, 50.0, 22.0) == pytest.approx(
        float(equivalent_object_size_m(k[-1], 50.0, f_numbers[-1]))
    )
    assert 0.95 < interpolate_k(5.0) < 1.12


sizes, ks, ns = st.floats(0.1, 20.0), st.floats(0.45, 3.2), st.floats(1.8, 16.0)


@given(sizes, ks, ns)
def test_at_infinite_focus_it_is_similar_triangles(o_mm: float, k: float, n: float) -> None:
    w_m = equivalent_object_size_m(k, 50.0, n)
    assert depth_eq16_m(o_mm, 50.0, n, k) == pytest.approx(
        float(depth_from_size_m(w_m, o_mm, 50.0)), rel=1e-12
    )


@given(sizes, ks, ns, st.floats(50.001, 60.0))
def test_general_focus_is_the_printed_formula(o: float, k: float, n: float, v: float) -> None:
    a, f = 10 * 50.0 / (2 * n), 50.0
    denominator = v * a - f * (o + a)
    if abs(denominator) < 1e-3:
        return
    expected_mm = abs(k * f * v * a / denominator)
    assert depth_eq16_m(o, f, n, k, v) * 1e3 == pytest.approx(expected_mm, rel=1e-6)


@given(sizes, ks, ns)
def test_k_comes_back_from_depth(o_mm: float, k: float, n: float) -> None:
    assert implied_k(depth_eq16_m(o_mm, 50.0, n, k), o_mm, 50.0, n) == pytest.approx(k, rel=1e-9)


def test_std_is_that_of_a_simulation() -> None:
    random = np.random.default_rng(1)
    o_mm = random.normal(3.0, 0.03, 200_000)
    k = random.normal(0.66, 0.01, 200_000)
    d_m = depth_eq16_m(o_mm, 50.0, 2.8, k)
    mean_m = depth_eq16_m(3.0, 50.0, 2.8, 0.66)
    assert depth_eq16_std_m(mean_m, 3.0, 0.03, 0.66, 0.01) == pytest.approx(d_m.std(), rel=0.01)


@given(st.floats(1.8, 16.0), st.floats(1.8, 16.0))
def test_k_does_not_fall_with_the_f_number(n1: float, n2: float) -> None:
    assert interpolate_k(min(n1, n2)) <= interpolate_k(max(n1, n2))


def test_k_is_linear_in_the_logarithm_of_the_f_number() -> None:
    assert interpolate_k(np.sqrt(4.5 * 5.6)) == pytest.approx((0.95 + 1.12) / 2)
    # the ranges of the text: 1.8-2, 2.2-2.5, 4-4.5, 8-9
    for low, high in [(1.8, 2.0), (2.2, 2.5), (4.0, 4.5), (8.0, 9.0)]:
        assert np.ptp(interpolate_k(np.linspace(low, high, 7))) < 1e-12


def test_an_f_number_in_single_precision_is_still_in_the_table() -> None:
    assert float(np.float32(1.8)) < 1.8
    assert interpolate_k(np.float32(1.8)) == pytest.approx(0.45)
    np.testing.assert_array_equal(interpolate_k([2.8, 4.0], [2.8], [0.7]), [0.7, np.nan])


@pytest.mark.parametrize("extrapolate", [False, True])
def test_what_is_no_f_number_has_no_k(extrapolate: bool) -> None:
    assert np.isnan(interpolate_k([0.0, -2.0, np.nan], extrapolate=extrapolate)).all()


def test_a_size_that_is_not_positive_has_no_depth() -> None:
    assert np.isnan(depth_eq16_m([0.0, -1.0], 50.0, 2.8, 0.66)).all()
    assert np.isnan(implied_k(1.0, [0.0, -1.0], 50.0, 2.8)).all()
