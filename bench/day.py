"""A day of one camera as columns: what pass 2 takes, what the database holds, and how fast.

Five people at any time walk straight lines over level ground before a camera 4 m up, 25 frames a
second; their boxes have the noise of a good detector. No picture is drawn: pass 1 is measured by
`bench.speed`.
"""

from __future__ import annotations

import argparse
import resource
import sys
import tempfile
from pathlib import Path

import numpy as np
import pyarrow as pa

from pipeline.cli.console import out, print_rows
from pipeline.core.arrays import FloatArray
from pipeline.core.config import Config, load_config
from pipeline.core.tables import CAMERAS, OBSERVATIONS
from pipeline.core.timing import Spent, Stopwatch
from pipeline.run.pass_two import estimate_recording
from pipeline.run.recordings import describe, library_versions
from pipeline.store.database import Store
from pipeline.store.parquet_parts import PartWriter, as_table
from pipeline.store.recordings import RecordingRow, replace_recording
from pipeline.store.runs import finish_run, start_run

FRAME_RATE, PEOPLE, WALK_S = 25, 5, 20
WIDTH_PX, HEIGHT_PX, FOCAL_PX = 1920, 1080, 1500.0
CAMERA_HEIGHT_M, TILT_RAD = 4.0, np.deg2rad(14.0)
NOISE_PX = 1.2
START_NS = 1_767_225_600_000_000_000

# Calibrations of every kind that there is, so that all methods have something to say: they are of the
# size of a person, and a little wrong, as calibrations are.
CAMERA_FILE = """
[[calibration]]
method = "aperture"
object_class = "person"
dimension = "height"
depth_min_m = 2.0
depth_max_m = 40.0
residual_std_m = 0.8
parameters = [
    { name = "k", f_number = 2.0, value = 27.0, std_error = 0.3 },
    { name = "k", f_number = 4.0, value = 54.0, std_error = 0.6 },
]

[[calibration]]
method = "inverse"
object_class = "person"
dimension = "height"
residual_std_m = 0.8
parameters = [
    { name = "b0_m", value = 0.05, std_error = 0.02 },
    { name = "b1_m_mm", value = 10.1, std_error = 0.05 },
]
"""


def walkers(rng: np.random.Generator, first_track: int, from_s: float, to_s: float) -> pa.Table:
    """Return the observations of people who begin to walk in a span of time, one row for each frame."""
    count = round((to_s - from_s) * PEOPLE / WALK_S)
    frames = WALK_S * FRAME_RATE
    begin = np.round((from_s + rng.uniform(0, to_s - from_s, count)) * FRAME_RATE)
    frame = (begin[:, None] + np.arange(frames)).astype(np.int64).ravel()
    track = np.repeat(np.arange(first_track, first_track + count), frames)
    step_s = np.arange(frames) / FRAME_RATE - WALK_S / 2
    heading, speed = rng.uniform(0, 2 * np.pi, count), rng.normal(1.3, 0.2, count)
    middle_y = rng.uniform(12, 26, count)
    x_m = (speed * np.sin(heading))[:, None] * step_s * 0.25 + rng.uniform(-3, 3, count)[:, None]
    y_m = (speed * np.cos(heading))[:, None] * step_s * 0.5 + middle_y[:, None]
    tall_m = np.repeat(rng.normal(1.70, 0.08, count), frames)
    boxes = _boxes(x_m.ravel(), y_m.ravel(), tall_m)
    boxes += NOISE_PX * rng.standard_normal(boxes.shape)
    order = np.lexsort([track, frame])
    n = len(frame)
    columns: dict[str, object] = dict.fromkeys(OBSERVATIONS.names, [None] * n)
    columns |= {
        "observation_index": np.zeros(n, np.int32),
        "camera": ["gate"] * n,
        "frame_index": frame[order],
        "track_id": track[order],
        "class_name": ["person"] * n,
        "detector": ["motion"] * n,
        "score": rng.uniform(0.5, 1.0, n),
        "occlusion": np.where(rng.random(n) < 0.1, rng.uniform(0, 0.6, n), 0.0),
        "luminance": rng.uniform(0.1, 0.4, n),
    }
    for side, name in enumerate(("x_min", "y_min", "x_max", "y_max")):
        columns[f"{name}_px"] = boxes[order, side]
        columns[f"{name}_std_px"] = NOISE_PX * rng.uniform(0.8, 1.3, n)
    for side in ("left", "top", "right", "bottom"):
        columns[f"truncated_{side}"] = np.zeros(n, np.bool_)
    return as_table(columns, OBSERVATIONS)  # type: ignore[arg-type]


