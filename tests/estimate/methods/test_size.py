from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.core.calibration import CalibratedMethod, Calibration, Dimension, Parameter
from pipeline.core.config import ADULT, CameraConfig, Config, SizePrior
from pipeline.core.records import GroundPlane, Intrinsics
from pipeline.estimate.boxes.geometry import Geometry
from pipeline.estimate.methods import size
from tests.estimate.scenes import VGA, lens, measured, people

CAR = SizePrior("person", Dimension.WIDTH, 1.8, 0.1)
STAFF = Calibration(
    CalibratedMethod.SIZE,
    "person",
    Dimension.WIDTH,
    (Parameter("object_size_m", 0.06, 0.001), Parameter("residual_relative", 0.02)),
)
tilts = st.floats(0.0, 0.9)


def exact(tilt, roll=0.0, std=0.0):
    return GroundPlane(6.0, tilt, roll, np.diag([0.0, std**2, 0.0]))


def level_box(width_px, height_px=100.0):
    return np.array([[600.0, 300.0, 600.0 + width_px, 300.0 + height_px]])


@given(st.floats(5, 40), st.floats(-3, 3), tilts, st.floats(-0.1, 0.1))
@settings(deadline=None)
def test_a_person_of_the_mean_height_is_found_where_he_stands(y_m, x_m, tilt, roll):
    plane = exact(tilt, roll)
    box = people(np.array([x_m]), np.array([y_m]), np.array([ADULT.mean_m]), plane)
    if roll:  # an upright box of a leaning person has its foot and head in one column
        x_m, box = 0.0, people(np.zeros(1), np.array([y_m]), np.array([ADULT.mean_m]), exact(tilt))
        plane = exact(tilt)
    found = size.estimate(Geometry.of(measured(box, ground_plane=plane)), Config())
    depth_m = y_m * math.cos(tilt) + 6.0 * math.sin(tilt)
    # foot and head of someone off the axis are not in one column of a tilted camera: second order
    assert found.depth_m[0] == pytest.approx(depth_m, rel=2e-2 if x_m else 1e-9)
    assert found.height_m[0] == ADULT.mean_m
    assert found.height_std_m[0] == ADULT.any_std_m
    assert found.height_assumed[0]
    assert found.y_m[0] == pytest.approx(y_m, rel=3e-2 if x_m else 1e-6)


def test_range_is_to_the_middle_of_the_person():
    plane = exact(0.2)
    box = people(np.zeros(1), np.array([12.0]), np.array([ADULT.mean_m]), plane)
    found = size.estimate(Geometry.of(measured(box, ground_plane=plane)), Config())
    assert found.range_m[0] == pytest.approx(math.hypot(12.0, 6.0 - ADULT.mean_m / 2))


def test_distortion_is_removed():
    bent = Intrinsics(1280, 720, 1200.0, 1190.0, 640.0, 350.0, "plumb_bob", (-0.3, 0.1, 0, 0, 0))
    plane = exact(0.1)
    y_m = np.array([14.0])
    box = people(np.zeros(1), y_m, np.array([ADULT.mean_m]), plane, bent)
    right = size.estimate(Geometry.of(measured(box, ground_plane=plane, intrinsics=bent)), Config())
    wrong = size.estimate(Geometry.of(measured(box, ground_plane=plane)), Config())
    depth_m = 14.0 * math.cos(0.1) + 6.0 * math.sin(0.1)
    assert right.depth_m[0] == pytest.approx(depth_m, rel=1e-6)
    assert abs(wrong.depth_m[0] / depth_m - 1) > 0.01


@pytest.mark.parametrize(
    ("tilt_std", "spread_m", "edge_px", "y_f"),
    [
        (0.02, 0.09, 1.5, 0.05),
        (None, 0.09, 1.5, 0.05),
        # one source of error at a time, far from the axis
        (0.02, 1e-6, 0.0, 0.6),
        (0.02, 1e-6, 0.0, -0.15),
        (None, 1e-6, 0.0, 0.6),
        (0.0, 1e-6, 1.5, 0.6),
    ],
)
def test_the_stated_deviation_is_that_of_the_errors(tilt_std, spread_m, edge_px, y_f):
    rng = np.random.default_rng(4)
    n = 40_000
    prior = SizePrior("person", Dimension.HEIGHT, 1.68, spread_m)
    if tilt_std is not None:
        tilt = 0.45 + rng.normal(0, tilt_std, n)
        plane = exact(0.45, std=tilt_std)
    else:
        tilt = rng.uniform(0, math.radians(30), n)
        plane = None
    tall_m = rng.normal(prior.mean_m, spread_m, n)
    depth_m = 12.0
    y_h = (depth_m * y_f - tall_m * np.cos(tilt)) / (depth_m - tall_m * np.sin(tilt))
    ends = np.stack([y_h, np.full(n, y_f)], axis=1) * VGA.fy_px + VGA.cy_px
    ends += rng.normal(0, edge_px, (n, 2))
    middle = np.full(n, 640.0)
    box = np.stack([middle, ends[:, 0], middle, ends[:, 1]], axis=1)
    rows = measured(box, ground_plane=plane, std_xyxy_px=np.full((n, 4), edge_px))
    found = size.estimate(Geometry.of(rows), Config(size_prior=(prior,)))
    z = (found.depth_m - depth_m) / found.depth_std_m
    assert abs(z.mean()) < 0.15
    assert z.std() == pytest.approx(1.0, abs=0.08)


