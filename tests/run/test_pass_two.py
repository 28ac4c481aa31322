"""Pass 2 in batches of tracks gives what it gives of all of them at once."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from bench.day import CAMERA_FILE, FOCAL_PX, START_NS, walkers
from pipeline.core.config import Config, load_config
from pipeline.core.tables import OBSERVATIONS
from pipeline.measure.blur.expected import FLOOR_PX
from pipeline.optics.defocus import diffraction_sigma_um, dioptres, radius_per_dioptre_um
from pipeline.run.pass_two import estimate_recording
from pipeline.run.recordings import describe
from pipeline.store.database import Store
from pipeline.store.parquet_parts import PartWriter, as_table
from pipeline.store.recordings import replace_recording
from pipeline.store.runs import start_run
from tests.store.rows import recording

FOCAL_MM = 50.0
PITCH_UM = FOCAL_MM * 1e3 / FOCAL_PX
APERTURES = np.array([2.0, 2.8, 4.0, 5.6])
FOCUS_M = 9.0
EVERY = 4  # of the frames that `walkers` makes
BOARD = (700.0, 500.0, 760.0, 640.0)
POSE = """
[[camera]]
name = "door"
camera_height_m = 4.0
camera_height_std_m = 0.1
tilt_deg = 14.0
tilt_std_deg = 0.3
roll_deg = 0.0
roll_std_deg = 0.3
"""
TABLES = ("estimates", "track_heights", "observation_quality", "calibrations", "diagnostics")


def lens(frame: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return f-number and focus distance of frames: the one is swept, the other changes once."""
    return APERTURES[frame // EVERY % 4], np.where(frame < 500, np.inf, FOCUS_M)


def blur_px(depth_m: np.ndarray, frame: np.ndarray) -> np.ndarray:
    """Return how wide edges are there."""
    f_number, focus_m = lens(frame)
    per_px = radius_per_dioptre_um(FOCAL_MM, f_number, focus_m) / 2 / PITCH_UM
    own = FLOOR_PX**2 + (diffraction_sigma_um(f_number) / PITCH_UM) ** 2
    return np.sqrt((per_px * (dioptres(focus_m) - 1 / depth_m)) ** 2 + own)


def street(camera: str, blurred: float) -> pd.DataFrame:
    """Return people who walk, boards that stand still, and people whose feet are outside the picture."""
    rng = np.random.default_rng(4)
    rows = walkers(rng, 0, 0.0, 48.0).to_pandas()
    rows = rows[rows["frame_index"] % EVERY == 0]
    stride_px = 0.05 * (rows["y_max_px"] - rows["y_min_px"]) * np.cos(rows["frame_index"] / 25 * 11)
    rows["x_min_px"] -= stride_px
    rows["x_max_px"] += stride_px
    boards = rows[rows["track_id"] % 7 == 3].copy()
    boards["track_id"] += 1000
    boards["class_name"] = "board"
    boards[["x_min_px", "y_min_px", "x_max_px", "y_max_px"]] = BOARD
    boards["x_min_px"] += rng.normal(0, 0.3, len(boards))
    cut = rows["track_id"] % 6 == 1
    rows.loc[cut, "y_max_px"] -= 20
    rows.loc[cut, "truncated_bottom"] = True
    rows["class_name"] = np.where(rows["track_id"] % 9 == 5, "dog", rows["class_name"])
    rows = pd.concat([rows, boards]).sort_values(["frame_index", "track_id"])
    frame = rows["frame_index"].to_numpy()
    depth_m = FOCAL_PX * 1.7 / (rows["y_max_px"] - rows["y_min_px"]).to_numpy()
    rows["blur_sigma_px"] = blurred * blur_px(depth_m, frame) * rng.normal(1, 0.02, len(rows))
    rows["blur_std_px"] = 0.02 * rows["blur_sigma_px"]
    return rows.assign(camera=camera)


def frames(camera: str, index: np.ndarray) -> dict[str, object]:
    """Return the frames of a camera."""
    f_number, focus_m = lens(index)
    n = len(index)
    return {
        "camera": [camera] * n,
        "frame_index": index,
        "log_time_ns": START_NS + index * 40_000_000,
        "capture_time_ns": START_NS + index * 40_000_000,
        "decoded": [True] * n,
        "exposure_pairing": ["nearest"] * n,
        "exposure_time_s": np.full(n, 0.0005),
        "f_number": f_number,
        "focal_length_mm": np.full(n, FOCAL_MM),
        "focus_distance_m": focus_m,
        "pixel_pitch_x_um": np.full(n, PITCH_UM),
        "pixel_pitch_y_um": np.full(n, PITCH_UM),
    }


def write(folder: Path) -> None:
    """Write what pass 1 would have left of two cameras, of which the second misstates its focus."""
    cameras = {"door": 1.0, "gate": 9.0}
    seen = pd.concat([street(name, blurred) for name, blurred in cameras.items()])
    seen["observation_index"] = np.arange(len(seen))
    with PartWriter(folder) as parts:
        parts.write("observations", as_table(seen.to_dict("list"), OBSERVATIONS))
        for name in cameras:
            mine = seen[seen["camera"] == name]
            index = np.unique(mine["frame_index"]).astype(np.int64)
            parts.write("frames", full("frames", frames(name, index)))
            tracks = mine.groupby("track_id")["frame_index"].agg(["min", "max", "count"])
            columns = {
                "camera": [name] * len(tracks),
                "track_id": tracks.index,
                "class_name": ["person"] * len(tracks),
                "first_frame_index": tracks["min"],
                "last_frame_index": tracks["max"],
                "first_time_ns": tracks["min"],
                "last_time_ns": tracks["max"],
                "observation_count": tracks["count"],
            }
            parts.write("tracks", full("tracks", columns))
            camera = {
                "camera": [name],
                "topic": [f"/{name}"],
                "width_px": [1920],
                "height_px": [1080],
                "fx_px": [FOCAL_PX],
                "fy_px": [FOCAL_PX],
                "cx_px": [960.0],
                "cy_px": [540.0],
                "intrinsics_source": ["recording"],
            }
            parts.write("cameras", full("cameras", camera))


def full(table: str, columns: dict[str, object]) -> object:
    """Return rows of a table of pass 1; what is not said is null."""
    from pipeline.core.tables import PASS_ONE

    names = PASS_ONE[table].names
    n = len(next(iter(columns.values())))  # type: ignore[arg-type]
    return as_table({c: list(columns.get(c, [None] * n)) for c in names}, PASS_ONE[table])  # type: ignore[call-overload]


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> dict[int, dict[str, pd.DataFrame]]:
    """All tables of pass 2 by the size of a batch."""
    folder = tmp_path_factory.mktemp("street")
    write(folder / "parts")
    (folder / "camera.toml").write_text(CAMERA_FILE + POSE)
    config = load_config(folder / "camera.toml")
    result = {}
    with Store.open(folder / "a.duckdb") as store:
        for batch in (10**9, 700, 90):
            result[batch] = estimated(store, folder / "parts", config, batch)
    return result


def estimated(store: Store, parts: Path, config: Config, batch: int) -> dict[str, pd.DataFrame]:
    run_id = start_run(store, "run", None, describe(config), "", "")
    with store.transaction():
        key = replace_recording(store, recording(), parts, run_id)
        estimate_recording(store, key, run_id, "a.mcap", config, batch)
    return {
        table: store.query(
            f"SELECT * EXCLUDE (run_id) FROM {table} WHERE run_id = ? ORDER BY ALL",
            [run_id],
        ).to_pandas()
        for table in TABLES
    }


def test_the_street_has_what_batches_could_spoil(
    made: dict[int, dict[str, pd.DataFrame]],
) -> None:
    whole = made[10**9]
    methods = whole["estimates"].groupby("method").size()
    assert {"aperture", "inverse", "size", "ground", "defocus", "fused"} == set(methods.index)
    assert (whole["observation_quality"]["quality"] < 1).mean() > 0.05
    assert whole["observation_quality"]["stride_phase_rad"].notna().any()
    codes = set(whole["diagnostics"]["code"])
    assert codes >= {
        "blur_contradicts_lens",
        "blur_floor_from_sweep",
        "f_number_outside_calibration",
        "method_not_applicable",
        "pose_from_walkers",
    }
    assert not whole["diagnostics"].duplicated(["camera", "code", "message"]).any()
    no_feet = whole["track_heights"].query("method == 'ground'")["track_id"]
    assert len(set(whole["track_heights"]["track_id"]) - set(no_feet))


@pytest.mark.parametrize("batch", [700, 90])
def test_batches_give_what_the_whole_gives(
    made: dict[int, dict[str, pd.DataFrame]], batch: int
) -> None:
    for table, whole in made[10**9].items():
        pd.testing.assert_frame_equal(made[batch][table], whole, check_exact=False, rtol=1e-9)
