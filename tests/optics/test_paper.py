"""The paper's rows, computed again: its k, its accuracy, its errors.

The rows one by one are in test_aperture_size.py and test_object_size.py.
"""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.optics.aperture_size import depth_eq16_m, equivalent_object_size_m, implied_k
from pipeline.optics.object_size import (
    EQ17_B1_M_MM,
    EQ17_B1_STD_M_MM,
    depth_from_size_m,
    depth_inverse_model_m,
    height_eq14_m,
    height_exact_m,
    size_on_sensor_mm,
)
from tests.support.paper import (
    CONSISTENT_HEIGHTS,
    DEPTH_ROWS,
    FOCAL_LENGTH_MM,
    HEIGHT_ROWS,
    PIXEL_PITCH_UM,
)


def column(rows: list[dict[str, str]], name: str) -> np.ndarray:
    return np.array([float(r[name]) for r in rows])


# Table 4 row 4 contradicts itself: its width is not the one of its depth.
USABLE = [r for r in DEPTH_ROWS if (r["paper_table"], r["row"]) != ("4", "4")]
WIDTH_MM = size_on_sensor_mm(column(USABLE, "object_width_px"), PIXEL_PITCH_UM)
PRINTED_CM, ACTUAL_CM = column(USABLE, "estimated_depth_cm"), column(USABLE, "actual_depth_cm")


def rmse(error: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.square(error))))


def depth_row(table: str, row: str) -> dict[str, str]:
    return next(r for r in DEPTH_ROWS if (r["paper_table"], r["row"]) == (table, row))


def test_all_rows_are_there() -> None:
    assert (len(DEPTH_ROWS), len(USABLE), sum(bool(r["erratum"]) for r in DEPTH_ROWS)) == (
        35,
        34,
        4,
    )
    assert (len(HEIGHT_ROWS), len(CONSISTENT_HEIGHTS)) == (22, 17)


def test_no_row_with_an_erratum_comes_out_with_the_k_of_its_table() -> None:
    for row in DEPTH_ROWS:
        o_mm = size_on_sensor_mm(float(row["object_width_px"]), PIXEL_PITCH_UM)
        n, k = float(row["f_number"]), float(row["k_implied"])
        depth_cm = 100 * depth_eq16_m(o_mm, FOCAL_LENGTH_MM, n, k)
        error_cm = abs(depth_cm - float(row["estimated_depth_cm"]))
        assert (error_cm > 0.7) if row["erratum"] else (error_cm < 0.01), row


def test_the_sign_in_eq_16_is_negative_in_the_papers_units() -> None:
    # k f I a / (I a - f (o + a)) with I = f, lengths in cm but a in mm: row 1 of Table 3
    f_cm, a_mm, o_cm = 5.0, 50 / 1.8 / 2, 1519.25 * 3.9e-4
    printed_cm = 0.4545 * f_cm * f_cm * a_mm / (f_cm * a_mm - f_cm * (o_cm + a_mm))
    assert printed_cm == pytest.approx(-53.27, abs=0.01)


def test_what_the_width_in_table_4_row_4_should_be() -> None:
    size_m = equivalent_object_size_m(0.666, FOCAL_LENGTH_MM, 2.8)
    depth_m = float(depth_row("4", "4")["estimated_depth_cm"]) / 100
    width_mm = FOCAL_LENGTH_MM * size_m / depth_m
    assert width_mm * 1e3 / PIXEL_PITCH_UM == pytest.approx(930.05, abs=0.15)


def test_table_4_row_5_is_a_copy_from_table_3() -> None:
    wrong, source = depth_row("4", "5"), depth_row("3", "5")
    assert wrong["estimated_depth_cm"] == source["estimated_depth_cm"]


