"""The camera that the estimates use, of intrinsics as they were recorded."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.core.records import Intrinsics
from pipeline.estimate.boxes.ends import camera_of


def recorded(model: str, distortion: tuple[float, ...]) -> Intrinsics:
    return Intrinsics(640, 480, 500.0, 500.0, 320.0, 240.0, model, distortion)


@pytest.mark.parametrize(
    ("model", "distortion"),
    [("panini", (0.1,)), ("fisheye", (0.1,) * 6), ("plumb_bob", (np.inf,))],
)
def test_a_distortion_of_no_use_is_left_out(model: str, distortion: tuple[float, ...]) -> None:
    camera = camera_of(recorded(model, distortion))
    np.testing.assert_allclose(camera.normalize([820.0, 240.0]), [1.0, 0.0])


def test_a_distortion_of_use_is_kept() -> None:
    camera = camera_of(recorded("plumb_bob", (-0.1, 0.0, 0.0, 0.0, 0.0)))
    assert camera.normalize([820.0 - 50.0, 240.0])[0] == pytest.approx(1.0)
