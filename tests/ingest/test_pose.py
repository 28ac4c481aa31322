"""The camera's pose by transforms: against the geometry that they were made of."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from pipeline.ingest.pose import MAX_FRAMES, TransformTree, UnusablePose, rotation_matrix
from pipeline.messages.content import Transform


def step(
    parent: str,
    child: str,
    translation: tuple[float, float, float] = (0, 0, 0),
    rotation: Rotation | None = None,
) -> Transform:
    x, y, z, w = (rotation or Rotation.identity()).as_quat()
    return Transform(parent, child, translation, (float(x), float(y), float(z), float(w)))


def camera_rotation(heading: float, tilt: float, roll: float) -> Rotation:
    """Return ground <- camera of a camera built up from its axes: level and ahead is +y."""
    level = Rotation.from_matrix(np.array([[1.0, 0, 0], [0, 0, 1.0], [0, -1.0, 0]]))
    turn = Rotation.from_euler("z", heading)
    # in the camera's frame: nodding down turns z towards y, about x; then the roll, about z
    return turn * level * Rotation.from_euler("x", -tilt) * Rotation.from_euler("z", roll)


angle = st.floats(-3, 3)


@given(angle, st.floats(-0.5, 1.5), st.floats(-1.5, 1.5), st.floats(0.1, 100.0), angle)
def test_height_tilt_and_roll_are_those_of_the_geometry(
    heading: float, tilt: float, roll: float, height_m: float, base: float
) -> None:
    tree = TransformTree()
    vehicle = Rotation.from_euler("z", base)
    mount = vehicle.inv() * camera_rotation(heading, tilt, roll)
    tree.add([step("map", "base_link", (4.0, -2.0, 0.25 * height_m), vehicle)])
    tree.add([step("base_link", "cam", (1.0, 0.5, 0.75 * height_m), mount)])
    pose = tree.pose("cam")
    assert pose is not None
    assert pose.height_m == pytest.approx(height_m)
    assert pose.tilt_rad == pytest.approx(tilt, abs=1e-9)
    assert pose.roll_rad == pytest.approx(roll, abs=1e-9)


@given(st.tuples(angle, angle, angle))
def test_the_matrix_is_scipys(angles: tuple[float, float, float]) -> None:
    rotation = Rotation.from_euler("xyz", angles)
    x, y, z, w = rotation.as_quat()
    assert rotation_matrix((x, y, z, w)) == pytest.approx(rotation.as_matrix(), abs=1e-12)


def test_the_nearest_convention_is_the_ground_and_a_camera_file_can_name_another() -> None:
    mount = camera_rotation(0, 0.3, 0)
    chain = [step("odom", "base_footprint", (0, 0, 9.0)), step("site", "odom", (0, 0, 1.0))]
    chain.append(step("base_footprint", "cam", (0, 0, 2.0), mount))
    tree, named = TransformTree(), TransformTree("site")
    tree.add(chain)
    named.add(chain)
    assert [
        (p.ground_frame, round(p.height_m, 9)) for t in (tree, named) if (p := t.pose("cam"))
    ] == [
        ("base_footprint", 2.0),
        ("site", 12.0),
    ]
    assert tree.pose("elsewhere") is None


@pytest.mark.parametrize(
    ("transforms", "word"),
    [
        ([step("base_link", "cam", (0, 0, 2))], "not known"),
        ([step("map", "cam", (0, 0, -2), camera_rotation(0, 0.3, 0))], "no camera over ground"),
        ([step("map", "cam_optical", (0, 0, 2))], "optical"),  # z up: not an optical frame
        ([step("a", "cam"), step("cam", "a")], "no end"),
    ],
)
def test_what_is_no_pose_is_said_to_be_none(transforms: list[Transform], word: str) -> None:
    tree = TransformTree()
    tree.add(transforms)
    with pytest.raises(UnusablePose, match=word):
        tree.pose(transforms[0].child)


def test_the_frames_are_bounded() -> None:
    tree = TransformTree()
    tree.add(step("map", str(number)) for number in range(MAX_FRAMES + 10))
    assert len(tree) == MAX_FRAMES


@given(angle, st.floats(-0.4, 1.0), st.floats(-0.5, 0.5))
def test_a_frame_of_the_body_is_recognised_and_gives_the_same_pose(
    heading: float, tilt: float, roll: float
) -> None:
    """REP 103: x ahead, y left, z up; its optical frame is turned by -90, 0, -90 degrees."""
    optical = camera_rotation(heading, tilt, roll)
    body = optical * Rotation.from_euler("xyz", (-90, 0, -90), degrees=True).inv()
    tree = TransformTree()
    tree.add(
        [step("map", "camera_link", (0, 0, 4.0), body), step("map", "cam", (0, 0, 4.0), optical)]
    )
    by_body, by_optical = tree.pose("camera_link"), tree.pose("cam")
    assert by_body is not None
    assert by_optical is not None
    assert (by_body.is_of_body, by_optical.is_of_body) == (True, False)
    assert by_body[:3] == pytest.approx((4.0, tilt, roll), abs=1e-9)


def test_a_frame_that_is_named_optical_is_taken_at_its_word() -> None:
    up = camera_rotation(0, -0.9, 0)
    tree = TransformTree()
    tree.add([step("map", "cam_optical_frame", (0, 0, 4.0), up)])
    pose = tree.pose("cam_optical_frame")
    assert pose is not None
    assert (pose.tilt_rad, pose.is_of_body) == (pytest.approx(-0.9), False)
