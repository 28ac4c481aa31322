from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.core.calibration import Dimension
from pipeline.core.config import CameraConfig, Config, SizePrior
from pipeline.core.records import Intrinsics
from pipeline.estimate.boxes.geometry import Geometry
from pipeline.estimate.fusion import fused
from pipeline.estimate.methods import defocus, method_named, size
from pipeline.measure.blur.expected import FLOOR_PX
from pipeline.optics.defocus import diffraction_sigma_um
from pipeline.optics.thin_lens import blur_radius_um, image_distance_mm
from tests.estimate.scenes import estimates, measured

PITCH_UM = 20.0
CAMERA = Intrinsics(1000, 700, 2500.0, 2500.0, 499.5, 349.5)
CONFIG = Config()
WIDTH_M = 0.1


def observed(
    depth_m, f_number=2.8, focus_m=np.inf, *, width_m=WIDTH_M, floor_px=FLOOR_PX, noise=0.01, **more
):
    """Return what pass 1 would have measured of boards at these depths, exactly."""
    depth_m = np.atleast_1d(np.asarray(depth_m, dtype=float))
    n = len(depth_m)
    f_number, focus_m = (np.broadcast_to(np.asarray(v, float), n) for v in (f_number, focus_m))
    half = width_m * image_distance_mm(focus_m, 50.0) * 1e3 / PITCH_UM / depth_m / 2
    bbox = np.stack([500 - half, 350 - half, 500 + half, 350 + half], axis=1)
    radius_px = blur_radius_um(depth_m, 50.0, f_number, focus_m) / PITCH_UM
    diffraction_px = diffraction_sigma_um(f_number) / PITCH_UM
    sigma = np.sqrt(radius_px**2 / 4 + floor_px**2 + diffraction_px**2)
    values = {
        "class_name": np.full(n, "board", dtype=object),
        "std_xyxy_px": np.full((n, 4), 0.5),
        "f_number": f_number,
        "focal_length_mm": np.full(n, 50.0),
        "focus_distance_m": focus_m,
        "pixel_pitch_x_um": np.full(n, PITCH_UM),
        "pixel_pitch_y_um": np.full(n, PITCH_UM),
        "intrinsics": CAMERA,
        "capture_time_ns": np.arange(n) * 1_000_000_000,
        "exposure_time_s": np.full(n, 0.001),
        "blur_sigma_px": sigma,
        "blur_std_px": noise * sigma,
    } | more
    return measured(bbox, **values)


def by_blur(m, others=None, config=CONFIG):
    estimated = defocus.estimate(Geometry.of(m).after(others or {}), config)
    return estimated, estimated.notes


def said(m, depth_m, std_m):
    """Return another method's estimates."""
    depth_m = np.broadcast_to(np.asarray(depth_m, float), len(m))
    std_m = np.broadcast_to(np.asarray(std_m, float), len(m))
    return {"size": estimates(len(m), depth_m=depth_m, depth_std_m=std_m)}


@settings(max_examples=25)
@given(st.floats(0.5, 5.0), st.sampled_from([1.8, 2.8, 4.0]))
def test_infinite_focus_gives_the_depth_of_equation_10(depth_m, f_number):
    estimated, _ = by_blur(observed(depth_m, f_number))
    assert estimated.depth_m[0] == pytest.approx(depth_m, rel=1e-6)
    assert estimated.branch[0] == "near"
    assert 0 < estimated.depth_std_m[0] < 0.1 * depth_m


def test_blur_wider_than_anything_behind_the_focus_is_in_front_of_it():
    estimated, notes = by_blur(observed([0.5, 0.8], focus_m=2.0))
    assert estimated.depth_m == pytest.approx([0.5, 0.8])
    assert list(estimated.branch) == ["near", "near"]
    assert not notes


def test_a_side_that_nothing_tells_is_left_open_and_said_so():
    estimated, notes = by_blur(observed(1.5, focus_m=2.0))
    assert np.isnan(estimated.depth_m).all()
    assert [n.code for n in notes] == ["branch_unknown"]


@pytest.mark.parametrize(("depth_m", "branch"), [(1.5, "near"), (3.0, "far")])
def test_another_method_tells_the_side_but_not_the_depth(depth_m, branch):
    m = observed(depth_m, focus_m=2.0)
    estimated, _ = by_blur(m, said(m, depth_m * 1.1, depth_m * 0.15))
    assert estimated.branch[0] == branch
    assert estimated.depth_m[0] == pytest.approx(depth_m)


def test_another_method_that_fits_neither_side_tells_nothing():
    m = observed(1.5, focus_m=2.0)
    estimated, _ = by_blur(m, said(m, 12.0, 0.1))
    assert np.isnan(estimated.depth_m).all()


def test_a_track_that_comes_nearer_keeps_its_own_size_on_the_right_side_only():
    depths = np.linspace(1.9, 1.2, 12)
    estimated, _ = by_blur(observed(depths, f_number=1.8, focus_m=3.0, noise=0.005))
    assert list(estimated.branch) == ["near"] * 12
    assert estimated.depth_m == pytest.approx(depths, rel=1e-6)


def test_the_size_that_one_stretch_gives_decides_the_next():
    # Focused at infinity there is one side only; then the focus changes and there are two.
    depths, focus = [3.0] * 4 + [3.0] * 4, [np.inf] * 4 + [2.0] * 4
    estimated, _ = by_blur(observed(depths, 1.8, focus))
    assert list(estimated.branch) == ["near"] * 4 + ["far"] * 4
    assert estimated.depth_m == pytest.approx(3.0)


