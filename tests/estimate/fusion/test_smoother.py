"""The smoother against the closed form: the posterior of a linear Gaussian model, in one matrix."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.estimate.fusion import smoother
from pipeline.estimate.fusion.kalman import ACCELERATION_DENSITY, FAR_M, SPEED_STD_M_S
from pipeline.estimate.fusion.smoother import DEGREES_OF_FREEDOM, REWEIGHTINGS, smooth_tracks

NEAR_M = 30.0  # near enough for one large matrix to be inverted well


def by_one_matrix(time_s: np.ndarray, seen: np.ndarray, noise: np.ndarray) -> tuple:
    """Condition the joint normal of all states on all observations at once."""
    n = len(time_s)
    joint = np.zeros((4 * n, 4 * n))
    joint[:4, :4] = np.diag([NEAR_M**2, NEAR_M**2, SPEED_STD_M_S**2, SPEED_STD_M_S**2])
    for k in range(1, n):
        dt = time_s[k] - time_s[k - 1]
        move = np.eye(4)
        move[0, 2] = move[1, 3] = dt
        one = np.array([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]]) * ACCELERATION_DENSITY
        driven = np.kron(one, np.eye(2))
        joint[4 * k : 4 * k + 4, : 4 * k] = move @ joint[4 * k - 4 : 4 * k, : 4 * k]
        joint[: 4 * k, 4 * k : 4 * k + 4] = joint[4 * k : 4 * k + 4, : 4 * k].T
        before = joint[4 * k - 4 : 4 * k, 4 * k - 4 : 4 * k]
        joint[4 * k : 4 * k + 4, 4 * k : 4 * k + 4] = move @ before @ move.T + driven
    look = np.kron(np.eye(n), np.eye(2, 4))
    r = np.zeros((2 * n, 2 * n))
    for k in range(n):
        r[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] = noise[k]
    gain = joint @ look.T @ np.linalg.inv(look @ joint @ look.T + r)
    prior = np.tile([*seen[0], 0.0, 0.0], n)  # only the first position of it counts, and hardly
    mean = prior + gain @ (seen.ravel() - look @ prior)
    after = joint - gain @ look @ joint
    spread = np.array([after[4 * k : 4 * k + 2, 4 * k : 4 * k + 2] for k in range(n)])
    return mean.reshape(n, 4), spread


@given(st.integers(0, 2**32 - 1), st.integers(2, 9))
def test_it_is_the_posterior_of_the_model(seed: int, count: int) -> None:
    random = np.random.default_rng(seed)
    time_s = np.cumsum(random.uniform(0.05, 0.6, count))
    seen = np.cumsum(random.normal(0, 0.3, (count, 2)), axis=0)
    half = random.normal(0, 0.3, (count, 2, 2))
    noise = half @ half.swapaxes(1, 2) + 0.02 * np.eye(2)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(smoother, "REWEIGHTINGS", 1)
        found = smooth_tracks(np.zeros(count, np.int64), time_s, seen, noise)
    mean, spread = by_one_matrix(time_s, seen, noise)
    np.testing.assert_allclose(found.position_m, mean[:, :2], atol=2e-4)
    np.testing.assert_allclose(found.velocity_m_s, mean[:, 2:], atol=2e-3)
    np.testing.assert_allclose(found.covariance, spread, atol=2e-4)


def by_the_book(time_s: np.ndarray, seen: np.ndarray, noise: np.ndarray) -> tuple:
    """Filter and smooth one track, one observation after another, in matrices of four by four."""
    n, look = len(time_s), np.eye(2, 4)
    weight = np.ones(n)
    known = np.isfinite(seen).all(axis=1)
    for _ in range(REWEIGHTINGS):
        ahead, after = [], []
        x = np.array([*np.nan_to_num(seen[0]), 0.0, 0.0])
        p = np.diag([FAR_M**2, FAR_M**2, SPEED_STD_M_S**2, SPEED_STD_M_S**2])
        for k in range(n):
            if k:
                move, driven = motion_over(time_s[k] - time_s[k - 1])
                x, p = move @ x, move @ p @ move.T + driven
            ahead.append((x, p))
            if known[k]:
                r = noise[k] / weight[k]
                gain = np.linalg.solve(look @ p @ look.T + r, look @ p).T
                kept = np.eye(4) - gain @ look
                x, p = x + gain @ (seen[k] - look @ x), kept @ p @ kept.T + gain @ r @ gain.T
            after.append((x, p))
        smooth = [after[-1]]
        for k in range(n - 2, -1, -1):
            move, _ = motion_over(time_s[k + 1] - time_s[k])
            back = np.linalg.solve(ahead[k + 1][1], move @ after[k][1]).T
            x = after[k][0] + back @ (smooth[-1][0] - ahead[k + 1][0])
            p = after[k][1] + back @ (smooth[-1][1] - ahead[k + 1][1]) @ back.T
            smooth.append((x, p))
        state = np.array([x for x, _ in smooth[::-1]])
        spread = np.array([p for _, p in smooth[::-1]])
        off = np.where(known[:, None], seen - state[:, :2], 0.0)
        far = np.array([d @ np.linalg.solve(r, d) for d, r in zip(off, noise, strict=True)])
        fits = (DEGREES_OF_FREEDOM + 2) / (DEGREES_OF_FREEDOM + far)
        weight = np.where(known, np.minimum(fits, 1.0), 1.0)
    return state, spread, weight


def motion_over(dt: float) -> tuple[np.ndarray, np.ndarray]:
    one = np.array([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]]) * ACCELERATION_DENSITY
    return np.kron([[1.0, dt], [0.0, 1.0]], np.eye(2)), np.kron(one, np.eye(2))


@given(st.integers(0, 2**32 - 1), st.integers(1, 30), st.booleans())
def test_it_is_the_filter_of_the_book(seed: int, count: int, coupled: bool) -> None:
    random = np.random.default_rng(seed)
    time_s = np.cumsum(random.uniform(0.02, 0.5, count))
    seen = np.cumsum(random.normal(0, 0.3, (count, 2)), axis=0)
    seen[1:][random.random(count - 1) < 0.2] = np.nan
    if coupled:  # along the line of sight, and hardly across
        ray = np.array([random.uniform(-0.6, 0.6), 1.0]) * random.uniform(0.05, 2.0, (count, 1))
        noise = ray[:, :, None] * ray[:, None, :] + np.diag([1e-3, 1e-5])
    else:
        noise = random.uniform(1e-3, 1.0, (count, 2, 1)) * np.eye(2)
    found = smooth_tracks(np.zeros(count, np.int64), time_s, seen, noise)
    state, spread, weight = by_the_book(time_s, seen, noise)
    np.testing.assert_allclose(found.position_m, state[:, :2], rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(found.velocity_m_s, state[:, 2:], rtol=1e-9, atol=1e-8)
    np.testing.assert_allclose(found.covariance, spread[:, :2, :2], rtol=1e-8, atol=1e-9)
    of_velocity = (spread[:, 2, 2] + spread[:, 3, 3]) / 2
    np.testing.assert_allclose(found.velocity_variance, of_velocity, rtol=1e-8)
    np.testing.assert_allclose(found.weight, weight, rtol=1e-7)


def walks(random: np.random.Generator, tracks: int) -> tuple:
    parts = []
    for t in range(tracks):
        n = int(random.integers(2, 80))
        time_s = np.arange(n) * 0.1
        speed = random.normal(0, 1, 2)
        truth = random.uniform(-20, 20, 2) + time_s[:, None] * speed
        parts.append((np.full(n, t), time_s, truth))
    track, time_s, truth = (np.concatenate(p) for p in zip(*parts, strict=True))
    shuffled = random.permutation(len(track))
    return track[shuffled], time_s[shuffled], truth[shuffled]


def test_many_tracks_together_are_as_each_alone() -> None:
    random = np.random.default_rng(0)
    track, time_s, truth = walks(random, 12)
    noise = np.broadcast_to(np.diag([0.3, 0.1]), (len(track), 2, 2))
    seen = truth + random.normal(size=truth.shape) * np.sqrt([0.3, 0.1])
    together = smooth_tracks(track, time_s, seen, noise)
    for t in range(12):
        mine = track == t
        alone = smooth_tracks(track[mine], time_s[mine], seen[mine], noise[mine])
        np.testing.assert_allclose(together.position_m[mine], alone.position_m, atol=1e-9)
        np.testing.assert_allclose(together.covariance[mine], alone.covariance, atol=1e-9)


def test_batches_change_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    random = np.random.default_rng(1)
    track, time_s, truth = walks(random, 9)
    noise = np.broadcast_to(np.eye(2), (len(track), 2, 2))
    whole = smooth_tracks(track, time_s, truth, noise)
    monkeypatch.setattr(smoother, "BATCH", 60)
    parts = smooth_tracks(track, time_s, truth, noise)
    np.testing.assert_allclose(parts.position_m, whole.position_m, atol=1e-9)


def test_it_is_better_than_what_went_in_and_knows_how_good_it_is() -> None:
    random = np.random.default_rng(2)
    track, time_s, truth = walks(random, 300)
    noise = np.broadcast_to(np.diag([0.25, 0.04]), (len(track), 2, 2))
    error = random.normal(size=truth.shape) * [0.5, 0.2]
    found = smooth_tracks(track, time_s, truth + error, noise)
    left = found.position_m - truth
    assert np.std(left[:, 0]) < 0.6 * 0.5
    z = left / np.sqrt(np.diagonal(found.covariance, axis1=1, axis2=2))
    assert 0.93 < np.mean(np.abs(z) < 1.96) <= 1.0


def test_outliers_weigh_little_and_gaps_are_bridged() -> None:
    time_s = np.arange(60) * 0.1
    truth = np.column_stack([1.2 * time_s, 20 - 0.5 * time_s])
    seen = truth + np.random.default_rng(3).normal(0, 0.1, truth.shape)
    seen[20:24] += [0.0, 6.0]
    seen[40:50] = np.nan
    noise = np.broadcast_to(0.01 * np.eye(2), (60, 2, 2))
    found = smooth_tracks(np.zeros(60, np.int64), time_s, seen, noise)
    assert (found.weight[20:24] < 0.05).all()
    assert np.median(found.weight[:20]) > 0.6
    np.testing.assert_allclose(found.position_m, truth, atol=0.35)
    assert found.covariance[45, 0, 0] > 3 * found.covariance[10, 0, 0]


def test_a_single_observation_stays_as_it_is() -> None:
    noise = np.diag([0.2, 0.3])[None]
    found = smooth_tracks(np.zeros(1, np.int64), np.zeros(1), np.array([[3.0, 4.0]]), noise)
    np.testing.assert_allclose(found.position_m, [[3.0, 4.0]], atol=1e-6)
    np.testing.assert_allclose(found.covariance, noise, rtol=1e-3)
    nobody = smooth_tracks(
        np.empty(0, np.int64), np.empty(0), np.empty((0, 2)), np.empty((0, 2, 2))
    )
    assert len(nobody.position_m) == 0
