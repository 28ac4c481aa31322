"""Exposure values against the tables that photographers know."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.optics import exposure


def test_exposure_values_that_everybody_knows() -> None:
    assert exposure.exposure_value(1.0, 1.0) == 0.0
    assert exposure.exposure_value_100(16.0, 1 / 125, 100.0) == pytest.approx(15.0, abs=0.05)
    assert exposure.exposure_value_100(16.0, 1 / 125, 200.0) == pytest.approx(14.0, abs=0.05)


def test_a_sunny_scene_has_some_4000_candela() -> None:
    """EV 15 at K = 12.5 is 2^15 * 12.5 / 100 cd/m2 (ISO 2720)."""
    n, t = np.sqrt(2.0**15 / 100), 1 / 100
    assert exposure.scene_luminance_cd_m2(n, t, 100.0) == pytest.approx(2**15 * 0.125, rel=1e-12)


@given(st.floats(0.0, 1.0))
def test_srgb_comes_back(value: float) -> None:
    assert exposure.linear_to_srgb(exposure.srgb_to_linear(value)) == pytest.approx(value, abs=1e-6)


def test_luminance_weighs_white_with_one_and_green_most() -> None:
    assert exposure.relative_luminance(1.0, 1.0, 1.0) == pytest.approx(1.0)
    assert exposure.relative_luminance(1.0, 0.0, 0.0) == 0.2126  # the paper's 0.2162 is an erratum


@given(st.floats(1.0, 32.0), st.floats(1e-4, 10.0), st.floats(50, 12800), st.floats(0.001, 1.0))
def test_a_pixel_gets_half_the_light_at_each_stop(
    n: float, t: float, iso: float, l_s: float
) -> None:
    value = exposure.expected_pixel_value(n, t, iso, l_s)
    assert exposure.expected_pixel_value(n * np.sqrt(2), t, iso, l_s) == pytest.approx(value / 2)
    assert exposure.expected_pixel_value(n, 2 * t, iso, l_s) == pytest.approx(2 * value)


def test_the_meter_constant_keeps_to_its_standard() -> None:
    with pytest.raises(ValueError, match=r"10\.6"):
        exposure.scene_luminance_cd_m2(8.0, 0.01, 100.0, meter_constant=20.0)


def test_unknown_settings_give_unknown_light() -> None:
    assert np.isnan(exposure.exposure_value_100(np.nan, 0.01, 100.0))
    assert np.isnan(exposure.scene_luminance_cd_m2(2.0, np.nan, 100.0))


def test_srgb_at_known_points_and_without_a_step() -> None:
    known = exposure.srgb_to_linear([0.0, 0.04045, 0.5, 1.0])
    np.testing.assert_allclose(known, [0.0, 0.0031308, 0.2140411, 1.0], atol=1e-7)
    steps = np.diff(exposure.srgb_to_linear(np.linspace(0, 1, 10_001)))
    assert (steps > 0).all()
    assert steps.max() < 3e-4


@given(st.floats(1.0, 32.0), st.floats(1e-4, 10.0), st.floats(50, 12800))
def test_what_a_meter_reads_renders_alike_at_any_setting(n: float, t: float, iso: float) -> None:
    luminance = exposure.scene_luminance_cd_m2(n, t, iso)
    assert luminance == pytest.approx(0.125 * 2.0 ** exposure.exposure_value_100(n, t, iso))
    assert exposure.expected_pixel_value(n, t, iso, luminance) == pytest.approx(12.5**2)


@pytest.mark.parametrize("constant", [10.5, 13.5, float("nan")])
def test_both_equations_keep_to_the_standard(constant: float) -> None:
    with pytest.raises(ValueError, match=r"10\.6-13\.4"):
        exposure.scene_luminance_cd_m2(2.0, 0.01, 100.0, constant)
    with pytest.raises(ValueError, match=r"10\.6-13\.4"):
        exposure.expected_pixel_value(2.0, 0.01, 100.0, 1.0, constant)
    for allowed in (10.6, 13.4):
        assert exposure.scene_luminance_cd_m2(2.0, 0.01, 100.0, allowed) == 4 * allowed


@pytest.mark.parametrize(
    "settings", [(0.0, 0.01, 100.0), (2.0, 0.0, 100.0), (2.0, -1.0, 100.0), (2.0, 0.01, 0.0)]
)
def test_absurd_settings_say_nothing_of_the_light(settings: tuple[float, float, float]) -> None:
    assert np.isnan(exposure.exposure_value_100(*settings))
    assert np.isnan(exposure.scene_luminance_cd_m2(*settings))
    assert np.isnan(exposure.expected_pixel_value(*settings, 1.0))
