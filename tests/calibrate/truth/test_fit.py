from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.calibrate.truth.fit import (
    METHODS,
    calibrate_from_truth,
    prior_as_calibration,
    says_nothing,
    size_priors_from_truth,
)
from pipeline.core.calibration import CalibratedMethod, Dimension
from pipeline.core.errors import CalibrationUndetermined
from pipeline.optics.thin_lens import image_distance_mm

PAPER = Path(__file__).parents[3] / "recordings" / "paper"


def paper_table() -> pa.Table:
    with (PAPER / "depth_tables_3_to_7.csv").open() as lines:
        rows = [r for r in csv.DictReader(lines) if (r["paper_table"], r["row"]) != ("4", "4")]
    n = len(rows)
    return pa.table(
        {
            "camera": ["nikon_d5300"] * n,
            "class_name": ["levelling_staff"] * n,
            "f_number": [float(r["f_number"]) for r in rows],
            "focal_length_mm": [50.0] * n,
            "focus_distance_m": [float("inf")] * n,
            "width_on_sensor_mm": [float(r["object_width_px"]) * 3.9e-3 for r in rows],
            "height_on_sensor_mm": [15.6] * n,
            "true_depth_m": [float(r["actual_depth_cm"]) / 100 for r in rows],
            "recording_id": ["paper"] * n,
            "object_id": [f"{r['paper_table']}/{r['row']}" for r in rows],
        }
    )


def by_method(calibrations):
    return {c.method: c for c in calibrations}


def test_on_the_paper_one_size_beats_the_paper_out_of_sample():
    size = by_method(calibrate_from_truth(paper_table()))[CalibratedMethod.SIZE]
    assert size.dimension is Dimension.WIDTH  # the height fills the picture and says nothing
    assert size.loo_rmse_m < 0.025 < 0.0323  # the paper's own: 3.23 cm
    assert size.observation_count == 34
    assert (size.depth_min_m, size.depth_max_m) == (0.5, 1.1)
    assert size.fit_rmse_m < size.loo_rmse_m
    assert size.value("object_size_m") == pytest.approx(0.0593, abs=2e-4)


def test_on_the_paper_the_bound_of_k_is_active_at_f_1_8_and_costs():
    bounded = by_method(calibrate_from_truth(paper_table()))[CalibratedMethod.APERTURE]
    free = by_method(calibrate_from_truth(paper_table(), k_bounds=None))[CalibratedMethod.APERTURE]
    n, k, k_std = free.by_f_number("k")
    np.testing.assert_array_equal(n, [1.8, 2.8, 3.2, 3.5, 4.0])
    assert k[0] == pytest.approx(0.4286, abs=1e-3)
    assert (k_std > 0).all()
    assert bounded.by_f_number("k")[1][0] == 0.45
    assert "f/1.8" in bounded.source
    assert "bound" not in free.source
    assert bounded.loo_rmse_m > free.loo_rmse_m


def test_eq_17_is_the_line_that_numpy_fits():
    table = paper_table()
    inverse = by_method(calibrate_from_truth(table))[CalibratedMethod.INVERSE]
    o = table["width_on_sensor_mm"].to_numpy()
    slope, intercept = np.polyfit(1 / o, table["true_depth_m"].to_numpy(), 1)
    assert inverse.value("b1_m_mm") == pytest.approx(slope)
    assert inverse.value("b0_m") == pytest.approx(intercept)
    assert -1 < inverse.value("b0_b1_correlation") < -0.9


@given(
    st.floats(0.02, 3.0),
    st.floats(4.0, 200.0),
    st.sampled_from([np.inf, np.nan, 5.0]),
    st.integers(0, 2**32 - 1),
    st.booleans(),
)
@settings(max_examples=25, deadline=None)
def test_what_was_put_in_comes_out(size_m, focal_mm, focus_m, seed, robust):
    rng = np.random.default_rng(seed)
    n = 60
    depth_m = rng.uniform(2, 40, n)
    v_mm = image_distance_mm(focus_m, focal_mm)
    error = 1 + rng.normal(0, 0.01, n)
    f_number = rng.choice([2.0, 4.0, 8.0], n)
    table = pa.table(
        {
            "camera": ["a"] * n,
            "class_name": ["post"] * n,
            "f_number": f_number,
            "focal_length_mm": np.full(n, focal_mm),
            "focus_distance_m": np.full(n, focus_m),
            "width_on_sensor_mm": size_m * v_mm / depth_m * error,
            "true_depth_m": depth_m,
            "recording_id": ["r"] * n,
            "object_id": [str(i) for i in range(n)],
        }
    )
    found = by_method(calibrate_from_truth(table, robust=robust, k_bounds=None))
    size = found[CalibratedMethod.SIZE]
    off = abs(size.value("object_size_m") - size_m)
    assert off < 5 * size.std_error("object_size_m")
    assert size.std_error("object_size_m") == pytest.approx(0.01 * size_m / np.sqrt(n), rel=0.5)
    assert size.value("residual_relative") == pytest.approx(0.01, rel=0.4)
    n_at, k, _ = found[CalibratedMethod.APERTURE].by_f_number("k")
    np.testing.assert_allclose(10 * k * focal_mm / (2 * n_at) * 1e-3, size_m, rtol=0.02)


