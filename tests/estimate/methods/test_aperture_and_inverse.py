from __future__ import annotations

import csv
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.core.calibration import CalibratedMethod, Calibration, Dimension, Parameter
from pipeline.core.config import Config, EstimateConfig
from pipeline.estimate.boxes.geometry import Geometry
from pipeline.estimate.methods import aperture, inverse
from pipeline.optics.aperture_size import TABLE_8
from tests.estimate.scenes import lens, measured

PAPER = Path(__file__).parents[3] / "recordings" / "paper"


def paper_rows(name):
    with (PAPER / name).open() as lines:
        return list(csv.DictReader(lines))


def k_table(*rows, std=0.0, **facts):
    parameters = tuple(Parameter("k", k, std, n) for n, k in rows)
    return Calibration(CalibratedMethod.APERTURE, "person", Dimension.WIDTH, parameters, **facts)


def boxes(width_px, height_px=100.0):
    w = np.atleast_1d(np.asarray(width_px, dtype=np.float64))
    h = np.broadcast_to(height_px, w.shape)
    return np.stack([640 - w / 2, 360 - h / 2, 640 + w / 2, 360 + h / 2], axis=1)


def run(rows, calibration, **config):
    return aperture.estimate(Geometry.of(rows), Config(calibration=(calibration,), **config))


def test_the_papers_consistent_rows_with_the_k_that_they_imply():
    for row in paper_rows("depth_tables_3_to_7.csv"):
        if row["erratum"]:
            continue
        rows = measured(
            boxes(float(row["object_width_px"])), **lens(1, f_number=float(row["f_number"]))
        )
        for k, tolerance_m in ((row["k_implied"], 2e-4), (row["k_printed"], None)):
            found = run(rows, k_table((float(row["f_number"]), float(k))))
            printed_m = float(row["estimated_depth_cm"]) / 100
            allowed = tolerance_m if tolerance_m else 0.012 * printed_m
            assert found.depth_m[0] == pytest.approx(printed_m, abs=allowed)


def test_the_papers_heights_by_the_exact_magnification():
    rows = [r for r in paper_rows("height_tables_9_10.csv") if not r["erratum"]]
    number = {k: np.array([float(r[k]) for r in rows]) for k in rows[0] if k not in ("erratum",)}
    # widths that give the printed depths with k = 0.666 at f/2.8
    width_mm = 50 * 0.666 * 50 / (2 * 2.8) * 10 / (number["estimated_depth_cm"] * 10)
    m = measured(boxes(width_mm / 3.9e-3, number["image_height_px"]), **lens(len(rows)))
    found = run(m, k_table((2.8, 0.666)))
    np.testing.assert_allclose(found.depth_m * 100, number["estimated_depth_cm"])
    error_cm = found.height_m * 100 - number["actual_height_cm"]
    assert len(rows) == 17
    assert np.sqrt(np.mean(error_cm**2)) < 1.0  # the paper's, by Eq. 14: 2.39
    # Eq. 14, which the paper prints: o d / f, larger by d / (d - f)
    eq14_cm = found.height_m * 100 / (1 - 5 / number["estimated_depth_cm"])
    np.testing.assert_allclose(eq14_cm, number["estimated_height_cm"], atol=0.25)


@given(st.floats(1.8, 16.0))
def test_k_is_interpolated_in_log_n_and_refused_outside(n):
    found = run(measured(boxes(500.0), **lens(1, f_number=n)), k_table(*TABLE_8))
    k = np.interp(np.log(n), np.log([a for a, _ in TABLE_8]), [b for _, b in TABLE_8])
    expected_m = 50 * 10 * k * 50 / (2 * n) / (500 * 3.9e-3) / 1000
    assert found.depth_m[0] == pytest.approx(expected_m)
    assert found.in_calibrated_range[0] == 1


@pytest.mark.parametrize("n", [1.4, 22.0, np.nan])
def test_outside_the_f_numbers_there_is_no_estimate_unless_asked(n):
    rows = measured(boxes(500.0), **lens(1, f_number=n))
    assert np.isnan(run(rows, k_table(*TABLE_8)).depth_m[0])
    asked = run(rows, k_table(*TABLE_8), estimate=EstimateConfig(extrapolate=True))
    assert np.isfinite(asked.depth_m[0]) == np.isfinite(n)
    assert asked.in_calibrated_range[0] == 0 or np.isnan(n)


def test_outside_the_depths_the_estimate_stands_and_is_flagged():
    rows = measured(boxes([500.0, 5.0]), **lens(2))
    found = run(rows, k_table((2.8, 0.66), depth_min_m=0.5, depth_max_m=3.0))
    assert np.isfinite(found.depth_m).all()
    np.testing.assert_array_equal(found.in_calibrated_range, [1, 0])