@pytest.mark.parametrize(
    ("f_number", "k"), [(1.8, 0.4545), (2.8, 0.666), (3.2, 0.769), (3.5, 0.85), (4.0, 0.95)]
)
def test_the_k_that_the_rows_imply_is_finer_than_table_8(f_number: float, k: float) -> None:
    rows = [r for r in DEPTH_ROWS if float(r["f_number"]) == f_number and not r["erratum"]]
    o_mm = size_on_sensor_mm(column(rows, "object_width_px"), PIXEL_PITCH_UM)
    implied = implied_k(column(rows, "estimated_depth_cm") / 100, o_mm, FOCAL_LENGTH_MM, f_number)
    np.testing.assert_allclose(implied, k, atol=2e-4)


def test_k_stands_for_an_object_as_wide_as_the_staff() -> None:
    size_m = equivalent_object_size_m([0.4545, 0.666], FOCAL_LENGTH_MM, [1.8, 2.8])
    np.testing.assert_allclose(size_m, [0.063, 0.059], atol=6e-4)


def test_the_printed_estimates_are_as_good_as_they_are() -> None:
    error_cm = PRINTED_CM - ACTUAL_CM
    assert rmse(error_cm) == pytest.approx(3.23, abs=0.005)
    assert np.abs(error_cm).mean() == pytest.approx(2.405, abs=0.001)
    assert np.corrcoef(PRINTED_CM, ACTUAL_CM)[0, 1] == pytest.approx(0.9904, abs=5e-5)


def test_one_size_for_all_apertures_does_better_on_rows_left_out() -> None:
    x = FOCAL_LENGTH_MM / WIDTH_MM
    xy, xx = x * ACTUAL_CM, x * x
    size_m = (xy.sum() - xy) / (xx.sum() - xx) / 100  # least squares without the row itself
    depth_cm = 100 * depth_from_size_m(size_m, WIDTH_MM, FOCAL_LENGTH_MM)
    assert rmse(depth_cm - ACTUAL_CM) == pytest.approx(2.49, abs=0.005)
    assert np.abs(depth_cm - ACTUAL_CM).mean() == pytest.approx(1.71, abs=0.005)
    assert np.corrcoef(depth_cm, ACTUAL_CM)[0, 1] == pytest.approx(0.9929, abs=5e-5)


def test_eq_17_is_not_of_these_rows() -> None:
    """12.5 cm on the 34 usable rows; 12.9 cm if the row that contradicts itself is counted."""
    all_mm = size_on_sensor_mm(column(DEPTH_ROWS, "object_width_px"), PIXEL_PITCH_UM)
    all_error_cm = 100 * depth_inverse_model_m(all_mm) - column(DEPTH_ROWS, "actual_depth_cm")
    assert rmse(all_error_cm) == pytest.approx(12.92, abs=0.005)
    assert rmse(100 * depth_inverse_model_m(WIDTH_MM) - ACTUAL_CM) == pytest.approx(
        12.51, abs=0.005
    )


def test_table_13s_standard_error_is_the_one_that_its_t_needs() -> None:
    t = EQ17_B1_M_MM / EQ17_B1_STD_M_MM
    assert t == pytest.approx(61.928, rel=1e-3)
    assert t / 2 > 24.910 / 0.990  # the printed one


def test_the_error_of_the_heights_by_either_equation() -> None:
    o_mm = size_on_sensor_mm(column(CONSISTENT_HEIGHTS, "image_height_px"), PIXEL_PITCH_UM)
    depth_m = column(CONSISTENT_HEIGHTS, "estimated_depth_cm") / 100
    true_cm = column(CONSISTENT_HEIGHTS, "actual_height_cm")
    by_eq14 = 100 * height_eq14_m(o_mm, depth_m, FOCAL_LENGTH_MM) - true_cm
    exact = 100 * height_exact_m(o_mm, depth_m, FOCAL_LENGTH_MM) - true_cm
    assert (rmse(by_eq14), rmse(exact)) == pytest.approx((2.39, 0.97), abs=0.005)
    assert np.mean(np.abs(by_eq14) / true_cm) == pytest.approx(0.106, abs=0.0005)
    assert np.mean(np.abs(exact) / true_cm) == pytest.approx(0.037, abs=0.0005)
