from __future__ import annotations

import numpy as np
import pytest
import statsmodels.api as sm
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.calibrate.truth.regression import fit_linear, held_out, k_folds, leave_one_out, rmse

seeds = st.integers(0, 2**32 - 1)


def line(seed: int, n: int = 40, outliers: int = 0):
    rng = np.random.default_rng(seed)
    x = np.stack([np.ones(n), rng.uniform(0.5, 3, n)], axis=1)
    y = x @ [0.3, 2.0] + rng.normal(0, 0.1, n)
    y[:outliers] += 5.0
    return x, y, rng.uniform(0.2, 3, n), rng


@given(seeds)
@settings(max_examples=30, deadline=None)
def test_weighted_least_squares_agrees_with_statsmodels(seed):
    x, y, w, _ = line(seed)
    ours, theirs = fit_linear(x, y, w), sm.WLS(y, x, w).fit()
    np.testing.assert_allclose(ours.coefficients, theirs.params, rtol=1e-9)
    np.testing.assert_allclose(ours.covariance, theirs.cov_params(), rtol=1e-7)
    assert ours.residual_std == pytest.approx(np.sqrt(theirs.scale))
    assert ours.freedom == theirs.df_resid


@given(seeds)
@settings(max_examples=30, deadline=None)
def test_clustered_errors_agree_with_statsmodels(seed):
    x, y, w, rng = line(seed)
    groups = np.concatenate([np.arange(8), rng.integers(0, 8, len(y) - 8)])
    ours = fit_linear(x, y, w, groups=groups)
    theirs = sm.WLS(y, x, w).fit(cov_type="cluster", cov_kwds={"groups": groups})
    np.testing.assert_allclose(ours.covariance, theirs.cov_params(), rtol=1e-7)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("outliers", [0, 6])
def test_bisquare_agrees_with_statsmodels(seed, outliers):
    x, y, _, _ = line(seed, outliers=outliers)
    ours = fit_linear(x, y, robust=True)
    model = sm.RLM(y, x, M=sm.robust.norms.TukeyBiweight())
    theirs = model.fit(maxiter=500, tol=1e-13, scale_est="mad")
    np.testing.assert_allclose(ours.coefficients, theirs.params, rtol=1e-6)
    assert ours.residual_std == pytest.approx(theirs.scale, rel=1e-4)
    np.testing.assert_allclose(ours.std_errors, theirs.bse, rtol=1e-3)


def test_bisquare_ignores_outliers_that_pull_least_squares_away():
    x, y, _, _ = line(1, outliers=8)
    assert np.abs(fit_linear(x, y, robust=True).coefficients - [0.3, 2.0]).max() < 0.15
    assert np.abs(fit_linear(x, y).coefficients - [0.3, 2.0]).max() > 0.4


def test_a_perfect_fit_has_no_errors_and_too_few_rows_are_refused():
    x, _, _, _ = line(0, n=6)
    for robust in (False, True):
        fit = fit_linear(x, x @ [1.0, 2.0], robust=robust)
        np.testing.assert_allclose(fit.coefficients, [1.0, 2.0])
        assert fit.std_errors.max() < 1e-12
    with pytest.raises(ValueError, match="1 rows do not determine 2"):
        fit_linear(x[:1], np.ones(1))
    with pytest.raises(ValueError, match="do not determine"):
        fit_linear(x[:, [1, 1]], np.ones(6))
    assert np.isnan(fit_linear(x[:2], np.array([1.0, 2.0])).std_errors).all()


@given(seeds)
@settings(max_examples=20, deadline=None)
def test_leave_one_out_is_the_residual_over_one_less_leverage(seed):
    x, y, _, _ = line(seed, n=12)

    def fitter(rows):
        b = fit_linear(x[rows], y[rows]).coefficients
        return lambda left: x[left] @ b

    out = held_out(fitter, leave_one_out(np.arange(12)))
    leverage = np.diag(x @ np.linalg.inv(x.T @ x) @ x.T)
    expected = (y - x @ fit_linear(x, y).coefficients) / (1 - leverage)
    np.testing.assert_allclose(y - out, expected, atol=1e-9)


@given(st.lists(st.integers(0, 20), min_size=1, max_size=60), st.integers(2, 7), seeds)
def test_folds_keep_groups_together_and_repeat(groups, folds, seed):
    groups = np.array(groups)
    numbers = k_folds(groups, folds, seed)
    if len(set(groups)) > 1:
        for g in set(groups):
            assert len(set(numbers[groups == g])) == 1
    np.testing.assert_array_equal(numbers, k_folds(groups, folds, seed))
    assert numbers.min() >= 0
    assert numbers.max() < folds
    singles = leave_one_out(groups)
    assert len(set(singles)) == (len(set(groups)) if len(set(groups)) > 1 else len(groups))


def test_what_is_not_determined_is_left_out():
    assert rmse(np.array([3.0, 4.0, np.nan])) == pytest.approx(np.sqrt(12.5))
    assert np.isnan(rmse(np.array([np.nan])))

    def fitter(rows):
        raise ValueError

    assert np.isnan(held_out(fitter, np.arange(3))).all()
