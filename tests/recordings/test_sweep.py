"""The simulator of aperture sweeps, and what `run` makes of the recording that is kept."""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from pipeline.calibrate.blur_floor import BlurFloor
from pipeline.core.config import Config, load_config
from pipeline.optics.thin_lens import blur_radius_um
from pipeline.run.calibration import calibrate_stored_blur
from pipeline.run.recordings import run
from pipeline.store.database import Store
from recordings.simulate_sweep import shots
from recordings.sweep_random import random_shot
from recordings.sweep_scene import Lens, Scene, Target, photograph

RECORDING = Path(__file__).resolve().parents[2] / "recordings" / "aperture_sweep.mcap"
LENS = Lens(
    focus_distance_m=2.0, pixel_pitch_um=20.0, width_px=400, height_px=300, iso_speed=1000.0
)
WALL = Scene((), wall_contrast=0.0)


def linear(picture):
    value = picture[..., 1] / 255.0
    return np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)


def edge_moments(lens, depth_m):
    """Return place and standard deviation of the left edge of a wide board, along rows."""
    board = Target("b", depth_m, 0.0, 0.0, 0.1 * depth_m, 0.12 * depth_m, colour=(0.6, 0.6, 0.6))
    picture = photograph(replace(WALL, targets=(board,)), lens, 3)
    x0, y0, x1, y1 = board.box_px(lens)
    middle = round((y0 + y1) / 2)
    profile = linear(picture)[middle - 60 : middle + 60].mean(axis=0)[: round((x0 + x1) / 2)]
    slope = np.diff(profile)
    at = np.arange(len(slope)) + 0.5
    near = np.abs(at - x0) < lens.blur_radius_px(depth_m) + 3
    place = np.average(at[near], weights=slope[near])
    return place - x0, np.sqrt(np.average((at[near] - place) ** 2, weights=slope[near]))


@pytest.mark.parametrize(("depth_m", "f_number"), [(1.0, 2.8), (0.7, 2.8), (4.0, 1.8), (1.2, 1.8)])
def test_an_edge_is_spread_by_half_the_radius_of_the_blur_circle(depth_m, f_number):
    lens = replace(LENS, f_number=f_number, iso_speed=130 * f_number**2)
    place, sigma = edge_moments(lens, depth_m)
    radius_px = blur_radius_um(depth_m, 50.0, f_number, 2.0) / 20.0
    assert abs(place) < 0.3
    assert sigma == pytest.approx(np.hypot(radius_px / 2, lens.floor_sigma_px), rel=0.03)


def test_brightness_follows_equation_15():
    wide = photograph(WALL, replace(LENS, f_number=2.8, iso_speed=400.0), 1)
    closed = photograph(WALL, replace(LENS, f_number=5.6, iso_speed=400.0), 1)
    assert linear(wide).mean() / linear(closed).mean() == pytest.approx(4.0, rel=0.05)


def test_a_mosaic_softens_and_keeps_the_colours():
    board = Target("b", 2.0, 0, 0, 0.06, 0.06, colour=(0.1, 0.3, 0.7))
    scene = replace(WALL, targets=(board,))
    plain = photograph(scene, LENS, 1)
    mosaic = photograph(scene, replace(LENS, mosaic=True), 1)
    middle = (slice(140, 160), slice(190, 210))
    assert mosaic[middle].mean(axis=(0, 1)) == pytest.approx(plain[middle].mean(axis=(0, 1)), abs=3)
    rough = [cv2.Laplacian(p[..., 1].astype(np.float64), -1).std() for p in (plain, mosaic)]
    assert rough[1] < rough[0]


def test_random_shots_are_the_same_for_the_same_seed():
    assert random_shot(5) == random_shot(5)
    assert random_shot(5) != random_shot(6)


def test_the_recording_covers_the_apertures_and_distances():
    all_shots = shots()
    assert {s.lens.f_number for s in all_shots} == {1.8, 2.8, 4.0, 5.6, 8.0, 11.0, 16.0}
    depths = [s.scene.targets[0].depth_m for s in all_shots]
    assert (min(depths), max(depths)) == (0.5, 5.0)
    assert RECORDING.stat().st_size < 5e6


@pytest.mark.slow
def test_depths_by_blur_alone_are_right_on_the_recording(tmp_path):
    database = tmp_path / "a.duckdb"
    run([RECORDING], database, Config())
    with Store.open(database, read_only=True) as store:
        rows = store.query(
            """
            SELECT depth_error_m / true_depth_m AS relative, depth_z, branch, true_depth_m,
                focus_distance_m
            FROM accuracy.errors
            JOIN estimates USING (recording_id, run_id, observation_index, method)
            JOIN frames USING (recording_id, camera, frame_index)
            WHERE method = 'defocus'
            """
        ).to_pandas()
        said = store.query("SELECT code FROM diagnostics").to_pydict()["code"]
    assert len(rows) > 0.85 * 3 * len(shots())
    assert rows["relative"].abs().median() < 0.01
    assert rows["relative"].abs().max() < 0.05
    assert (rows["depth_z"].abs() < 1.96).mean() > 0.95
    behind = rows["true_depth_m"] > rows["focus_distance_m"]
    assert (behind == (rows["branch"] == "far")).all()
    assert "blur_floor_from_sweep" in said
    assert "blur_contradicts_lens" not in said

    # The camera's softness from the same recording: 0.35 px and the pixel's own, and what JPEG adds.
    ((camera, floor),) = calibrate_stored_blur(database, tmp_path / "camera.toml", Config())
    assert camera == "sweep"
    assert isinstance(floor, BlurFloor)
    assert shots()[0].lens.floor_sigma_px - 0.03 < floor.floor_px < 0.6
    kept = load_config(tmp_path / "camera.toml").camera_named("sweep")
    assert kept.blur_floor_px == pytest.approx(floor.floor_px)
