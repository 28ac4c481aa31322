"""Sizes, heights and Eq. 17 against the paper's rows, closed forms and simulations."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.optics import object_size as size
from tests.support.paper import (
    CONSISTENT_HEIGHTS,
    DEPTH_ROWS,
    FOCAL_LENGTH_MM,
    HEIGHT_ROWS,
    PIXEL_PITCH_UM,
    row_id,
)


def columns(rows: list[dict[str, str]], *names: str) -> list[np.ndarray]:
    return [np.array([float(r[n]) for r in rows]) for n in names]


@pytest.mark.parametrize("row", HEIGHT_ROWS, ids=row_id)
def test_rows_of_tables_9_and_10_by_eq_14(row: dict[str, str]) -> None:
    o_mm = size.size_on_sensor_mm(float(row["image_height_px"]), PIXEL_PITCH_UM)
    depth_m = float(row["estimated_depth_cm"]) / 100
    height_cm = 100 * float(size.height_eq14_m(o_mm, depth_m, FOCAL_LENGTH_MM))
    error_cm = abs(height_cm - float(row["estimated_height_cm"]))
    # A row with an erratum takes its height from another depth than it prints.
    assert (error_cm > 1.0) if row["erratum"] else (error_cm < 0.25)


def test_the_exact_magnification_halves_the_papers_height_error() -> None:
    px, depth_cm, true_cm = columns(
        CONSISTENT_HEIGHTS, "image_height_px", "estimated_depth_cm", "actual_height_cm"
    )
    o_mm = size.size_on_sensor_mm(px, PIXEL_PITCH_UM)
    by_eq14 = 100 * size.height_eq14_m(o_mm, depth_cm / 100, FOCAL_LENGTH_MM) - true_cm
    exact = 100 * size.height_exact_m(o_mm, depth_cm / 100, FOCAL_LENGTH_MM) - true_cm
    assert len(true_cm) == 17
    assert np.sqrt(np.mean(by_eq14**2)) == pytest.approx(2.39, abs=0.01)
    assert np.sqrt(np.mean(exact**2)) == pytest.approx(0.97, abs=0.01)
    assert np.mean(np.abs(exact) / true_cm) == pytest.approx(0.037, abs=0.001)


def test_eq_17_on_tables_3_to_7_is_as_far_off_as_it_is() -> None:
    rows = [r for r in DEPTH_ROWS if (r["paper_table"], r["row"]) != ("4", "4")]
    px, true_cm = columns(rows, "object_width_px", "actual_depth_cm")
    o_mm = size.size_on_sensor_mm(px, PIXEL_PITCH_UM)
    error_cm = 100 * size.depth_inverse_model_m(o_mm) - true_cm
    assert np.sqrt(np.mean(error_cm**2)) == pytest.approx(12.5, abs=0.5)


def test_eq_17_in_the_papers_own_units() -> None:
    assert 100 * size.depth_inverse_model_m(4.0) == pytest.approx(1.221 + 24.910 / 0.4)


lengths, depths = st.floats(0.01, 5.0), st.floats(0.5, 100.0)


@given(lengths, depths, st.floats(2.0, 300.0))
def test_size_and_depth_come_back_for_a_lens_focused_on_the_object(
    w_m: float, d_m: float, f_mm: float
) -> None:
    o_mm = w_m * 1e3 * f_mm / (d_m * 1e3 - f_mm)
    assert size.depth_from_size_focused_m(w_m, o_mm, f_mm) == pytest.approx(d_m, rel=1e-9)
    assert size.height_exact_m(o_mm, d_m, f_mm) == pytest.approx(w_m, rel=1e-9)
    # Eq. 14 is too large by d / (d - f)
    ratio = d_m * 1e3 / (d_m * 1e3 - f_mm)
    assert size.height_eq14_m(o_mm, d_m, f_mm) == pytest.approx(w_m * ratio, rel=1e-9)


@given(lengths, st.floats(0.01, 20.0), st.floats(2.0, 300.0))
def test_depth_falls_as_the_picture_of_the_object_grows(
    w_m: float, o_mm: float, v_mm: float
) -> None:
    assert size.depth_from_size_m(w_m, o_mm, v_mm) > size.depth_from_size_m(w_m, o_mm * 1.1, v_mm)


def test_a_size_that_is_not_positive_has_no_depth() -> None:
    assert np.isnan(size.depth_from_size_m(1.0, [0.0, -1.0], 50.0)).all()
    assert np.isnan(size.depth_inverse_model_m(0.0))


def test_deviations_are_those_of_a_simulation() -> None:
    random = np.random.default_rng(2)
    n = 200_000
    o_mm, w_m = random.normal(3.0, 0.04, n), random.normal(1.7, 0.05, n)
    d_m = size.depth_from_size_m(w_m, o_mm, 50.0)
    stated = size.depth_from_size_std_m(
        size.depth_from_size_m(1.7, 3.0, 50.0), 3.0, 0.04, 1.7, 0.05
    )
    assert stated == pytest.approx(d_m.std(), rel=0.01)
    depth_m = random.normal(20.0, 0.5, n)
    height_m = size.height_exact_m(o_mm, depth_m, 50.0)
    assert size.height_exact_std_m(3.0, 0.04, 20.0, 0.5, 50.0) == pytest.approx(
        height_m.std(), rel=0.01
    )
    inverse_m = size.depth_inverse_model_m(o_mm) + random.normal(0, 0.02, n)
    assert size.depth_inverse_model_std_m(3.0, 0.04, residual_std_m=0.02) == pytest.approx(
        inverse_m.std(), rel=0.01
    )


def slope(function: Callable[[float], np.ndarray], at: float) -> float:
    return float(function(at * (1 + 1e-6)) - function(at * (1 - 1e-6))) / (2e-6 * at)


@given(lengths, st.floats(0.01, 20.0), st.floats(2.0, 300.0))
def test_the_deviation_of_a_focused_size_is_the_numerical_derivative(
    w_m: float, o_mm: float, f_mm: float
) -> None:
    o_std_mm, w_std_m = 0.01 * o_mm, 0.05 * w_m
    by_o = slope(lambda o: size.depth_from_size_focused_m(w_m, o, f_mm), o_mm) * o_std_mm
    by_w = slope(lambda w: size.depth_from_size_focused_m(w, o_mm, f_mm), w_m) * w_std_m
    d_m = size.depth_from_size_focused_m(w_m, o_mm, f_mm)
    std_m = size.depth_from_size_focused_std_m(d_m, f_mm, o_mm, o_std_mm, w_m, w_std_m)
    assert std_m == pytest.approx(np.hypot(by_o, by_w), rel=1e-4)


@given(st.floats(0.01, 20.0), depths, st.floats(2.0, 300.0))
def test_the_deviation_of_eq_14_is_the_numerical_derivative(
    o_mm: float, d_m: float, f_mm: float
) -> None:
    o_std_mm, d_std_m = 0.02 * o_mm, 0.05 * d_m
    by_o = slope(lambda o: size.height_eq14_m(o, d_m, f_mm), o_mm) * o_std_mm
    by_d = slope(lambda d: size.height_eq14_m(o_mm, d, f_mm), d_m) * d_std_m
    std_m = size.height_eq14_std_m(o_mm, o_std_mm, d_m, d_std_m, f_mm)
    assert std_m == pytest.approx(np.hypot(by_o, by_d), rel=1e-4)


def test_inside_the_focal_length_there_is_no_height() -> None:
    assert np.isnan(size.height_exact_m(1.0, 0.049, 50.0))