def test_frames_of_the_same_object_are_held_out_together():
    # Ten objects of different size, each seen 30 times: left-out frames of a seen object would be
    # predicted as if its size were known.
    rng = np.random.default_rng(3)
    objects = np.repeat(np.arange(10), 30)
    depth_m = rng.uniform(5, 20, 300)
    size_m = (1.7 * (1 + rng.normal(0, 0.05, 10)))[objects]
    table = pa.table(
        {
            "camera": ["a"] * 300,
            "class_name": ["person"] * 300,
            "f_number": [2.0] * 300,
            "focal_length_mm": [6.0] * 300,
            "height_on_sensor_mm": size_m * 6.0 / depth_m,
            "true_depth_m": depth_m,
            "recording_id": ["r"] * 300,
            "object_id": [str(i) for i in objects],
        }
    )
    size = by_method(calibrate_from_truth(table))[CalibratedMethod.SIZE]
    assert size.dimension is Dimension.HEIGHT
    # ten objects, not 300, average out the spread of sizes
    assert size.std_error("object_size_m") > 0.4 * 1.7 * 0.05 / np.sqrt(10)
    assert size.loo_rmse_m > size.fit_rmse_m
    assert "10 objects" in size.source


def test_the_folds_are_seeded():
    one, two = (calibrate_from_truth(paper_table(), seed=s) for s in (1, 1))
    assert repr(one) == repr(two)
    other = calibrate_from_truth(paper_table(), seed=2)
    assert other[0].kfold_rmse_m != one[0].kfold_rmse_m


def test_without_truth_the_error_says_what_is_needed():
    table = paper_table()
    empty = table.set_column(
        table.column_names.index("true_depth_m"), "true_depth_m", pa.nulls(34, pa.float64())
    )
    with pytest.raises(CalibrationUndetermined, match="true depth"):
        calibrate_from_truth(empty, METHODS)


def test_a_camera_without_f_numbers_has_no_k():
    table = paper_table()
    table = table.set_column(
        table.column_names.index("f_number"), "f_number", pa.nulls(34, pa.float64())
    )
    assert set(by_method(calibrate_from_truth(table))) == {
        CalibratedMethod.SIZE,
        CalibratedMethod.INVERSE,
    }


def test_size_priors_count_objects_not_frames():
    heights_m = {"v": 1.6, "x": 1.65, "y": 1.8, "z": 1.75}
    table = pa.table(
        {
            "camera": ["a"] * 8,
            "class_name": ["person"] * 7 + ["dog"],
            "true_height_m": [*heights_m.values(), 1.6, 1.6, 1.6, 0.5],
            "recording_id": ["r"] * 8,
            "object_id": [*heights_m, "v", "v", "v", "w"],
        }
    )
    (prior,) = size_priors_from_truth(table)
    assert prior.object_class == "person"
    assert prior.dimension is Dimension.HEIGHT
    assert prior.mean_m == pytest.approx(1.7)
    assert prior.std_m == pytest.approx(np.std(list(heights_m.values()), ddof=1))
    assert prior.object_count == 4
    mean, std = prior_as_calibration(prior).parameters
    assert mean.std_error == pytest.approx(prior.std_m / 2)
    assert std.std_error == pytest.approx(prior.std_m / np.sqrt(6))


def test_three_objects_are_no_population():
    table = pa.table({"class_name": ["a"] * 3, "true_height_m": [1.0, 1.1, 1.2]})
    table = table.append_column("object_id", pa.array(["x", "y", "z"]))
    assert size_priors_from_truth(table) == []


def test_a_fit_that_predicts_no_better_than_the_mean_is_told_apart():
    table = paper_table()
    good = by_method(calibrate_from_truth(table))[CalibratedMethod.SIZE]
    assert not says_nothing(good, table)
    shuffled = np.random.default_rng(1).permutation(table["true_depth_m"].to_numpy())
    place = table.column_names.index("true_depth_m")
    noise = table.set_column(place, "true_depth_m", pa.array(shuffled))
    bad = by_method(calibrate_from_truth(noise))[CalibratedMethod.SIZE]
    assert says_nothing(bad, noise)
