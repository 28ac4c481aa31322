"""Segments of known length: what a pose makes of them, beside points that are projected."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.calibrate.walkers.segments import IMPOSSIBLE, Segments
from pipeline.core.arrays import FloatArray
from pipeline.core.records import GroundPlane, Intrinsics, KnownLength

LENS = Intrinsics(1280, 720, 1000.0, 1000.0, 639.5, 359.5)
POSE = (4.0, 0.35, 0.06)  # height in metres, tilt, roll


def pixels(points_m: FloatArray) -> FloatArray:
    """Return where a camera sees points (right, ahead, up), (n, 3), by rotation matrices."""
    above_m, tilt, roll = POSE
    level = np.stack([points_m[:, 0], above_m - points_m[:, 2], points_m[:, 1]], axis=1)  # y down
    c, s = np.cos(tilt), np.sin(tilt)
    tilted = level @ np.array([[1, 0, 0], [0, c, -s], [0, s, c]]).T
    c, s = np.cos(roll), np.sin(roll)
    x, y, z = (tilted @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]]).T).T
    return np.stack([LENS.fx_px * x / z + LENS.cx_px, LENS.fy_px * y / z + LENS.cy_px], axis=1)


def known(points_m: FloatArray, *, upright: bool, std_px: float = 0.5) -> KnownLength:
    """Return what is known of a segment between two points."""
    length_m = float(np.linalg.norm(points_m[1] - points_m[0]))
    return KnownLength(tuple(pixels(points_m).ravel()), length_m, 0.0, std_px, upright)


SEGMENTS = {
    "across": (np.array([[-1.0, 9.0, 0.0], [1.5, 9.0, 0.0]]), False),
    "away": (np.array([[0.4, 7.0, 0.0], [0.1, 12.0, 0.0]]), False),
    "post": (np.array([[1.0, 11.0, 0.0], [1.0, 11.0, 2.4]]), True),
    "kerb stone": (np.array([[-2.0, 8.0, 0.0], [-2.0, 8.0, 0.5]]), True),
}


@pytest.mark.parametrize("kind", SEGMENTS)
def test_the_true_pose_gives_the_true_length(kind: str) -> None:
    points_m, upright = SEGMENTS[kind]
    length = known(points_m, upright=upright)
    segments = Segments.of((length,), LENS)
    assert segments.found_m(*POSE) == pytest.approx([length.length_m], rel=1e-9)
    assert segments.off(*POSE) == pytest.approx([0.0], abs=1e-6)


@pytest.mark.parametrize("kind", SEGMENTS)
def test_marks_are_off_by_as_much_as_is_stated(kind: str) -> None:
    """Marks that are half a pixel off, a thousand times: the errors have a deviation of about one."""
    points_m, upright = SEGMENTS[kind]
    length = known(points_m, upright=upright)
    random = np.random.default_rng(2)
    marked = [
        KnownLength(
            tuple(np.array(length.points_px) + random.normal(0, 0.5, 4)),
            length.length_m,
            length.std_m,
            length.std_px,
            upright,
        )
        for _ in range(1000)
    ]
    spread = float(Segments.of(tuple(marked), LENS, GroundPlane(*POSE)).off(*POSE).std())
    assert spread == pytest.approx(1.0, abs=0.08)  # three deviations of a deviation of a thousand
    roughly = float(Segments.of(tuple(marked), LENS).off(*POSE).std())
    assert 0.5 < roughly < 1.3  # no pose being known


def test_the_survey_counts_beside_the_marks() -> None:
    points_m, upright = SEGMENTS["post"]
    sure = Segments.of((known(points_m, upright=upright, std_px=1e-6),), LENS)
    assert sure.std == pytest.approx([0.0], abs=1e-6)
    length = KnownLength(tuple(pixels(points_m).ravel()), 2.4, 0.12, 1e-6, upright)
    assert Segments.of((length,), LENS).std == pytest.approx([0.05], rel=1e-6)


def test_a_foot_above_the_horizon_is_far_off_and_pulls_nowhere() -> None:
    length = KnownLength((600.0, 10.0, 600.0, 5.0), 2.0, upright=True)
    segments = Segments.of((length,), LENS)
    assert segments.off(4.0, 0.05, 0.0).tolist() == [IMPOSSIBLE]
    assert not segments.off_jacobian(4.0, 0.05, 0.0).any()


def test_without_a_lens_nothing_is_known() -> None:
    length = KnownLength((600.0, 410.0, 600.0, 5.0), 2.0, upright=True)
    assert len(Segments.of((length,), None)) == 0