def _boxes(x_m: FloatArray, y_m: FloatArray, tall_m: FloatArray) -> FloatArray:
    """Return the boxes (n, 4) of people who stand upright on level ground, ahead of the camera."""
    sides = []
    for up_m in (tall_m, np.zeros_like(tall_m)):
        down_m = CAMERA_HEIGHT_M - up_m
        depth_m = y_m * np.cos(TILT_RAD) + down_m * np.sin(TILT_RAD)
        row_px = (down_m * np.cos(TILT_RAD) - y_m * np.sin(TILT_RAD)) / depth_m * FOCAL_PX
        sides.append((depth_m, row_px + HEIGHT_PX / 2))
    (_, head_px), (depth_m, foot_px) = sides
    middle_px = x_m / depth_m * FOCAL_PX + WIDTH_PX / 2
    half_px = 0.16 * (foot_px - head_px)
    return np.column_stack([middle_px - half_px, head_px, middle_px + half_px, foot_px])


def write_day(folder: Path, hours: float, seed: int = 1) -> RecordingRow:
    """Write the parts of pass 1 of a number of hours, a quarter of an hour at a time."""
    rng = np.random.default_rng(seed)
    seconds, step_s = hours * 3600, 900.0
    tracks: list[pa.Table] = []
    count = 0
    with PartWriter(folder) as parts:
        for from_s in np.arange(0, seconds, step_s):
            to_s = min(from_s + step_s, seconds)
            rows = walkers(rng, round(from_s * PEOPLE / WALK_S), from_s, to_s)
            index = pa.array(np.arange(count, count + rows.num_rows), pa.int32())
            parts.write("observations", rows.set_column(0, OBSERVATIONS.field(0), index))
            count += rows.num_rows
            tracks.append(_track_rows(rows))
        parts.write("tracks", pa.concat_tables(tracks))
        frames = round((seconds + WALK_S + 1) * FRAME_RATE)
        for first in range(0, frames, 100_000):
            parts.write("frames", _frame_rows(rng, first, min(first + 100_000, frames)))
        parts.write("cameras", _camera_row())
    sha = f"{seed:064x}"
    return RecordingRow(Path("day.mcap"), sha, 0, START_NS, START_NS, frames, 0, False)


def _track_rows(observations: pa.Table) -> pa.Table:
    grouped = observations.group_by("track_id").aggregate(
        [("frame_index", "min"), ("frame_index", "max"), ("frame_index", "count")]
    )
    first, last = grouped["frame_index_min"].to_numpy(), grouped["frame_index_max"].to_numpy()
    n = len(first)
    from pipeline.core.tables import TRACKS

    columns: dict[str, object] = dict.fromkeys(TRACKS.names, [None] * n)
    columns |= {
        "camera": ["gate"] * n,
        "track_id": grouped["track_id"].to_numpy(),
        "class_name": ["person"] * n,
        "first_frame_index": first,
        "last_frame_index": last,
        "first_time_ns": START_NS + first.astype(np.int64) * 40_000_000,
        "last_time_ns": START_NS + last.astype(np.int64) * 40_000_000,
        "observation_count": grouped["frame_index_count"].to_numpy(),
        "filled_count": np.zeros(n, np.int32),
    }
    return as_table(columns, TRACKS)  # type: ignore[arg-type]


def _frame_rows(rng: np.random.Generator, first: int, end: int) -> pa.Table:
    from pipeline.core.tables import FRAMES

    n = end - first
    index = np.arange(first, end)
    columns: dict[str, object] = dict.fromkeys(FRAMES.names, [None] * n)
    columns |= {
        "camera": ["gate"] * n,
        "frame_index": index,
        "log_time_ns": START_NS + index * 40_000_000 + rng.integers(0, 2_000_000, n),
        "capture_time_ns": START_NS + index * 40_000_000,
        "image_format": ["jpeg"] * n,
        "image_bytes": rng.integers(130_000, 142_000, n),
        "width_px": [WIDTH_PX] * n,
        "height_px": [HEIGHT_PX] * n,
        "decoded": [True] * n,
        "exposure_pairing": ["nearest"] * n,
        "exposure_offset_ns": rng.integers(-2_000_000, 2_000_000, n),
        "exposure_time_s": np.full(n, 0.004),
        "f_number": np.full(n, 2.8),
        "iso_speed": np.full(n, 200.0),
        "focal_length_mm": np.full(n, 6.0),
        "focus_distance_m": np.full(n, np.inf),
        "pixel_pitch_x_um": np.full(n, 4.0),
        "pixel_pitch_y_um": np.full(n, 4.0),
        "luminance": rng.uniform(0.2, 0.3, n),
        "clipped_fraction": rng.uniform(0, 0.02, n),
        "ev100": np.full(n, 9.9),
        "scene_luminance_cd_m2": np.full(n, 120.0),
    }
    return as_table(columns, FRAMES)  # type: ignore[arg-type]


