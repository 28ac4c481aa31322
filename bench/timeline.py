"""The timeline: how fast it is written, how large it is, and what an hour with many tracks takes.

python -m bench.timeline
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pyarrow as pa
import rerun as rr
from rerun.chunk import RrdReader

from bench.footage import FRAME_RATE, START_NS, street_pictures, write_recording
from dashboards.timeline.source import Source
from dashboards.timeline.split import write_timelines
from dashboards.timeline.writer import write_timeline
from pipeline.cli.console import out, print_rows
from pipeline.core.config import Config, TimelineConfig
from pipeline.core.tables import (
    CAMERAS,
    DIAGNOSTICS,
    ESTIMATES,
    FRAMES,
    GROUND_TRUTH,
    OBSERVATIONS,
    TRACK_HEIGHTS,
    TRACKS,
)
from pipeline.run.recordings import run
from pipeline.store.database import Store
from pipeline.store.recordings import list_recordings

FRAMES_WRITTEN = 1500
PREVIEW_PX = 480
ROUNDS = 3
HOUR_FRAMES, HOUR_TRACKS, AT_ONCE = 3600 * FRAME_RATE, 4000, 10
METHODS = ("fused", "ground", "size")


def main() -> None:
    """Print rates and sizes."""
    with tempfile.TemporaryDirectory(prefix="stadimeter-bench-") as name:
        _of_footage(Path(name))
        _of_an_hour(Path(name))


def _of_footage(folder: Path) -> None:
    recording, database = folder / "bench.mcap", folder / "a.duckdb"
    pictures = street_pictures(100)
    write_recording(recording, pictures, FRAMES_WRITTEN)
    image_bytes = sum(len(pictures[i % len(pictures)]) for i in range(FRAMES_WRITTEN))
    run([recording], database, Config())
    small = Config(timeline=TimelineConfig(preview_px=PREVIEW_PX))
    with Store.open(database, read_only=True) as store:
        recording_id = list_recordings(store)["recording_id"][0].as_py()
        observations = store.query("SELECT count(*) AS n FROM observations")["n"][0].as_py()

        def written(config: Config, place: Path) -> Callable[[], object]:
            return lambda: write_timelines(store, recording_id, recording, place, config)

        jobs = {
            "as recorded": written(Config(), folder / "whole"),
            f"--rrd-preview {PREVIEW_PX}": written(small, folder / "small"),
            "pictures alone, rr.log()": lambda: _log_one_by_one(pictures, folder / "plain.rrd"),
        }
        seconds = {label: _best(job) for label, job in jobs.items()}
    sizes = [folder / p / "bench.rrd" for p in ("whole", "small")] + [folder / "plain.rrd"]
    rows = [
        [
            label,
            f"{FRAMES_WRITTEN / wall:,.0f}",
            f"{FRAMES_WRITTEN / cpu:,.0f}",
            f"{100 * (path.stat().st_size / image_bytes - 1):+.1f} %",
        ]
        for (label, (wall, cpu)), path in zip(seconds.items(), sizes, strict=True)
    ]
    out.print(
        f"{FRAMES_WRITTEN:,} frames of 1280x720 JPEG, {image_bytes / FRAMES_WRITTEN / 1e3:.0f} KB each, "
        f"{observations / FRAMES_WRITTEN:.1f} objects a frame; the MCAP is read again for it"
    )
    header = ("timeline", "frames/s", "frames a CPU second", "size beside the pictures'")
    print_rows("Writing a timeline", header, rows)


def _best(job: Callable[[], object]) -> tuple[float, float]:
    """Return the shortest wall time of some rounds, and the least processor time."""
    walls, cpus = [], []
    for _ in range(ROUNDS):
        wall, cpu = time.perf_counter(), time.process_time()
        job()
        walls.append(time.perf_counter() - wall)
        cpus.append(time.process_time() - cpu)
    return min(walls), min(cpus)


def _log_one_by_one(pictures: list[bytes], target: Path) -> None:
    """Write the pictures, and nothing else, the way Rerun's first examples do."""
    stream = rr.RecordingStream("bench")
    stream.save(target)
    for i in range(FRAMES_WRITTEN):
        stream.set_time("frame", sequence=i)
        image = rr.EncodedImage(contents=pictures[i % len(pictures)], media_type="image/jpeg")
        stream.log("image", image)
    stream.flush()
    stream.disconnect()


def _of_an_hour(folder: Path) -> None:
    tables = hour_of_tracks()
    target = folder / "hour.rrd"
    recording = {"recording_id": "hour", "file_name": "hour.mcap"}
    wall, cpu = time.perf_counter(), time.process_time()
    write_timeline(target, [Source(recording, tables, ())])
    wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
    size_bytes = target.stat().st_size
    entities = {str(chunk.entity_path) for chunk in RrdReader(target).stream().to_chunks()}
    out.print(
        f"an hour of {HOUR_FRAMES:,} frames and {tables['tracks'].num_rows:,} tracks, "
        f"{tables['observations'].num_rows:,} observations by {len(METHODS)} methods, no pictures: "
        f"{wall:.0f} s, {HOUR_FRAMES / cpu:,.0f} frames a CPU second, {size_bytes / 1e6:.0f} MB, "
        f"{size_bytes / HOUR_FRAMES / 1e3:.1f} KB a frame, {len(entities)} entities",
        soft_wrap=True,
    )


