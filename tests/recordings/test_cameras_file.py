"""`cameras.toml` holds the paper's calibrations, and figures that its rows really give."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.core.calibration import CalibratedMethod, Dimension
from pipeline.core.config import load_config
from recordings.fit_staff import B0_M, B1_M_MM, consistent_rows, figures
from tests.recordings.conftest import RECORDINGS


@pytest.fixture(scope="module")
def config():
    return load_config(RECORDINGS / "cameras.toml")


@pytest.fixture(scope="module")
def calibrations(config):
    return {c.method: c for c in config.calibration}


@pytest.fixture(scope="module")
def computed():
    return figures()


def test_street_file_is_read():
    assert load_config(RECORDINGS / "street.toml").camera[0].name == "street_mast"


def test_all_belong_to_the_staff(config, calibrations):
    assert [c.name for c in config.camera] == ["nikon_d5300"]
    assert config.camera[0].focal_length_mm == 50
    assert set(calibrations) == {
        CalibratedMethod.APERTURE,
        CalibratedMethod.INVERSE,
        CalibratedMethod.SIZE,
    }
    for c in config.calibration:
        assert (c.camera, c.object_class) == ("nikon_d5300", "levelling_staff")
        assert c.dimension is Dimension.WIDTH
        assert (c.depth_min_m, c.depth_max_m) == (0.5, 1.1)
        assert "paper" in c.source or "Tables 3-7" in c.source


def test_aperture_is_table_8(calibrations, table_8, computed):
    c = calibrations[CalibratedMethod.APERTURE]
    assert {p.f_number: p.value for p in c.parameters} == table_8
    assert c.observation_count == computed["observation_count"] == 34
    assert c.residual_std_m == pytest.approx(computed["aperture.rmse_m"], rel=1e-3)
    assert c.fit_rmse_m == pytest.approx(computed["aperture.rmse_m"], rel=1e-3)


def test_inverse_is_eq_17_in_si_units(calibrations, computed):
    c = calibrations[CalibratedMethod.INVERSE]
    o_cm = 0.42
    depth_m = c.value("b0_m") + c.value("b1_m_mm") / (o_cm * 10)
    assert depth_m == pytest.approx((1.221 + 24.910 / o_cm) / 100)
    assert (c.value("b0_m"), c.value("b1_m_mm")) == (B0_M, B1_M_MM)
    # Table 13: b / standard error = t; the slope's printed error, 0.990, does not give t = 61.928.
    assert c.value("b1_m_mm") / c.std_error("b1_m_mm") == pytest.approx(61.928, rel=1e-3)
    assert c.value("b0_m") / c.std_error("b0_m") == pytest.approx(0.916, rel=1e-3)
    assert c.residual_std_m == pytest.approx(computed["inverse.rmse_m"], rel=1e-3)


def test_size_is_the_fit(calibrations, computed):
    c = calibrations[CalibratedMethod.SIZE]
    for name in ("residual_std_m", "fit_rmse_m", "loo_rmse_m"):
        assert getattr(c, name) == pytest.approx(computed[f"size.{name}"], rel=1e-3)
    assert c.value("object_size_m") == pytest.approx(computed["size.object_size_m"], rel=1e-3)
    assert c.std_error("object_size_m") == pytest.approx(computed["size.std_error"], rel=1e-2)


def test_fit_is_least_squares_and_left_out(computed):
    size_mm, _, depth_m = consistent_rows()
    x = 50 / size_mm
    solution, squares, *_ = np.linalg.lstsq(x[:, None], depth_m, rcond=None)
    assert computed["size.object_size_m"] == pytest.approx(solution[0])
    assert computed["size.fit_rmse_m"] == pytest.approx(np.sqrt(squares[0] / 34))
    # Leave-one-out has a closed form: residual / (1 - leverage).
    left_out = (depth_m - x * solution[0]) / (1 - x**2 / (x @ x))
    assert computed["size.loo_rmse_m"] == pytest.approx(np.sqrt(np.mean(left_out**2)))
    # Better than the estimates that the paper prints: RMSE 3.23 cm, MAE 2.41 cm, r 0.9904.
    assert computed["size.loo_rmse_m"] == pytest.approx(0.0249, abs=5e-5)
    assert computed["size.loo_mae_m"] == pytest.approx(0.0171, abs=5e-5)
    assert computed["size.loo_r"] == pytest.approx(0.9929, abs=5e-5)
