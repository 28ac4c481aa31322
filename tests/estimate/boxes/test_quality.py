"""Quality: what hides, cuts or distorts a box is flagged, weighed less, and never dropped."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.core.config import Config
from pipeline.core.records import GroundPlane
from pipeline.core.tables import OBSERVATION_QUALITY
from pipeline.estimate.boxes.gait_phase import stride_phase_rad
from pipeline.estimate.boxes.geometry import Geometry
from pipeline.estimate.boxes.quality import assess, with_track
from pipeline.estimate.fusion.fused import beside_track
from pipeline.estimate.methods import ground
from pipeline.estimate.types import Measured
from tests.estimate.scenes import measured, people

PLANE = GroundPlane(6.0, 0.25)


def frame(*boxes: tuple[float, float, float, float], std_px: float = 1.0) -> Measured:
    """Return boxes that are all in one frame, a track each."""
    n = len(boxes)
    return measured(
        np.array(boxes, dtype=np.float64),
        frame_index=np.zeros(n, np.int64),
        track_id=np.arange(n),
        std_xyxy_px=np.full((n, 4), std_px),
    )


def test_a_box_alone_is_as_good_as_it_can_be() -> None:
    m = frame((100, 100, 140, 200))
    found = assess(m)
    assert found.quality[0] == 1.0
    assert found.contact_visible[0]
    assert found.head_visible[0]
    assert found.aspect_plausible[0]
    assert found.alone[0]
    np.testing.assert_array_equal(found.std_xyxy_px, m.std_xyxy_px)


def test_feet_behind_a_nearer_box_are_less_sure_and_the_nearer_ones_are_not() -> None:
    """Drawn around all of the person, and drawn around what is seen of them."""
    nearer = (100, 150, 150, 270)
    for seen_to in (200, 150):
        m = frame((105, 80, 145, seen_to), nearer)
        found = assess(m)
        np.testing.assert_array_equal(found.contact_visible, [False, True])
        np.testing.assert_array_equal(found.head_visible, [True, True])
        # anywhere between what is seen and the nearer one's feet: at least 70 px, on one side
        assert found.std_xyxy_px[0, 3] == pytest.approx(70 / np.sqrt(3), rel=0.01)
        assert found.std_xyxy_px[0, 1] == 1.0
        assert found.quality[0] < 0.01
        assert found.quality[1] == 1.0


def test_side_by_side_nobody_hides_anybody() -> None:
    found = assess(frame((100, 100, 140, 200), (150, 100, 190, 201), (60, 99, 112, 202)))
    assert found.contact_visible.all()
    assert (found.quality > 0.9).all()


def test_all_of_somebody_behind_a_taller_box_is_hidden() -> None:
    found = assess(frame((110, 120, 140, 190), (90, 100, 160, 260)))
    assert not found.head_visible[0]
    assert not found.contact_visible[0]


def test_boxes_of_other_frames_hide_nothing() -> None:
    m = frame((105, 80, 145, 200), (100, 150, 150, 270))
    found = assess(replace(m, frame_index=np.array([3, 4])))
    assert found.contact_visible.all()


@given(st.integers(0, 2**32 - 1))
def test_frames_together_are_as_each_alone(seed: int) -> None:
    random = np.random.default_rng(seed)
    n = 40
    corner = random.uniform(0, 200, (n, 2))
    box = np.hstack([corner, corner + random.uniform([15, 40], [40, 120], (n, 2))])
    m = measured(box, frame_index=random.integers(0, 6, n), track_id=np.arange(n))
    found = assess(m)
    for one in np.unique(m.frame_index):
        mine = m.frame_index == one
        names = [k for k in m.__slots__ if isinstance(getattr(m, k), np.ndarray)]
        alone = assess(replace(m, **{k: getattr(m, k)[mine] for k in names}))
        np.testing.assert_allclose(found.std_xyxy_px[mine], alone.std_xyxy_px)
        np.testing.assert_array_equal(found.contact_visible[mine], alone.contact_visible)
    assert ((found.quality >= 0) & (found.quality <= 1)).all()
    assert (found.std_xyxy_px >= m.std_xyxy_px).all()


def test_what_the_picture_cuts_has_no_quality() -> None:
    cut = np.zeros((3, 4), bool)
    cut[0, 3] = cut[1, 1] = cut[2, 0] = True
    m = replace(frame((100, 100, 140, 200), (300, 0, 340, 90), (0, 0, 12, 90)), truncated=cut)
    found = assess(m)
    np.testing.assert_array_equal(found.contact_visible, [False, True, True])
    np.testing.assert_array_equal(found.head_visible, [True, False, True])
    np.testing.assert_array_equal(found.quality, [0.0, 0.0, 1.0])
    # half of a person is narrow: that is no oddity
    assert found.aspect_plausible.all()


def test_a_shape_that_no_person_has_counts_for_less() -> None:
    found = assess(frame((100, 100, 200, 190), (300, 100, 340, 200), (400, 100, 410, 190)))
    np.testing.assert_array_equal(found.aspect_plausible, [False, True, False])
    assert found.quality[0] < 0.1
    assert found.std_xyxy_px[0, 3] > 5


def test_a_shape_that_changes_suddenly_counts_for_less() -> None:
    box = np.tile([100.0, 100.0, 140.0, 200.0], (30, 1))
    box[12, 0] -= 55  # somebody joined for a moment, but no more than a person is wide
    m = measured(box, class_name=np.full(30, "unknown", dtype=object))
    np.testing.assert_array_equal(np.flatnonzero(~assess(m).aspect_plausible), [12])


def walk(n: int = 60) -> tuple[Measured, np.ndarray]:
    y_m = np.linspace(12, 20, n)
    box = people(np.linspace(-2, 2, n), y_m, np.full(n, 1.75), PLANE)
    box += [-15, 0, 15, 0]
    m = measured(box, ground_plane=PLANE, std_xyxy_px=np.full((n, 4), 1.0))
    return m, y_m * np.cos(PLANE.tilt_rad) + 6.0 * np.sin(PLANE.tilt_rad)


def wall_and_second_person() -> Measured:
    m, _ = walk()
    m.bbox_xyxy_px[20:25, 3] -= 0.3 * np.ptp(m.bbox_xyxy_px[20:25, 1::2], axis=1)
    m.bbox_xyxy_px[40:44, 1] -= 0.4 * np.ptp(m.bbox_xyxy_px[40:44, 1::2], axis=1)
    return m


def test_a_wall_and_a_second_person_show_without_any_pose() -> None:
    m = replace(wall_and_second_person(), ground_plane=None)
    found = assess(m)
    np.testing.assert_array_equal(np.flatnonzero(~found.contact_visible), np.arange(20, 25))
    np.testing.assert_array_equal(np.flatnonzero(~found.alone), np.arange(40, 44))
    np.testing.assert_array_equal(found.quality[:20], 1.0)
    # as far as the feet are missing, so unsure is the lower end, and the head is not
    missing = 0.3 / 0.7 * np.ptp(m.bbox_xyxy_px[20:25, 1::2], axis=1)
    np.testing.assert_allclose(found.std_xyxy_px[20:25, 3], missing, rtol=0.1)
    np.testing.assert_array_equal(found.std_xyxy_px[20:25, 1], 1.0)


def test_a_wall_and_a_second_person_show_beside_the_tracks_height() -> None:
    m = wall_and_second_person()
    clean = assess(walk()[0])  # as if the boxes alone told nothing
    track = beside_track(Geometry.of(m), ground.estimate(Geometry.of(m), Config()), clean)
    found = with_track(clean, track)
    np.testing.assert_array_equal(np.flatnonzero(~found.contact_visible), np.arange(20, 25))
    np.testing.assert_array_equal(np.flatnonzero(~found.alone), np.arange(40, 44))
    assert (found.quality[20:25] < 0.3).all()
    assert (found.quality[:20] == 1.0).all()


def test_every_method_weighs_hidden_feet_less_and_keeps_them() -> None:
    m, _ = walk(2)
    nearer = m.bbox_xyxy_px[[0]] + [-10, 60, 10, 90]
    both = replace(
        measured(np.vstack([m.bbox_xyxy_px[[0]], nearer])),
        ground_plane=PLANE,
        frame_index=np.zeros(2, np.int64),
        track_id=np.arange(2),
        std_xyxy_px=np.full((2, 4), 1.0),
    )
    plain = ground.estimate(Geometry.of(both), Config())
    judged = ground.estimate(Geometry.of(assess(both).applied(both)), Config())
    np.testing.assert_array_equal(judged.depth_m, plain.depth_m)
    assert judged.depth_std_m[0] > 10 * plain.depth_std_m[0]
    assert judged.depth_std_m[1] == plain.depth_std_m[1]


def test_the_table_is_the_one_that_is_stored() -> None:
    m = frame((100, 100, 140, 200), (300, 100, 340, 200))
    table = assess(m).table(m)
    assert table.schema == OBSERVATION_QUALITY
    assert table["observation_index"].to_pylist() == [0, 1]
    assert table["stride_phase_rad"].to_pylist() == [None, None]


def stepping(n: int, hz: float, swing: float, noise: float, seed: int = 0) -> Measured:
    """Return boxes whose width opens and closes, 10 frames a second."""
    random = np.random.default_rng(seed)
    time_s = np.arange(n) / 10
    share = 0.35 + swing * np.cos(2 * np.pi * hz * time_s - 1.0) + random.normal(0, noise, n)
    wide = 100 * share
    box = np.stack([300 - wide / 2, np.full(n, 100.0), 300 + wide / 2, np.full(n, 200.0)], axis=1)
    return measured(box, capture_time_ns=(time_s * 1e9).astype(np.int64))


@pytest.mark.parametrize("hz", [1.6, 1.9, 2.3])
def test_the_phase_of_a_step_is_found(hz: float) -> None:
    m = stepping(60, hz, 0.08, 0.01)
    truth = 2 * np.pi * hz * m.capture_time_ns / 1e9 - 1.0
    found = stride_phase_rad(m)
    assert np.isfinite(found).all()
    off = np.angle(np.exp(1j * (found - truth)))
    assert np.abs(off).max() < 0.7
    assert np.sqrt(np.mean(off**2)) < 0.3


def test_without_a_rhythm_there_is_no_phase() -> None:
    known = [
        np.isfinite(stride_phase_rad(stepping(30, 1.9, 0.0, 0.03, s))).any() for s in range(200)
    ]
    assert np.mean(known) < 0.03
    assert np.isnan(stride_phase_rad(stepping(8, 1.9, 0.08, 0.0))).all()  # too few


def passing(drawn_whole: bool) -> Measured:
    """Return somebody who walks past behind somebody else, who stands nearer."""
    n = 40
    middle = np.linspace(200, 400, n)
    box = np.column_stack([middle - 20, np.full(n, 150.0), middle + 20, np.full(n, 270.0)])
    nearer = np.tile([270.0, 190.0, 330.0, 340.0], (n, 1))
    covered = (middle + 10 > 270) & (middle - 10 < 330)
    if not drawn_whole:
        box[covered, 3] = 192.0  # where the nearer one begins
    return measured(
        np.vstack([box, nearer]),
        frame_index=np.tile(np.arange(n), 2),
        capture_time_ns=np.tile(np.arange(n) * 100_000_000, 2),
        track_id=np.repeat([0, 1], n),
        std_xyxy_px=np.full((2 * n, 4), 0.5),
    )


def test_a_covered_box_as_tall_as_its_track_says_has_visible_feet() -> None:
    whole, around = assess(passing(drawn_whole=True)), assess(passing(drawn_whole=False))
    assert whole.contact_visible[:40].all()
    np.testing.assert_allclose(whole.std_xyxy_px[:40, 3], 0.5, atol=0.1)
    behind = slice(17, 23)
    assert not around.contact_visible[behind].any()
    assert (around.std_xyxy_px[behind, 3] > 10).all()