def test_ignorance_of_the_tilt_widens_and_a_camera_file_ends_it():
    box = level_box(40.0)
    unknown = size.estimate(Geometry.of(measured(box)), Config())
    level = Config(camera=(CameraConfig("cam", tilt_deg=0.0),))
    known = size.estimate(Geometry.of(measured(box)), level)
    assert unknown.depth_std_m[0] > known.depth_std_m[0]
    assert known.depth_m[0] == pytest.approx(ADULT.mean_m / (100 / VGA.fy_px))
    assert known.depth_std_m[0] / known.depth_m[0] == pytest.approx(ADULT.any_std_m / ADULT.mean_m)


@given(st.floats(20, 600), st.floats(20, 600))
def test_a_prior_on_width_leaves_the_height_to_be_measured(width_px, height_px):
    box = level_box(width_px, height_px)
    config = Config(size_prior=(CAR,))
    found = size.estimate(Geometry.of(measured(box)), config)
    assert found.depth_m[0] == pytest.approx(1.8 * VGA.fx_px / width_px)
    assert found.depth_std_m[0] / found.depth_m[0] == pytest.approx(0.1 / 1.8)
    assert not found.height_assumed[0]
    assert found.height_m[0] == pytest.approx(found.depth_m[0] * height_px / VGA.fy_px)
    assert found.height_std_m[0] / found.height_m[0] == pytest.approx(0.1 / 1.8)
    # the van's own width is the same in every frame
    assert found.height_common_std_m[0] == pytest.approx(found.height_std_m[0])


def test_without_intrinsics_pixel_pitch_and_focal_length_serve():
    rows = measured(level_box(200.0), intrinsics=None, **lens(1, focus_distance_m=np.inf))
    wide = size.estimate(Geometry.of(rows), Config(size_prior=(CAR,)))
    assert wide.depth_m[0] == pytest.approx(1.8 * 50 / (200 * 3.9e-3))
    assert np.isnan(wide.x_m[0])
    assert np.isnan(wide.range_m[0])
    tall = size.estimate(Geometry.of(rows), Config())
    straight_m = ADULT.mean_m * 50 / (100 * 3.9e-3)
    assert tall.depth_m[0] == pytest.approx(straight_m * math.sin(math.pi / 6) / (math.pi / 6))
    assert tall.depth_std_m[0] / tall.depth_m[0] > ADULT.std_m / ADULT.mean_m


def test_a_calibrated_size_goes_before_the_prior_and_adds_its_errors():
    rows = measured(level_box(1200.0), **lens(1))
    rows.std_xyxy_px[:] = 3.0
    found = size.estimate(Geometry.of(rows), Config(calibration=(STAFF,)))
    depth_m = 0.06 * 50 / (1200 * 3.9e-3)
    assert found.depth_m[0] == pytest.approx(depth_m)
    assert found.calibration_id[0] == STAFF.calibration_id
    relative = math.sqrt((0.001 / 0.06) ** 2 + 0.02**2 + 2 * (3 / 1200) ** 2)
    assert found.depth_std_m[0] == pytest.approx(depth_m * relative)
    assert found.height_m[0] == pytest.approx(100 * 3.9e-6 / 0.05 * (depth_m - 0.05))
    # without lens data: by the intrinsics
    angles = size.estimate(Geometry.of(measured(level_box(1200.0))), Config(calibration=(STAFF,)))
    assert angles.depth_m[0] == pytest.approx(0.06 * VGA.fx_px / 1200)


def test_height_error_of_a_measured_height_is_that_of_the_errors():
    rng = np.random.default_rng(5)
    n = 40_000
    depth_m, tall_m = 8.0, 1.5
    width_px, height_px = 1.8 * VGA.fx_px / depth_m, tall_m * VGA.fy_px / depth_m
    wide = (1.8 + rng.normal(0, 0.05, n)) * VGA.fx_px / depth_m
    box = np.tile([640.0, 350.0, 640.0 + width_px, 350.0 + height_px], (n, 1))
    box[:, 2] = 640.0 + wide
    box += rng.normal(0, 2.0, (n, 4))
    rows = measured(box, std_xyxy_px=np.full((n, 4), 2.0))
    prior = SizePrior("person", Dimension.WIDTH, 1.8, 0.05)
    found = size.estimate(Geometry.of(rows), Config(size_prior=(prior,)))
    z = (found.height_m - tall_m) / found.height_std_m
    assert z.std() == pytest.approx(1.0, abs=0.05)
    assert abs(z.mean()) < 0.05


def test_what_the_picture_cuts_has_no_height_and_classes_without_a_size_no_depth():
    rows = measured(np.repeat(level_box(40.0), 3, axis=0))
    rows.truncated[0, 1] = rows.truncated[1, 3] = True
    rows.class_name[2] = "dog"
    found = size.estimate(Geometry.of(rows), Config())
    assert np.isnan(found.depth_m).all()