def test_blur_near_the_floor_gives_no_depth():
    estimated, _ = by_blur(observed([1.0, 20.0], f_number=5.6))
    assert np.isfinite(estimated.depth_m).tolist() == [True, False]


def test_without_a_look_at_the_pixels_there_is_nothing():
    m = replace(observed(1.0), blur_sigma_px=None, blur_std_px=None)
    estimated, notes = by_blur(m)
    assert np.isnan(estimated.depth_m).all()
    assert not notes


def test_a_calibrated_floor_is_believed():
    m = observed(3.0, f_number=5.6, floor_px=1.1)
    sharp = Config(camera=(CameraConfig("cam", blur_floor_px=1.1, blur_floor_std_px=0.02),))
    assert by_blur(m, config=sharp)[0].depth_m[0] == pytest.approx(3.0)
    assert by_blur(m)[0].depth_m[0] < 2.9


def test_a_sweep_gives_depth_without_the_floor():
    apertures = np.array([1.8, 2.8, 4.0, 5.6, 8.0, 11.0, 16.0])
    m = observed(np.full(7, 2.0), apertures, floor_px=1.3)
    estimated, notes = by_blur(m)
    assert estimated.depth_m == pytest.approx(2.0, rel=0.01)
    assert np.isfinite(estimated.depth_m).all()  # f/16 too, whose own blur is all floor
    assert notes[0].code == "blur_floor_from_sweep"
    assert "1.3" in notes[0].message


def test_an_object_that_moves_makes_no_sweep():
    apertures = np.array([1.8, 2.8, 4.0, 5.6])
    _, notes = by_blur(observed([1.0, 1.2, 1.5, 1.9], apertures))
    assert "blur_floor_from_sweep" not in [n.code for n in notes]


def test_a_sweep_with_an_outlier_leaves_it_out():
    apertures = np.tile([1.8, 2.8, 4.0, 5.6, 8.0, 11.0, 16.0], 3)
    m = observed(np.full(21, 2.0), apertures)
    m.blur_sigma_px[3] *= 2
    estimated, _ = by_blur(m)
    assert estimated.depth_m == pytest.approx(2.0, rel=0.01)


def test_a_lens_that_says_infinity_and_was_focused_on_the_object_is_found_out():
    # Sharp pictures at 50-110 cm: at infinite focus they would be blurred by a hundred pixels.
    depths = np.linspace(0.5, 1.1, 8)
    m = observed(depths, 1.8, track_id=np.arange(8))
    m = replace(m, blur_sigma_px=np.full(8, 1.6), blur_std_px=np.full(8, 0.02))
    estimated, notes = by_blur(m, said(m, depths, 0.05 * depths))
    assert np.isnan(estimated.depth_m).all()
    assert [n.code for n in notes] == ["blur_contradicts_lens"]
    assert np.isfinite(by_blur(m)[0].depth_m).all()  # nothing else contradicts it


def test_a_few_wrong_sizes_do_not_contradict_the_lens():
    depths = np.linspace(0.8, 2.0, 10)
    m = observed(depths, track_id=np.arange(10))
    wrong = depths.copy()
    wrong[:3] *= 2
    estimated, notes = by_blur(m, said(m, wrong, 0.05 * wrong))
    assert estimated.depth_m == pytest.approx(depths)
    assert not notes


def test_what_moves_while_the_shutter_is_open_has_no_depth():
    m = observed(np.full(5, 2.0))
    step = np.arange(5)[:, None] * np.array([100.0, 0, 100, 0])
    m = replace(m, bbox_xyxy_px=m.bbox_xyxy_px + step, exposure_time_s=np.full(5, 0.1))
    estimated, notes = by_blur(m)
    assert np.isnan(estimated.depth_m).all()
    assert [n.code for n in notes] == ["blur_by_motion"]
    still, _ = by_blur(replace(m, exposure_time_s=np.full(5, 0.001)))
    assert np.isfinite(still.depth_m).all()


def test_deviations_are_those_of_many_disturbed_measurements():
    chance = np.random.default_rng(3)
    n = 4000
    m = observed(np.full(n, 2.0), 1.8, noise=0.02, track_id=np.arange(n))
    shaken = m.blur_sigma_px + m.blur_std_px * chance.standard_normal(n)
    estimated, _ = by_blur(replace(m, blur_sigma_px=shaken))
    noise = np.sqrt(estimated.depth_std_m**2 - estimated.depth_common_std_m**2)
    assert np.std(estimated.depth_m) == pytest.approx(np.median(noise), rel=0.05)


def test_heights_are_those_of_the_object():
    estimated, _ = by_blur(observed(1.2))
    assert estimated.height_m[0] == pytest.approx(WIDTH_M, rel=1e-6)
    assert not estimated.height_assumed[0]


def prior(mean_m, std_m):
    return Config(size_prior=(SizePrior("board", Dimension.WIDTH, mean_m, std_m),))


def test_fused_weighs_blur_by_what_the_lens_gives_it():
    m = observed([1.0, 4.9], 2.8, width_m=0.11, track_id=np.arange(2))
    config = prior(0.10, 0.01)
    by_size = size.estimate(Geometry.of(m), config)
    blur, _ = by_blur(m, {"size": by_size}, config)
    best = fused.estimate(Geometry.of(m), {"size": by_size, "defocus": blur})
    off = np.abs(best.depth_m - [1.0, 4.9])
    off_size = np.abs(by_size.depth_m - [1.0, 4.9])
    assert (off < 0.6 * off_size).all()
    assert (best.depth_std_m < by_size.depth_std_m).all()


def test_defocus_is_asked_after_the_others_which_tell_it_the_side():
    assert method_named("defocus").asks_others
