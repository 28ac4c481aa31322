"""The tilt by few people, on simulated cameras whose truth is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bench.walkers import scene
from pipeline.calibrate.walkers.sample import sample_of
from pipeline.calibrate.walkers.tilt import _cost_at, _log_tall, _whitening, tilt_of_people
from pipeline.core.config import ADULT
from pipeline.optics.ground_plane import add_roll


def test_a_few_people_tell_the_tilt_as_well_as_they_say() -> None:
    random = np.random.default_rng(5)
    off, std = [], []
    while len(off) < 25:
        simulated = scene(random, int(random.integers(1, 4)))
        true_rad = simulated.plane.tilt_rad
        found = tilt_of_people(simulated.measured, ADULT)
        if found is not None:
            off.append((found.tilt_rad - true_rad) / found.std_rad)
            std.append(found.std_rad)
    # Of 25 that hold in 95 %, three deviations lower is 82 %.
    assert np.mean(np.abs(off) < 1.96) > 0.82
    assert np.sqrt(np.mean(np.square(off))) > 0.4  # and not by saying nothing
    assert np.median(std) < np.deg2rad(5.0)


def test_neither_scale_nor_mean_stature_count() -> None:
    simulated = scene(np.random.default_rng(7), 3, bad_share=0.0)
    others = replace(ADULT, mean_m=1.1 * ADULT.mean_m, std_m=1.1 * ADULT.std_m)
    found, again = (tilt_of_people(simulated.measured, p) for p in (ADULT, others))
    assert found is not None
    assert again is not None
    assert again.tilt_rad == pytest.approx(found.tilt_rad, rel=1e-9)
    assert again.std_rad == pytest.approx(found.std_rad, rel=1e-9)


def test_nobody_tells_nothing() -> None:
    simulated = scene(np.random.default_rng(7), 3)
    nobody = simulated.measured.take(simulated.measured.track_id < 0)
    assert tilt_of_people(nobody, ADULT) is None


def test_two_people_in_one_box_do_not_decide() -> None:
    simulated = scene(np.random.default_rng(23), 8, bad_share=0.0)
    m = simulated.measured.take(simulated.measured.track_id < 4)
    box = m.bbox_xyxy_px.copy()
    double = m.track_id == 1
    box[double, 1] -= 0.8 * (box[double, 3] - box[double, 1])
    found = tilt_of_people(replace(m, bbox_xyxy_px=box), ADULT)
    assert found is not None
    assert abs(found.tilt_rad - simulated.plane.tilt_rad) < 2 * found.std_rad
    assert found.std_rad < np.deg2rad(1.5)  # as their scatter would not let it be


def test_a_roll_is_not_taken_for_a_tilt() -> None:
    simulated = scene(np.random.default_rng(12), 8, bad_share=0.0)
    ids = np.unique(simulated.measured.track_id)
    level = sample_of(simulated.measured, ADULT, ids)
    ends = [add_roll(points, np.deg2rad(6.0)) for points in (level.foot, level.head)]
    rolled = replace(level, foot=ends[0], head=ends[1])
    none = np.zeros(len(level.track) + level.people)
    costs = [
        _cost_at(sample, simulated.plane.tilt_rad, _whitening(sample, 0.05), none)
        for sample in (level, rolled)
    ]
    assert costs[1] < costs[0] + 4.0
    off = _whitening(rolled, 0.05)(_log_tall(rolled, simulated.plane.tilt_rad))
    assert off @ off > costs[0] + 10.0  # which without an allowance it would be
