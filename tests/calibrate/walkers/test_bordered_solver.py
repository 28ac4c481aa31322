"""Least squares with statures eliminated, beside those of all unknowns and beside SciPy's."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import OptimizeResult, least_squares

from bench.walkers import scene
from pipeline.calibrate.walkers import focal_length as focal
from pipeline.calibrate.walkers.bordered_solver import Bordered, inverse_of, robust_pull, settle
from pipeline.calibrate.walkers.model import PEOPLE, jacobian, residuals
from pipeline.calibrate.walkers.pace import pace_of
from pipeline.calibrate.walkers.pose import Fitted, fit_walkers, limits
from pipeline.core.config import ADULT


@pytest.fixture(scope="module")
def fitted() -> Fitted:
    return fit_walkers(scene(np.random.default_rng(6), 10, bad_share=0.0).measured, ADULT)


@pytest.mark.parametrize("damping", [0.0, 0.3])
def test_a_step_is_that_of_all_unknowns(fitted: Fitted, damping: float) -> None:
    slopes, pull = fitted.fit.jac.toarray(), robust_pull(fitted.fit.fun)
    step = Bordered.of(fitted.fit.jac, fitted.sample).step(pull, damping)
    square = slopes.T @ slopes
    square += damping * np.diag(np.diag(square))
    whole = -np.linalg.solve(square, slopes.T @ pull)
    np.testing.assert_allclose(step, whole, rtol=1e-6, atol=1e-9)


def test_what_is_left_is_the_covariance_of_what_all_share(fitted: Fitted) -> None:
    slopes = fitted.fit.jac.toarray()
    shared = Bordered.of(fitted.fit.jac, fitted.sample).shared
    whole = np.linalg.inv(slopes.T @ slopes)[:PEOPLE, :PEOPLE]
    np.testing.assert_allclose(inverse_of(shared.T @ shared), whole, rtol=1e-5, atol=1e-12)


def test_without_somebody_is_without_their_rows_and_their_stature(fitted: Fitted) -> None:
    slopes, pull = fitted.fit.jac.toarray(), robust_pull(fitted.fit.fun)
    mine = np.append(fitted.sample.track == 3, np.arange(fitted.sample.people) == 3)
    mine = np.append(mine, np.zeros(len(pull) - len(mine), dtype=np.bool_))
    shared = Bordered.of(fitted.fit.jac, fitted.sample).shared
    others = shared[~mine]
    step = -inverse_of(others.T @ others) @ (others.T @ pull[~mine])
    left = np.delete(slopes[~mine], PEOPLE + 3, axis=1)
    whole = np.linalg.lstsq(left, -pull[~mine], rcond=None)[0]
    np.testing.assert_allclose(step, whole[:PEOPLE], rtol=1e-6, atol=1e-9)


def test_what_nothing_determines_stays() -> None:
    np.testing.assert_allclose(inverse_of(np.diag([4.0, 0.0])), np.diag([0.25, 0.0]))


def test_a_fit_from_elsewhere_settles_where_scipy_does(fitted: Fitted) -> None:
    sample, scale = fitted.sample, fitted.scale
    start = fitted.fit.x + 0.05 * np.append([1.0, -1.0, 0.5], np.zeros(len(fitted.fit.x) - 3))
    found = settle(
        lambda x: residuals(x, sample, scale),
        lambda x: jacobian(x, sample, scale),
        start,
        limits(scale),
        sample,
    )
    scipy = least_squares(
        residuals, fitted.fit.x, args=(sample, scale), loss="soft_l1", f_scale=1.5, xtol=1e-12
    )
    assert found.cost == pytest.approx(scipy.cost, rel=1e-5)
    std = np.sqrt(np.diag(np.linalg.inv(scipy.jac.T @ scipy.jac)))
    assert np.abs((found.x - scipy.x) / std).max() < 0.02
    np.testing.assert_allclose(found.jac.T @ robust_pull(found.fun), 0.0, atol=0.02 / std.min())


def test_a_focal_length_is_found_at_no_greater_cost(
    fitted: Fitted, monkeypatch: pytest.MonkeyPatch
) -> None:
    pace = pace_of(fitted.sample, OptimizeResult(x=np.append(fitted.fit.x, 0.0)))
    slow = focal.fit_focal(fitted.sample, fitted.scale, pace, 0.0)
    count, slopes_of = [], focal._jacobian
    monkeypatch.setattr(focal, "_jacobian", lambda *given: count.append(1) or slopes_of(*given))
    fast = focal.free_focal(fitted.fit, fitted.sample, fitted.scale, pace)
    assert fast.cost < slow.cost * (1 + 1e-5)
    assert len(count) < 15
