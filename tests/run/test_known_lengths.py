"""Known lengths of a stored recording: in the camera file, by `calibrate`, with and without a pose."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import stadimeter
from bench.day import CAMERA_HEIGHT_M, FOCAL_PX, HEIGHT_PX, TILT_RAD, WIDTH_PX, write_day
from pipeline.cli.main import main
from pipeline.core.config import load_config
from pipeline.run.pass_two import estimate_recording
from pipeline.run.recordings import describe
from pipeline.store.database import Store
from pipeline.store.recordings import replace_recording
from pipeline.store.runs import start_run

AHEAD_M, POST_M = 17.0, 2.5
CAMERA = '[[camera]]\nname = "gate"\n'


def row_px(up_m: float) -> float:
    """Return the row of a point above the ground, `AHEAD_M` ahead of the camera."""
    below_rad = np.arctan((CAMERA_HEIGHT_M - up_m) / AHEAD_M)
    return float(HEIGHT_PX / 2 + FOCAL_PX * np.tan(below_rad - TILT_RAD))


POST_PX = (WIDTH_PX / 2, row_px(0.0), WIDTH_PX / 2, row_px(POST_M))


def post(length_m: float) -> str:
    known = f"points_px = {list(POST_PX)}, length_m = {length_m}, std_m = 0.002, std_px = 0.1"
    return CAMERA + f"known_length = [{{ {known}, upright = true }}]\n"


@pytest.fixture(scope="module")
def database(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A minute of people who walk, as pass 1 leaves it."""
    folder = tmp_path_factory.mktemp("known")
    path = folder / "day.duckdb"
    row = write_day(folder / "parts", 0.02)
    with Store.open(path) as store:
        run_id = start_run(store, "run", None, describe(load_config(None)), "", "")
        with store.transaction():
            replace_recording(store, row, folder / "parts", run_id)
    return path


def estimated(database: Path, folder: Path, text: str) -> tuple[float, set[str]]:
    """Return the camera's height, and the codes of the diagnostics, with a camera file."""
    file = folder / "camera.toml"
    file.write_text(text)
    config = load_config(file)
    with Store.open(database) as store:
        run_id = start_run(store, "estimate", None, describe(config), "", "")
        (recording,) = store.query("SELECT recording_id FROM recordings").to_pylist()
        with store.transaction():
            estimate_recording(store, recording["recording_id"], run_id, "day.mcap", config)
        (camera,) = store.query("SELECT camera_height_m FROM cameras").to_pylist()
        rows = store.query("SELECT code FROM diagnostics WHERE run_id = ?", [run_id]).to_pylist()
    return camera["camera_height_m"], {row["code"] for row in rows}


def test_a_post_in_the_camera_file_is_the_scale(database: Path, tmp_path: Path) -> None:
    height_m, codes = estimated(database, tmp_path, post(POST_M))
    assert height_m == pytest.approx(CAMERA_HEIGHT_M, rel=0.02)
    assert "scale_from_known_lengths" in codes
    assert not codes & {"scale_from_statures", "known_length_contradicted", "people_unlike_prior"}
    longer_m, codes = estimated(database, tmp_path, post(1.3 * POST_M))
    assert longer_m / height_m == pytest.approx(1.3, rel=0.01)
    assert "people_unlike_prior" in codes


def test_a_given_pose_is_checked_by_a_post_and_kept(database: Path, tmp_path: Path) -> None:
    pose = f"camera_height_m = {CAMERA_HEIGHT_M}\ntilt_deg = {np.rad2deg(TILT_RAD)}\n"
    height_m, codes = estimated(database, tmp_path, post(POST_M) + pose)
    assert height_m == CAMERA_HEIGHT_M
    assert "known_length_contradicted" not in codes
    height_m, codes = estimated(database, tmp_path, post(1.1 * POST_M) + pose)
    assert height_m == CAMERA_HEIGHT_M
    assert "known_length_contradicted" in codes


def test_calibrate_takes_a_post_and_keeps_it(database: Path, tmp_path: Path) -> None:
    file = tmp_path / "found.toml"
    ((_, found),) = stadimeter.calibrate(
        database, file, by="walkers", known_uprights_m={POST_PX: POST_M}
    )
    assert not isinstance(found, Exception)
    assert found.plane.camera_height_m == pytest.approx(CAMERA_HEIGHT_M, rel=0.02)
    (camera,) = load_config(file).camera
    (known,) = camera.known_length
    assert (known.upright, known.length_m) == (True, POST_M)
    # The same by a camera file that has it.
    (tmp_path / "post.toml").write_text(post(1.3 * POST_M))
    ((_, longer),) = stadimeter.calibrate(
        database, tmp_path / "b.toml", by="walkers", camera=tmp_path / "post.toml"
    )
    assert not isinstance(longer, Exception)
    ratio = longer.plane.camera_height_m / found.plane.camera_height_m
    assert ratio == pytest.approx(1.3, rel=0.02)


@pytest.mark.parametrize("option", ["--known-upright", "--known-distance"])
@pytest.mark.parametrize("text", ["1,2,3=2", "1,2,3,4", "1,2,3,4=tall"])
def test_a_length_that_is_none_is_refused(
    database: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], option: str, text: str
) -> None:
    output = str(tmp_path / "c.toml")
    assert main(["calibrate", "--walkers", "--db", str(database), "-o", output, option, text]) == 2
    assert option in capsys.readouterr().err


def test_an_unsure_pose_is_narrowed_by_the_people(database: Path, tmp_path: Path) -> None:
    tilt_deg = np.rad2deg(TILT_RAD)
    unsure = f"camera_height_m = {CAMERA_HEIGHT_M}\ntilt_deg = {tilt_deg + 1}\ntilt_std_deg = 1.0\n"
    _, codes = estimated(database, tmp_path, CAMERA + unsure)
    assert "given_pose_narrowed" in codes
    with Store.open(database) as store:
        (camera,) = store.query(
            "SELECT tilt_rad, tilt_std_rad, pose_source FROM cameras"
        ).to_pylist()
    assert np.rad2deg(camera["tilt_rad"]) == pytest.approx(tilt_deg, abs=0.5)
    assert np.rad2deg(camera["tilt_std_rad"]) < 0.6
    assert camera["pose_source"] == "given"
