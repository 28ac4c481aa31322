"""Random estimates with truth, put into a store, and beside it as arrays for independent sums."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from pipeline.store.database import Store
from pipeline.store.precision import DECIMALS
from tests.store.rows import estimate, ingest, recording, start

METHODS = ("size", "ground")
F_NUMBERS = (1.8, 2.8, None)


def populate(store: Store, folder: Path, seed: int = 1, recordings: int = 2) -> pd.DataFrame:
    """Fill a store with one run over recordings; return one row for each estimate, NaN for NULL."""
    rng = np.random.default_rng(seed)
    run_id = start(store, "first")
    frames = [
        _recording(store, rng, run_id, f"r{index}.mcap", folder / str(index))
        for index in range(recordings)
    ]
    return pd.concat(frames, ignore_index=True)


def _recording(
    store: Store, rng: np.random.Generator, run_id: str, name: str, folder: Path
) -> pd.DataFrame:
    scene = _scene(rng)
    optional = {c: _none(scene[c]) for c in ("f_number", "true_depth_m", "true_height_m")}
    key = ingest(
        store,
        run_id,
        folder,
        recording(name),
        frames={
            "camera": scene["camera"].tolist(),
            "frame_index": scene["frame_index"].tolist(),
            "capture_time_ns": (scene["frame_index"] * 40_000_000).tolist(),
            "f_number": optional["f_number"],
        },
        observations={
            "camera": scene["camera"].tolist(),
            "frame_index": scene["frame_index"].tolist(),
            "track_id": scene["track_id"].tolist(),
            "object_id": scene["object_id"].tolist(),
        },
        ground_truth={
            "camera": scene["camera"].tolist(),
            "frame_index": scene["frame_index"].tolist(),
            "object_id": scene["object_id"].tolist(),
            "class_name": scene["class_name"].tolist(),
            "depth_m": optional["true_depth_m"],
            "height_m": optional["true_height_m"],
        },
    )
    made = pd.concat([_estimates(rng, scene, m) for m in METHODS], ignore_index=True)
    columns = ("depth_m", "depth_std_m", "height_m", "height_std_m")
    estimate(
        store,
        key,
        run_id,
        {
            "observation_index": made["observation_index"].tolist(),
            "method": made["method"].tolist(),
            "height_assumed": made["height_assumed"].tolist(),
            "in_calibrated_range": made["in_calibrated_range"].tolist(),
            **{c: _none(made[c]) for c in columns},
        },
    )
    return made.assign(recording_id=key, file_name=name, run_id=run_id)


def _scene(rng: np.random.Generator) -> pd.DataFrame:
    """Tracks of two cameras, one frame for each observation; some truths are unknown."""
    count = 240
    track = np.sort(rng.integers(0, 12, count))
    depth = rng.uniform(2, 40, 12)[track] + rng.normal(0, 1, count)
    height = rng.normal(1.7, 0.1, 12)[track]
    return pd.DataFrame(
        {
            "observation_index": np.arange(count),
            "frame_index": np.arange(count),
            "track_id": track,
            "camera": np.where(track % 2, "left", "right"),
            "object_id": [f"o{t}" for t in track],
            "class_name": np.where(track % 3 == 0, "child", "adult"),
            "f_number": rng.choice(np.array([1.8, 2.8, np.nan]), 12)[track],
            "true_depth_m": np.where(rng.random(count) < 0.1, np.nan, depth),
            "true_height_m": np.where(rng.random(count) < 0.1, np.nan, height),
        }
    )


def _estimates(rng: np.random.Generator, scene: pd.DataFrame, method: str) -> pd.DataFrame:
    """Estimates with errors that are shared within a track; some unknown, some heights assumed."""
    n = len(scene)
    depth = scene["true_depth_m"].fillna(10.0).to_numpy()
    height = scene["true_height_m"].fillna(1.7).to_numpy()
    shared = rng.normal(0, 0.08, 12)[scene["track_id"]]
    made = scene.assign(
        method=method,
        depth_m=depth * np.exp(shared + rng.normal(0.02, 0.1, n)),
        depth_std_m=depth * rng.uniform(0.05, 0.2, n),
        height_m=height * np.exp(rng.normal(0, 0.05, n)),
        height_std_m=rng.uniform(0.05, 0.15, n),
        height_assumed=rng.random(n) < 0.2,
        in_calibrated_range=rng.random(n) < 0.7,
    )
    for name in ("depth_m", "depth_std_m", "height_m", "height_std_m"):
        made.loc[rng.random(n) < 0.05, name] = np.nan
        made[name] = made[name].round(DECIMALS["estimates"][name])
    return made


def _none(values: pd.Series) -> list[float | None]:
    return [None if np.isnan(v) else float(v) for v in values]
