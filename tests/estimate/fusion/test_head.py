"""Boxes too short for their track: the direction of the track decides which end is missing."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.estimate.fusion.head import _way
from pipeline.estimate.fusion.kalman import ACCELERATION_DENSITY
from tests.estimate.fusion.test_fused import estimated, walk
from tests.estimate.scenes import measured


def shortened(edge: int, share: float = 0.3) -> tuple:
    """Return estimates of a walk whose boxes lack one end for two seconds, the truth, and when."""
    box, depth_m = walk(noise_px=0.5)
    gone = slice(20, 40)
    tall_px = box[gone, 3] - box[gone, 1]
    box[gone, edge] += (share if edge == 1 else -share) * tall_px
    _, found = estimated(box)
    return found, depth_m, gone


@pytest.mark.parametrize("edge", [1, 3])
def test_a_missing_head_and_missing_feet_both_leave_the_place(edge: int) -> None:
    found, depth_m, gone = shortened(edge)
    error_m = np.abs(found.depth_m - depth_m)
    assert error_m.max() < 0.3
    assert (error_m[gone] < 3 * found.depth_std_m[gone]).all()
    assert found.height_assumed[gone].all()


def test_where_nothing_tells_which_end_the_interval_holds_both() -> None:
    box, depth_m = walk(noise_px=0.5)
    # whole at first, then never again: two seconds on nobody knows where they went
    box[40:, 3] -= 0.3 * (box[40:, 3] - box[40:, 1])
    _, found = estimated(box)
    assert (np.abs(found.depth_m - depth_m) < 2.5 * found.depth_std_m).all()


def test_the_way_between_known_places_strays_as_a_random_walk_of_the_velocity_does() -> None:
    """By simulation of the walk itself."""
    random = np.random.default_rng(3)
    n, walks, step_s = 21, 4000, 0.1
    kicks = random.normal(0, np.sqrt(ACCELERATION_DENSITY * step_s), (walks, n))
    place_m = np.cumsum(np.cumsum(kicks, axis=1) * step_s, axis=1)
    known = place_m.copy()
    known[:, 1:-1] = np.nan
    m = measured(
        np.zeros((walks * n, 4)),
        track_id=np.repeat(np.arange(walks), n),
        capture_time_ns=np.tile(np.arange(n) * 100_000_000, walks),
    )
    way_m, std_m = _way(m, known.reshape(-1), np.zeros(walks * n))
    off_m = (way_m.reshape(walks, n) - place_m)[:, 1:-1]
    np.testing.assert_allclose(off_m.std(axis=0), std_m.reshape(walks, n)[0, 1:-1], rtol=0.08)
