"""Heights from marks, against a scene that is projected by a pinhole camera."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pipeline.core.errors import UsageError
from pipeline.core.records import GroundPlane, Intrinsics
from pipeline.optics.pinhole import PinholeCamera
from pipeline.statement.marks import Mark, measure_marks, read_marks

LENS = Intrinsics(1280, 720, 1000.0, 1000.0, 639.5, 359.5)
POSE = GroundPlane(4.0, np.deg2rad(15.0), np.deg2rad(2.0))
UNSURE = replace(POSE, covariance=np.diag([0.2, np.deg2rad(0.3), np.deg2rad(0.3)]) ** 2)


def seen(x_m: float, ahead_m: float, up_m: float, pose: GroundPlane = POSE) -> tuple[float, float]:
    """Project a point of the ground's frame, up to the image by rotation of tilt and roll."""
    down = pose.camera_height_m - up_m
    sin, cos = np.sin(pose.tilt_rad), np.cos(pose.tilt_rad)
    y, z = down * cos - ahead_m * sin, ahead_m * cos + down * sin
    roll = pose.roll_rad
    turned = (x_m * np.cos(roll) + y * np.sin(roll), -x_m * np.sin(roll) + y * np.cos(roll), z)
    camera = PinholeCamera(LENS.fx_px, LENS.fy_px, LENS.cx_px, LENS.cy_px)
    point = camera.project(np.array(turned))
    return float(point[0]), float(point[1])


def mark(
    frame: int, x_m: float, ahead_m: float, height_m: float, what: str = "person", **values: str
) -> Mark:
    head, foot = seen(x_m, ahead_m, height_m), seen(x_m, ahead_m, 0.0)
    length_m = height_m if what == "reference" else float("nan")
    return Mark(frame, (*head, *foot), what=what, length_m=length_m, **values)


def test_roll_has_the_sign_of_the_rest_of_the_program() -> None:
    marked = measure_marks([mark(0, -3.0, 12.0, 1.8), mark(1, 4.0, 20.0, 1.8)], LENS, POSE)
    other = measure_marks(
        [mark(0, -3.0, 12.0, 1.8), mark(1, 4.0, 20.0, 1.8)],
        LENS,
        replace(POSE, roll_rad=-POSE.roll_rad),
    )
    assert abs(marked.height_m - 1.8) < abs(other.height_m - 1.8)


@pytest.mark.parametrize("height_m", [0.9, 1.55, 1.82, 2.05])
def test_heights_come_out_exactly(height_m: float) -> None:
    marks = [mark(i, -2.0 + i, 9.0 + 3 * i, height_m) for i in range(4)]
    found = measure_marks(marks, LENS, POSE)
    assert found.height_m == pytest.approx(height_m, abs=1e-6)
    assert found.pose_std_m == 0.0
    assert found.between_frames_std_m == pytest.approx(0.0, abs=1e-9)


def test_the_error_of_the_pose_is_what_redrawn_poses_give() -> None:
    rng = np.random.default_rng(1)
    marks = [mark(i, 1.0, 12.0 + i, 1.8) for i in range(3)]
    drawn = rng.multivariate_normal([4.0, POSE.tilt_rad, POSE.roll_rad], UNSURE.covariance, 4000)
    heights = [measure_marks(marks, LENS, GroundPlane(*pose)).height_m for pose in drawn]
    found = measure_marks(marks, LENS, UNSURE)
    assert found.pose_std_m == pytest.approx(np.std(heights), rel=0.05)


def test_a_reference_of_known_length_takes_the_scale_out() -> None:
    wrong = replace(UNSURE, camera_height_m=4.4)
    person = [mark(i, 1.0, 12.0 + i, 1.8) for i in range(3)]
    post = [mark(0, 2.0, 13.0, 2.1, "reference"), mark(0, 0.0, 13.5, 2.1, "reference")]
    without, beside = (measure_marks(m, LENS, wrong) for m in (person, person + post))
    assert without.height_m == pytest.approx(1.98, abs=0.01)
    assert beside.height_m == pytest.approx(1.8, abs=0.005)
    assert beside.pose_std_m < 0.2 * without.pose_std_m
    assert 0 < beside.scale_std_m < 0.05


def test_repeats_tell_the_error_of_the_marks() -> None:
    rng = np.random.default_rng(2)
    spread_px = 2.0
    errors, stated = [], []
    for _ in range(200):
        marks = []
        for frame in range(3):
            exact = np.array(mark(frame, 1.0, 14.0 + frame, 1.8).ends_px)
            for repeat in range(3):
                moved = exact + rng.normal(0, spread_px, 4)
                marks.append(Mark(frame, tuple(moved.tolist()), "A", str(repeat)))  # type: ignore[arg-type]
        found = measure_marks(marks, LENS, POSE)
        errors.append(found.height_m - 1.8)
        stated.append(found.marks_std_m)
    assert np.mean(stated) == pytest.approx(np.std(errors), rel=0.2)


def test_once_is_taken_for_a_usual_hand_and_said() -> None:
    found = measure_marks([mark(0, 1.0, 14.0, 1.8)], LENS, POSE)
    assert not found.repeated
    assert 0.01 < found.marks_std_m < 0.08


HEADER = "frame,head_x,head_y,foot_x,foot_y,by,repeat,what,length_m\n"


def test_a_file_of_marks_is_read(tmp_path: Path) -> None:
    path = tmp_path / "marks.csv"
    path.write_text(HEADER + '7,10,20,11,90,"Smith, A",1,person,\n8,10,20,11,95,,,reference,2.1\n')
    first, second = read_marks(path)
    assert first == replace(first, frame_index=7, ends_px=(10, 20, 11, 90), by="Smith, A")
    assert (second.what, second.length_m) == ("reference", 2.1)


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("frame,head_x\n1,2\n", "columns are missing: head_y, foot_x, foot_y"),
        (HEADER, "no marks"),
        (HEADER + "x,1,2,3,4,,,,\n", "line 2"),
        (HEADER + "1,nan,2,3,4,,,,\n", "outside of any picture"),
        (HEADER + "1,1,20,3,4,,,,\n", "the head is not above the feet"),
        (HEADER + "1,1,2,3,4,,,reference,\n", "needs its length_m"),
        (HEADER + "1,1,2,3,4,,,dog,\n", "must be person or reference"),
        (HEADER + "-1,1,2,3,4,,,,\n", "outside of any picture"),
    ],
)
def test_what_is_no_mark_is_refused_with_its_line(tmp_path: Path, text: str, problem: str) -> None:
    path = tmp_path / "marks.csv"
    path.write_text(text)
    with pytest.raises(UsageError, match=problem):
        read_marks(path)


def test_feet_above_the_horizon_are_refused() -> None:
    with pytest.raises(UsageError, match="no place on the ground"):
        measure_marks([Mark(0, (600, 10, 600, 60))], LENS, POSE)