def test_an_extrapolated_k_is_flagged_at_any_depth():
    rows = measured(boxes(500.0), **lens(1, f_number=8.0))
    calibration = k_table((2.8, 0.66), (4.0, 0.95), depth_min_m=0.1, depth_max_m=90.0)
    found = run(rows, calibration, estimate=EstimateConfig(extrapolate=True))
    assert found.depth_m[0] == pytest.approx(10 * 0.95 * 50 / 8 / (500 * 3.9e-3) * 50 / 1000)
    assert found.in_calibrated_range[0] == 0


def test_a_nearer_focus_moves_the_sensor_back():
    rows = measured(boxes(500.0), **lens(1, focus_distance_m=0.5))
    at_infinity = run(measured(boxes(500.0), **lens(1)), k_table((2.8, 0.66)))
    v_over_f = 0.5 / (0.5 - 0.05)
    found = run(rows, k_table((2.8, 0.66)))
    assert found.depth_m[0] == pytest.approx(at_infinity.depth_m[0] * v_over_f)
    o_m = 100 * 3.9e-6
    assert found.height_m[0] == pytest.approx(o_m * found.depth_m[0] / (0.05 * v_over_f))


def test_it_holds_only_for_the_camera_and_class_that_it_was_made_on():
    rows = measured(boxes([500.0, 500.0]), **lens(2))
    rows.class_name[1] = "van"
    found = run(rows, k_table((2.8, 0.66)))
    assert np.isfinite(found.depth_m).tolist() == [True, False]
    assert np.isnan(run(rows, k_table((2.8, 0.66), camera="other")).depth_m).all()
    generic, own = k_table((2.8, 0.5)), k_table((2.8, 0.66), camera="cam")
    both = aperture.estimate(Geometry.of(rows), Config(calibration=(generic, own)))
    assert both.calibration_id[0] == own.calibration_id
    assert both.calibration_id[1] is None


@pytest.mark.parametrize(("side", "depth", "height"), [(0, 0, 0), (2, 0, 0), (1, 1, 0), (3, 1, 0)])
def test_a_side_that_is_cut_off_carries_no_size(side, depth, height):
    rows = measured(boxes(500.0), **lens(1))
    rows.truncated[0, side] = True
    found = run(rows, k_table((2.8, 0.66)))
    assert np.isfinite(found.depth_m[0]) == depth
    assert np.isfinite(found.height_m[0]) == height
    assert np.isfinite(found.height_std_m[0]) == height


def test_a_height_that_gave_the_depth_is_not_measured():
    calibration = replace(k_table((2.8, 0.66), std=0.01), dimension=Dimension.HEIGHT)
    rows = measured(boxes(50.0, 500.0), **lens(1))
    rows.std_xyxy_px[:] = 5.0
    found = run(rows, calibration)
    assert found.height_assumed[0]
    assert found.height_std_m[0] == pytest.approx(
        500 * 3.9e-3 / 50 * found.depth_m[0] * 0.01 / 0.66
    )


def test_eq_17_and_its_error_with_correlated_coefficients():
    rng = np.random.default_rng(0)
    b = np.array([0.2, 2.5])
    std, rho = np.array([0.02, 0.05]), -0.95
    cov = np.outer(std, std) * [[1, rho], [rho, 1]]
    calibration = Calibration(
        CalibratedMethod.INVERSE,
        "person",
        Dimension.WIDTH,
        (
            Parameter("b0_m", b[0], std[0]),
            Parameter("b1_m_mm", b[1], std[1]),
            Parameter("b0_b1_correlation", rho),
        ),
        residual_std_m=0.015,
    )
    rows = measured(boxes([300.0, 900.0]), **lens(2))
    rows.std_xyxy_px[:] = 2.0
    found = inverse.estimate(Geometry.of(rows), Config(calibration=(calibration,)))
    o_mm = np.array([300, 900]) * 3.9e-3
    np.testing.assert_allclose(found.depth_m, b[0] + b[1] / o_mm)
    draws = rng.multivariate_normal(b, cov, 40_000)
    noisy = o_mm + rng.normal(0, 2 * np.sqrt(2) * 3.9e-3, (40_000, 2))
    depths = draws[:, :1] + draws[:, 1:] / noisy + rng.normal(0, 0.015, (40_000, 2))
    np.testing.assert_allclose(found.depth_std_m, depths.std(axis=0), rtol=0.03)
