import warnings
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.core.config import Config
from pipeline.core.errors import UndecodableImage
from pipeline.images.decode import Picture
from pipeline.measure.blur.expected import Declined
from pipeline.measure.blur.widths import MAX_BOXES, expected, measure, measure_frame, unmeasured
from tests.measure.blur.scenes import BOX, FAST, SURVEILLANCE, boxes, square

CONFIG = Config()
EVERY = np.ones(1, dtype=bool)


def measured(picture, box=BOX):
    blur = measure(picture, boxes(box), EVERY, FAST, CONFIG, "cam")
    return blur.sigma_px[0], blur.std_px[0], blur.reason[0]


@pytest.mark.parametrize("sigma", [1.0, 1.8, 3.0, 5.5, 9.0])
def test_widths_of_one_to_nine_pixels_are_found_at_their_own_level(sigma):
    found, std, reason = measured(square(sigma, noise=0.003))
    assert reason is None
    assert found == pytest.approx(sigma, rel=0.02)
    assert 0 < std < 0.05 * sigma
    assert abs(found - sigma) < 4 * std


def test_dark_on_light_is_measured_like_light_on_dark():
    light, *_ = measured(square(3.0))
    dark, *_ = measured(square(3.0, light=0.1, dark=0.6))
    assert dark == pytest.approx(light, rel=0.01)


def test_a_picture_without_edges_says_so():
    found, _, reason = measured(square(3.0, light=0.3, dark=0.3, noise=0.01))
    assert np.isnan(found)
    assert reason is Declined.NO_EDGES


def test_clipped_light_is_no_edge():
    # The light side is beyond white: what is left of the edge is narrower than it was.
    found, _, reason = measured(square(3.0, light=1.6))
    assert np.isnan(found)
    assert reason is Declined.NO_EDGES


def test_blur_over_most_of_an_object_is_refused():
    small = np.array([130.0, 130.0, 180.0, 180.0])
    _, _, reason = measured(square(7.0, box=small), small)
    assert reason in (Declined.TOO_WIDE, Declined.NO_EDGES)


@pytest.mark.parametrize("length", [5.0, 8.0])
def test_motion_is_told_from_blur_by_the_direction_of_the_edges(length):
    sideways = np.sqrt(2.0**2 + length**2 / 12)
    _, _, reason = measured(square(2.0, sideways_px=sideways, noise=0.002))
    assert reason is Declined.MOTION


def test_pixels_that_are_not_square_count_in_the_mean_pitch():
    # Drawn in square pixels, then every second column left out: widths across are halved.
    whole = square(4.0, turn=0.0)
    lens = replace(FAST, pixel_pitch_x_um=2 * FAST.pixel_pitch_x_um)
    box = BOX * [0.5, 1, 0.5, 1]
    blur = measure(np.ascontiguousarray(whole[:, ::2]), boxes(box), EVERY, lens, CONFIG, "cam")
    assert blur.sigma_px[0] == pytest.approx(4.0 / np.sqrt(2), rel=0.05)


def test_what_stands_in_front_does_not_lend_its_edges():
    picture = square(4.0)
    front = np.array([90.0, 150.0, 150.0, 280.0])
    sharp = square(1.0, box=front, turn=0.0)[145:285, 85:155]
    picture[145:285, 85:155] = sharp
    alone = measure(picture, boxes(BOX), EVERY, FAST, CONFIG, "cam")
    both = measure(picture, boxes(BOX, front), np.array([True, False]), FAST, CONFIG, "cam")
    assert both.sigma_px[0] == pytest.approx(4.0, rel=0.03)
    assert both.edge_count[0] < alone.edge_count[0]
    assert both.reason[1] is Declined.UNRESOLVABLE


def test_a_crowd_is_measured_up_to_a_number():
    many = [np.array([10.0 + i, 10.0, 60.0 + i, 60.0 + i]) for i in range(MAX_BOXES + 3)]
    blur = measure(square(2.0), boxes(*many), np.ones(len(many), dtype=bool), FAST, CONFIG, "cam")
    assert blur.reason.count(Declined.TOO_MANY) == 3
    assert [blur.reason[i] for i in range(3)] == [Declined.TOO_MANY] * 3  # the smallest


