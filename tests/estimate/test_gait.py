"""From the height of a walker in the picture to that of the same person when standing."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.estimate.gait import GAIT_DROP_M, GAIT_DROP_STD_M, GAIT_STD_M, as_standing
from pipeline.estimate.types import Estimated
from tests.estimate.scenes import estimates, measured


def estimated(n: int) -> Estimated:
    return estimates(
        n,
        height_m=np.full(n, 1.7),
        height_std_m=np.full(n, 0.05),
        height_common_std_m=np.full(n, 0.03),
    )


def test_walkers_are_taller_when_they_stand_and_others_are_as_they_are_seen() -> None:
    names = np.array(["person"] * 6 + ["van"] * 3, dtype=object)
    m = measured(np.zeros((9, 4)), track_id=np.repeat([0, 1, 2], 3), class_name=names)
    speed = np.array([1.3, 1.2, np.nan, 0.1, 0.2, 0.9, 8.0, 8.0, 8.0])
    made = as_standing(m, estimated(9), speed, np.zeros(9, bool))
    np.testing.assert_allclose(made.height_m, [1.7 + GAIT_DROP_M] * 3 + [1.7] * 6)
    np.testing.assert_allclose(made.height_std_m[3:], 0.05)
    np.testing.assert_allclose(
        made.height_std_m[:3], np.sqrt(0.05**2 + GAIT_DROP_STD_M**2 + GAIT_STD_M**2)
    )
    # the drop is the person's own, the rise and fall the frame's
    assert made.height_common_std_m[0] == pytest.approx(np.hypot(0.03, GAIT_DROP_STD_M))


def test_a_prior_is_of_people_who_stand() -> None:
    m = measured(np.zeros((2, 4)))
    made = as_standing(m, estimated(2), np.array([1.3, 1.3]), np.array([True, False]))
    np.testing.assert_allclose(made.height_m, [1.7, 1.7 + GAIT_DROP_M])


def test_where_the_speed_is_unknown_nothing_is_added() -> None:
    m = measured(np.zeros((2, 4)))
    made = as_standing(m, estimated(2), np.full(2, np.nan), np.zeros(2, bool))
    np.testing.assert_allclose(made.height_m, 1.7)
