"""The covariance of a fit to walkers, beside fits without each of them and beside worse boxes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bench.walkers import scene
from pipeline.calibrate.walkers import covariance as walkers_covariance
from pipeline.calibrate.walkers.known_lengths import NOTHING_KNOWN, scale_of
from pipeline.calibrate.walkers.model import ABOVE, ROLL, TILT
from pipeline.calibrate.walkers.pose import Fitted, best_fit, fit_walkers
from pipeline.calibrate.walkers.sample import only
from pipeline.calibrate.walkers.segments import Segments
from pipeline.calibrate.walkers.upright_edges import NO_UPRIGHTS
from pipeline.core.arrays import FloatArray
from pipeline.core.config import ADULT
from pipeline.core.records import KnownLength


def fitted(seed: int, people: int = 10) -> Fitted:
    return fit_walkers(scene(np.random.default_rng(seed), people, bad_share=0.0).measured, ADULT)


@pytest.mark.parametrize("seed", [4, 6])
def test_what_tracks_disagree_by_is_what_fits_without_each_of_them_do(
    monkeypatch: pytest.MonkeyPatch, seed: int
) -> None:
    of_all = fitted(seed)
    people = of_all.sample.people
    tilts = []
    for left_out in range(people):
        sample = only(of_all.sample, np.arange(people) != left_out)
        scale = scale_of(sample, ADULT, NOTHING_KNOWN, of_all.measured, NO_UPRIGHTS)
        tilts.append(best_fit(sample, scale, of_all.fit).x[TILT])
    jackknife = np.sqrt((people - 1) / people * ((tilts - of_all.fit.x[TILT]) ** 2).sum())
    monkeypatch.setattr(walkers_covariance, "STATED_TRACKS", 0.0)
    monkeypatch.setattr(walkers_covariance, "_common", lambda fit, *_: np.zeros((len(fit.fun), 1)))
    covariance = walkers_covariance.covariance_of(of_all.fit, of_all.sample, of_all.scale)
    assert np.sqrt(covariance[1, 1]) == pytest.approx(jackknife, rel=0.3)


def test_boxes_that_scatter_more_have_more_in_common() -> None:
    good = fitted(6)
    worse = good.measured.bbox_xyxy_px.copy()
    tall_px = worse[:, 3] - worse[:, 1]
    worse[:, 1] += 0.04 * tall_px * np.random.default_rng(0).normal(size=len(tall_px))
    bad = fit_walkers(replace(good.measured, bbox_xyxy_px=worse), ADULT)

    def shares(fit: Fitted) -> FloatArray:
        columns = walkers_covariance._common(fit.fit, fit.sample, fit.scale)
        tall = fit.sample.foot[:, 1] - fit.sample.head[:, 1]
        per_share = tall / fit.sample.sigma * np.sqrt(fit.sample.weight)
        return np.abs(columns[: len(tall)] / per_share[:, None]).mean(axis=0)

    assert shares(good)[0] < 0.02  # the boxes are off by a pixel in a hundred
    assert (shares(bad)[:3] > 2 * shares(good)[:3]).all()


def test_a_lens_that_bends_moves_the_ends_of_known_lengths_too() -> None:
    seen = fitted(6)
    lens = seen.measured.intrinsics
    assert lens is not None
    known = (KnownLength((5.0, 700.0, 1270.0, 700.0), 4.0),)
    scale = replace(seen.scale, segments=Segments.of(known, lens))
    x = seen.fit.x
    by_bend = walkers_covariance.bent_residuals(x, seen.sample, scale)
    ends = scale.segments.points
    step = 1e-3
    bent = replace(scale.segments, points=ends * (1 + step * (ends**2).sum(axis=-1)[..., None]))
    pose = float(np.exp(x[ABOVE])), float(x[TILT]), float(x[ROLL])
    slope = (bent.off(*pose) - scale.segments.off(*pose)) / step
    assert abs(slope[0]) > 1e-3
    assert by_bend[-1] == pytest.approx(slope[0], rel=0.02)
