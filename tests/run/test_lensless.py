"""A stored recording without lens data: run, estimated again, calibrated."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from bench.walkers import HEIGHT_PX, WIDTH_PX, scene
from pipeline.core.config import Config, load_config
from pipeline.core.tables import OBSERVATIONS
from pipeline.run.calibration import Found, calibrate_stored_walkers
from pipeline.run.pass_two import estimate_recording
from pipeline.run.recordings import describe
from pipeline.store.database import Store
from pipeline.store.parquet_parts import PartWriter, as_table
from pipeline.store.recordings import replace_recording
from pipeline.store.runs import start_run
from tests.run.test_pass_two import full
from tests.store.rows import recording

SEED, PEOPLE, CAMERA = 1004, 60, "mast"


def write(folder: Path) -> float:
    """Write what pass 1 would leave of simulated walkers and return the true focal length."""
    simulated = scene(np.random.default_rng(SEED), PEOPLE)
    m = simulated.measured
    n = len(m)
    index = np.arange(n)
    columns: dict[str, object] = {
        "camera": [CAMERA] * n,
        "observation_index": index,
        "frame_index": index,
        "track_id": m.track_id,
        "class_name": ["person"] * n,
        "detector": ["motion"] * n,
        "score": np.ones(n),
        "occlusion": np.zeros(n),
    }
    for i, side in enumerate(("x_min", "y_min", "x_max", "y_max")):
        columns[f"{side}_px"] = m.bbox_xyxy_px[:, i]
        columns[f"{side}_std_px"] = m.std_xyxy_px[:, i]
    for cut in ("left", "top", "right", "bottom"):
        columns[f"truncated_{cut}"] = np.zeros(n, dtype=bool)
    filled = {name: list(columns.get(name, [None] * n)) for name in OBSERVATIONS.names}  # type: ignore[call-overload]
    with PartWriter(folder) as parts:
        parts.write("observations", as_table(filled, OBSERVATIONS))
        frames = {
            "camera": [CAMERA] * n,
            "frame_index": index,
            "log_time_ns": m.capture_time_ns,
            "capture_time_ns": m.capture_time_ns,
            "decoded": [True] * n,
            "exposure_pairing": ["none"] * n,
        }
        parts.write("frames", full("frames", frames))
        ids, first, count = np.unique(m.track_id, return_index=True, return_counts=True)
        last = first + count - 1
        tracks = {
            "camera": [CAMERA] * len(ids),
            "track_id": ids,
            "class_name": ["person"] * len(ids),
            "first_frame_index": first,
            "last_frame_index": last,
            "first_time_ns": m.capture_time_ns[first],
            "last_time_ns": m.capture_time_ns[last],
            "observation_count": count,
        }
        parts.write("tracks", full("tracks", tracks))
        camera = {
            "camera": [CAMERA],
            "topic": ["/mast"],
            "width_px": [WIDTH_PX],
            "height_px": [HEIGHT_PX],
        }
        parts.write("cameras", full("cameras", camera))
    assert m.intrinsics is not None
    return m.intrinsics.fx_px


def test_lens_and_pose_are_found_stored_and_written(tmp_path: Path) -> None:
    true_px = write(tmp_path / "parts")
    database, file = tmp_path / "a.duckdb", tmp_path / "camera.toml"
    with Store.open(database) as store:
        run_id = start_run(store, "run", None, describe(Config()), "", "")
        with store.transaction():
            key = replace_recording(store, recording(), tmp_path / "parts", run_id)
            estimate_recording(store, key, run_id, "a.mcap", Config())
        (camera,) = store.read("cameras", key).to_pylist()
        codes = store.query("SELECT code FROM diagnostics").to_pandas()["code"].tolist()
        methods = store.query("SELECT DISTINCT method FROM estimates").to_pandas()["method"]
    assert camera["intrinsics_source"] == camera["pose_source"] == "walkers"
    assert abs(camera["fx_px"] - true_px) < 3 * camera["focal_std_px"]
    assert camera["focal_std_px"] < 0.2 * true_px
    assert "focal_length_from_walkers" in codes
    assert {"ground", "size", "fused"} <= set(methods)

    ((name, found),) = calibrate_stored_walkers(database, file, Config())
    assert name == CAMERA
    assert isinstance(found, Found)
    assert found.lens is not None
    written = load_config(file).camera_named(CAMERA)
    assert written.fx_px == written.fy_px == pytest.approx(camera["fx_px"])
    assert written.cx_px == (WIDTH_PX - 1) / 2

    with Store.open(database) as store:
        run_id = start_run(store, "estimate", None, describe(Config()), "", "")
        with store.transaction():
            estimate_recording(store, key, run_id, "a.mcap", load_config(file))
        (again,) = store.read("cameras", key).to_pylist()
    assert (again["intrinsics_source"], again["pose_source"]) == ("camera_file", "given")
    assert again["focal_std_px"] == pytest.approx(camera["focal_std_px"], rel=0.01)
    assert again["fx_px"] == pytest.approx(camera["fx_px"])
