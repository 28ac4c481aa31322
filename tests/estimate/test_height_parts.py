"""The parts of a track height's error: they add up, and say what is shared."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.calibrate.walkers.joint import low_rank
from pipeline.core.records import Error, JointErrors
from pipeline.estimate.height_parts import SHARES, height_parts, slopes_of_tracks, unknown_parts


def joint() -> JointErrors:
    random = np.random.default_rng(3)
    scale, camera, boxes = (0.01 * random.normal(size=(len(Error), k)) for k in (1, 3, 2))
    served = random.normal(size=(40, len(Error)))
    few = low_rank(scale, np.hstack([camera, boxes]), served)
    return JointErrors(scale, camera, boxes, few, 2.0, 0.0, 1.0)


def test_shares_are_all_of_the_variance_and_the_parts_make_the_whole() -> None:
    given = joint()
    slopes = np.random.default_rng(4).normal(size=(5, len(Error)))
    slopes[4] = np.nan
    height_m, std_m, doubt_m = np.full(5, 1.8), np.full(5, 0.25), np.array([0, 0, 0.1, 0, 0.0])
    found = height_parts(given, slopes, height_m, std_m, doubt_m)
    shares = np.stack([np.asarray(found[f"{name}_share"]) for name in SHARES])
    np.testing.assert_allclose(shares[:, :4].sum(axis=0), 1.0)
    assert np.isnan(shares[:, 4]).all()
    assert (shares[:, :4] >= -1e-9).all()
    loadings = np.array(found["common_loadings_m"][:4])
    assert found["common_loadings_m"][4] is None
    own_m = np.asarray(found["own_std_m"])[:4]
    total = (loadings**2).sum(axis=1) + own_m**2 + doubt_m[:4] ** 2
    np.testing.assert_allclose(total, std_m[:4] ** 2)
    np.testing.assert_allclose(loadings[:, 0], 1.8 * slopes[:4] @ given.scale[:, 0])
    assert shares[SHARES.index("doubt"), 2] == pytest.approx(0.01 / 0.0625, rel=0.01)


def test_slopes_of_a_track_are_the_medians_of_its_frames() -> None:
    slopes = np.arange(60.0).reshape(6, 10)
    slopes[2] = np.nan
    found = slopes_of_tracks(np.array([7, 7, 7, 3, 3, 9]), slopes, np.array([3, 7, 11]))
    np.testing.assert_allclose(found[0], slopes[3:5].mean(axis=0))
    np.testing.assert_allclose(found[1], slopes[:2].mean(axis=0))
    assert np.isnan(found[2]).all()


def test_unknown_parts_have_the_same_columns() -> None:
    known = height_parts(joint(), np.ones((1, 10)), np.ones(1), np.ones(1), np.zeros(1))
    assert set(unknown_parts(1)) == set(known)