def _camera_row() -> pa.Table:
    row = dict.fromkeys(CAMERAS.names) | {
        "camera": "gate",
        "topic": "/gate/image",
        "width_px": WIDTH_PX,
        "height_px": HEIGHT_PX,
        "fx_px": FOCAL_PX,
        "fy_px": FOCAL_PX,
        "cx_px": WIDTH_PX / 2,
        "cy_px": HEIGHT_PX / 2,
        "distortion_model": "",
        "distortion": [],
        "intrinsics_source": "recording",
    }
    return as_table({name: [value] for name, value in row.items()}, CAMERAS)


def peak_mb() -> float:
    """Return the peak memory of this process so far."""
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / 1e3 if sys.platform != "darwin" else peak / 1e6


def table_bytes(database: Path) -> dict[str, tuple[int, int]]:
    """Return rows and bytes on disk of the large tables."""
    found = {}
    with Store.open(database, read_only=True) as store:
        block = store.query("SELECT block_size FROM pragma_database_size()")["block_size"][
            0
        ].as_py()
        for name in ("frames", "observations", "observation_quality", "estimates", "track_heights"):
            rows = store.query(f"SELECT count(*) AS n FROM {name}")["n"][0].as_py()
            blocks = store.query(
                "SELECT count(DISTINCT block_id) AS n FROM "
                f"pragma_storage_info('{name}') WHERE block_id >= 0"
            )["n"][0].as_py()
            found[name] = (rows, blocks * block)
    return found


def main() -> None:
    """Make the columns, take them in, estimate them; print seconds, memory and bytes."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--hours", type=float, default=1.0)
    parser.add_argument("--keep", type=Path, help="write the database here and keep it")
    arguments = parser.parse_args() if __name__ == "__main__" else parser.parse_args([])
    with tempfile.TemporaryDirectory(prefix="stadimeter-bench-") as name:
        folder = Path(name)
        camera_file = folder / "camera.toml"
        camera_file.write_text(CAMERA_FILE)
        config = load_config(camera_file)
        row = write_day(folder / "parts", arguments.hours)
        database = arguments.keep or folder / "day.duckdb"
        _measure(database, folder / "parts", row, config, arguments.hours)


def _measure(database: Path, parts: Path, row: RecordingRow, config: Config, hours: float) -> None:
    before_mb = peak_mb()
    with Store.open(database) as store:
        run_id = start_run(store, "run", "day", describe(config), library_versions(), "bench")
        with Stopwatch() as ingest, store.transaction():
            key = replace_recording(store, row, parts, run_id)
        ingest_mb = peak_mb()
        with Stopwatch() as estimate, store.transaction():
            estimate_recording(store, key, run_id, row.path.name, config)
        finish_run(store, run_id)
    sizes = table_bytes(database)
    observations, estimates = sizes["observations"][0], sizes["estimates"][0]
    out.print(
        f"{hours:g} h: {observations:,} observations, {estimates:,} estimates; "
        f"the database is {database.stat().st_size / 1e6:,.0f} MB"
    )
    print_rows(
        "A day of one camera",
        ("step", "seconds", "main thread, s", "rows/s", "peak MB"),
        [
            ["nothing", "", "", "", f"{before_mb:,.0f}"],
            ["take in", *_times(ingest.spent, observations), f"{ingest_mb:,.0f}"],
            ["estimate", *_times(estimate.spent, estimates), f"{peak_mb():,.0f}"],
        ],
    )
    print_rows(
        "On disk",
        ("table", "rows", "MB", "bytes a row"),
        [
            [table, f"{rows:,}", f"{size / 1e6:,.1f}", f"{size / max(rows, 1):.1f}"]
            for table, (rows, size) in sizes.items()
        ],
    )


def _times(spent: Spent, rows: int) -> list[str]:
    return [f"{spent.elapsed_s:.1f}", f"{spent.cpu_s:.1f}", f"{rows / spent.elapsed_s:,.0f}"]


if __name__ == "__main__":
    main()