def blur_of(picture, given, lens, config, camera, decode):
    """Do what pass 1 does with a frame."""
    worth = expected(given, lens, config, camera)
    if not worth.any():
        return unmeasured(len(given), lens)
    return measure_frame(picture, given, worth, lens, config, camera, decode)


def picture_of(bgr, reduction):
    height, width = bgr.shape[:2]
    return Picture(width, height, bgr[::reduction, ::reduction], reduction, 0.2, 0.0)


def no_decoding():
    raise AssertionError("no picture may be decoded for this")


def test_a_lens_that_cannot_tell_costs_no_pixel():
    blur = blur_of(
        picture_of(square(2.0), 2),
        boxes(BOX, name="person"),
        SURVEILLANCE,
        CONFIG,
        "c",
        no_decoding,
    )
    assert blur.reason == (Declined.UNRESOLVABLE,)


def test_an_unknown_lens_costs_no_pixel():
    for unknown in ("f_number", "focal_length_mm", "focus_distance_m", "pixel_pitch_x_um"):
        lens = replace(FAST, **{unknown: np.nan})
        blur = blur_of(picture_of(square(2.0), 2), boxes(BOX), lens, CONFIG, "c", no_decoding)
        assert blur.reason == (Declined.LENS_UNKNOWN,)


def test_a_reduced_picture_is_decoded_again_at_its_stored_size():
    whole = square(2.5)
    blur = blur_of(
        picture_of(whole, 4), boxes(BOX), FAST, CONFIG, "c", lambda: picture_of(whole, 1)
    )
    assert blur.sigma_px[0] == pytest.approx(2.5, rel=0.02)


def test_a_picture_that_cannot_be_decoded_whole_is_said_so():
    def damaged():
        raise UndecodableImage("cut off")

    blur = blur_of(picture_of(square(2.5), 4), boxes(BOX), FAST, CONFIG, "c", damaged)
    assert blur.reason == (Declined.NO_PICTURE,)


def test_no_boxes_no_blur():
    blur = blur_of(None, boxes(), FAST, CONFIG, "c", no_decoding)
    assert len(blur.sigma_px) == 0
    assert blur.reason == ()


def test_what_is_expected_depends_on_size_and_lens():
    small, large = np.array([0.0, 0, 20, 60]), np.array([0.0, 0, 200, 400])
    # A person 400 px of 20 um tall before 50 mm is 10 m away: f/1.8 blurs by 7 px, f/16 by less than 1.
    people = boxes(small, large, name="person")
    assert expected(people, FAST, CONFIG, "cam").tolist() == [False, True]
    assert not expected(people, replace(FAST, f_number=16.0), CONFIG, "cam").any()


PICTURE = picture_of(square(2.0), 1)
NUMBERS = st.floats(-1e4, 1e4) | st.sampled_from([0.0, np.nan, np.inf, -np.inf, 299.5, 1e12])


@settings(max_examples=60, deadline=None)
@given(st.lists(st.tuples(NUMBERS, NUMBERS, NUMBERS, NUMBERS), min_size=1, max_size=4))
def test_whatever_a_box_is_it_gets_a_blur_or_a_reason(rows):
    given_boxes = boxes(*np.array(rows, dtype=float))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        blur = blur_of(PICTURE, given_boxes, FAST, CONFIG, "c", no_decoding)
    for sigma, reason in zip(blur.sigma_px, blur.reason, strict=True):
        assert (reason is None) == np.isfinite(sigma)


@given(st.integers(1, 60), st.integers(1, 60))
def test_pictures_of_any_size_are_looked_at(width, height):
    bgr = np.zeros((height, width, 3), np.uint8)
    blur = blur_of(picture_of(bgr, 1), boxes(BOX), FAST, CONFIG, "c", no_decoding)
    assert blur.reason[0] is not None
