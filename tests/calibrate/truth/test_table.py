from __future__ import annotations

import numpy as np
import pyarrow as pa
import pytest

from pipeline.calibrate.truth.fit import calibrate_from_truth
from pipeline.calibrate.truth.table import truth_table
from pipeline.core.calibration import CalibratedMethod
from pipeline.core.config import Config
from pipeline.estimate.estimate_tracks import estimate
from tests.estimate.scenes import lens, tables


def staffs(n=12, seed=0):
    """A staff 6 cm wide, at 0.5 to 3 m, measured to about a per cent."""
    rng = np.random.default_rng(seed)
    depth_m = np.linspace(0.5, 3.0, n)
    width_px = 0.06 * 50 / depth_m / 3.9e-3 * (1 + rng.normal(0, 0.01, n))
    box = np.stack([600 - width_px / 2, np.full(n, 200.0), 600 + width_px / 2, np.full(n, 400.0)])
    return depth_m, tables(box.T, lens(n), class_name=["staff"] * n)


def matches(depth_m, shuffle=0):
    index = np.random.default_rng(shuffle).permutation(len(depth_m))[:-2]
    return pa.table(
        {
            "observation_index": pa.array(index, pa.int32()),
            "object_id": [f"s{i}" for i in index],
            "true_depth_m": depth_m[index],
        }
    )


def test_truth_meets_its_observation_and_the_rest_is_left_out():
    depth_m, stored = staffs()
    table = truth_table("r", **stored, matches=matches(depth_m))
    assert table.num_rows == 10
    implied_m = table["true_depth_m"].to_numpy() * table["width_on_sensor_mm"].to_numpy() / 50
    np.testing.assert_allclose(implied_m, 0.06, rtol=0.04)
    assert table["true_height_m"].null_count == 10
    assert set(table["recording_id"].to_pylist()) == {"r"}


def test_calibrated_and_estimated_depths_close_the_circle():
    depth_m, stored = staffs()
    table = truth_table("r", **stored, matches=matches(depth_m))
    fitted = calibrate_from_truth(table, k_bounds=None)
    assert {c.method for c in fitted} == {
        CalibratedMethod.APERTURE,
        CalibratedMethod.SIZE,
        CalibratedMethod.INVERSE,
    }
    other_m, other = staffs(40, seed=1)
    result = estimate(**other, poses={}, config=Config(calibration=tuple(fitted))).estimates
    for method in ("aperture", "size", "inverse"):
        rows = result.filter(pa.compute.equal(result["method"], method))
        error_m = rows["depth_m"].to_numpy() - other_m[rows["observation_index"].to_numpy()]
        assert np.sqrt(np.mean(error_m**2)) < 0.03
        z = error_m / rows["depth_std_m"].to_numpy()
        assert np.mean(np.abs(z) < 1.96) > 0.8
        assert rows["in_calibrated_range"].to_numpy(zero_copy_only=False).mean() > 0.5


def test_nothing_matched_is_an_empty_table():
    depth_m, stored = staffs()
    assert truth_table("r", **stored, matches=matches(depth_m).slice(0, 0)).num_rows == 0


def test_a_cut_side_has_no_size():
    depth_m, stored = staffs()
    cut = pa.array([True] * 12)
    at = stored["observations"].column_names.index("truncated_left")
    stored["observations"] = stored["observations"].set_column(at, "truncated_left", cut)
    table = truth_table("r", **stored, matches=matches(depth_m))
    assert table["width_on_sensor_mm"].null_count == 10
    assert table["height_on_sensor_mm"].to_numpy() == pytest.approx(200 * 3.9e-3)