def hour_of_tracks() -> dict[str, pa.Table]:
    """Return the rows of an hour in which about ten people at a time walk by, as pass 2 leaves them."""
    random = np.random.default_rng(5)
    length = HOUR_FRAMES * AT_ONCE // HOUR_TRACKS
    first = np.sort(random.integers(0, HOUR_FRAMES - length, HOUR_TRACKS))
    frame = (first[:, None] + np.arange(length)).ravel()
    track = np.repeat(np.arange(HOUR_TRACKS), length)
    order = np.lexsort((track, frame))
    frame, track = frame[order], track[order]
    count = len(frame)
    depth_m = 10 + 20 * random.random(HOUR_TRACKS)[track] + 0.01 * (frame - first[track])
    left = 1200 * random.random(HOUR_TRACKS)[track]
    tall = 1.7 * 1200 / depth_m
    times_ns = START_NS + np.arange(HOUR_FRAMES) * 1_000_000_000 // FRAME_RATE
    camera = {
        "camera": "bench", "topic": "/bench", "width_px": 1280, "height_px": 720,
        "fx_px": 1200.0, "fy_px": 1200.0, "cx_px": 640.0, "cy_px": 360.0,
        "camera_height_m": 5.0, "tilt_rad": 0.2,
    }  # fmt: skip
    observations = {
        "observation_index": np.arange(count), "camera": "bench", "frame_index": frame,
        "track_id": track, "class_name": "person", "x_min_px": left, "x_max_px": left + 0.3 * tall,
        "y_min_px": 600 - tall, "y_max_px": np.full(count, 600.0), "truncated_top": False,
        "truncated_bottom": False, "occlusion": 0.0,
    }  # fmt: skip
    estimates = [
        _table(
            ESTIMATES,
            count,
            {
                "observation_index": np.arange(count), "method": method,
                "depth_m": depth_m + random.normal(0, 0.1, count),
                "depth_std_m": np.full(count, 0.2), "height_m": random.normal(1.7, 0.03, count),
                "height_std_m": np.full(count, 0.05), "height_assumed": False,
                "x_m": left / 200, "y_m": depth_m,
            },
        )
        for method in METHODS
    ]  # fmt: skip
    tracks = {
        "camera": "bench", "track_id": np.arange(HOUR_TRACKS), "class_name": "person",
        "first_frame_index": first, "last_frame_index": first + length - 1,
        "observation_count": np.full(HOUR_TRACKS, length),
    }  # fmt: skip
    heights = {
        "camera": "bench", "track_id": np.arange(HOUR_TRACKS), "method": "fused",
        "height_m": np.full(HOUR_TRACKS, 1.7), "height_std_m": np.full(HOUR_TRACKS, 0.03),
        "height_assumed": False, "observation_count": np.full(HOUR_TRACKS, length),
    }  # fmt: skip
    frames = {
        "camera": "bench", "frame_index": np.arange(HOUR_FRAMES), "log_time_ns": times_ns,
        "capture_time_ns": times_ns, "decoded": True, "exposure_pairing": "nearest",
        "ev100": random.normal(12, 0.1, HOUR_FRAMES), "luminance": np.full(HOUR_FRAMES, 0.2),
    }  # fmt: skip
    return {
        "cameras": _table(CAMERAS, 1, camera),
        "frames": _table(FRAMES, HOUR_FRAMES, frames),
        "observations": _table(OBSERVATIONS, count, observations),
        "tracks": _table(TRACKS, HOUR_TRACKS, tracks),
        "estimates": pa.concat_tables(estimates),
        "track_heights": _table(TRACK_HEIGHTS, HOUR_TRACKS, heights),
        "ground_truth": GROUND_TRUTH.empty_table(),
        "diagnostics": DIAGNOSTICS.empty_table(),
    }


def _table(schema: pa.Schema, rows: int, values: dict[str, object]) -> pa.Table:
    """Return a table with the given columns, or one value for all rows, and nulls elsewhere."""
    columns = []
    for field in schema:
        value = values.get(field.name)
        if isinstance(value, np.ndarray):
            columns.append(pa.array(value).cast(field.type))
        elif value is None:
            columns.append(pa.nulls(rows, field.type))
        else:
            columns.append(pa.repeat(pa.scalar(value, field.type), rows))
    return pa.Table.from_arrays(columns, schema=schema)


if __name__ == "__main__":
    main()
