from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import pandas as pd
import pyarrow.parquet as pq
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.cluster.manifest import read_manifests
from pipeline.cluster.shared_run import run_shared
from pipeline.core.config import Config
from pipeline.mcap_file.writer import (
    RecordingWriter,
    calibration_message,
    image_message,
    timestamp,
)
from pipeline.run.windows.split import OVERLAP_S, cut, plan_windows
from schemas.stadimeter_pb2 import CameraExposure, Detections, GroundTruth
from tests.run.test_recordings import CAMERA, INTRINSICS, START_NS, jpeg


def write_crossings(path: Path, seconds: int, *, named: bool = False) -> None:
    """People who cross, two at a time, two frames a second; the lens data come once, at the start."""
    picture = jpeg()
    with RecordingWriter(path) as writer:
        lens = calibration_message(INTRINSICS, START_NS, CAMERA)
        writer.write("/calib", lens, START_NS)
        exposure = CameraExposure(
            timestamp=timestamp(START_NS), frame_id=CAMERA, f_number=2.8, exposure_time_s=0.01
        )
        writer.write("/exposure", exposure, START_NS)
        for index in range(2 * seconds):
            time_ns = START_NS + index * 500_000_000
            writer.write("/image", image_message(picture, "jpeg", time_ns, CAMERA), time_ns)
            found = Detections(timestamp=timestamp(time_ns), frame_id=CAMERA, detector="hand")
            truth = GroundTruth(timestamp=timestamp(time_ns), frame_id=CAMERA)
            for person in {index // 15, (index + 7) // 15}:
                x = 20 + 10 * ((index + 7 * (person % 2)) % 30)
                box = {"x_min_px": x, "x_max_px": x + 30, "y_min_px": 90, "y_max_px": 180}
                found.objects.add(box=box, class_name="person", box_std_px=0.5)
                if named:
                    found.objects[-1].object_id = f"p{person % 5}"
                truth.objects.add(object_id=f"p{person % 5}", depth_m=8.0, height_m=1.7, box=box)
            writer.write("/found", found, time_ns + 5_000_000)
            writer.write("/truth", truth, time_ns + 6_000_000)


def rows(folder: Path, table: str, order: list[str]) -> pd.DataFrame:
    (manifest,) = read_manifests(folder)
    found = pq.read_table(folder / manifest.parts[table].path).to_pandas()
    # The hash of all tables has the tracks' numbers in it.
    dropped = [c for c in ("run_id", "track_id", "tables_sha256") if c in found]
    return found.drop(columns=dropped).sort_values(order).reset_index(drop=True)


@pytest.mark.parametrize("named", [False, True])
def test_windows_stitched_are_the_whole(tmp_path: Path, named: bool) -> None:
    """Recorded boxes do not depend on what was seen before, so nothing may differ but tracks' numbers."""
    path = tmp_path / "long.mcap"
    write_crossings(path, 260, named=named)
    for name, window_s in (("whole", 0.0), ("cut", 65.0)):
        result = run_shared([path], tmp_path / name, Config(), window_s=window_s)
        assert [f.path for f in result.made] == [path]
    orders = {
        "frames": ["frame_index"],
        "observations": ["observation_index"],
        "ground_truth": ["frame_index", "object_id"],
        "tracks": ["first_frame_index", "last_frame_index", "observation_count"],
        "cameras": ["camera"],
        "recordings": ["recording_id"],
        "matches": ["observation_index"],
        "estimates": ["method", "observation_index"],
        "track_heights": ["method", "depth_median_m", "observation_count"],
    }
    for table, order in orders.items():
        whole, found = (rows(tmp_path / name, table, order) for name in ("whole", "cut"))
        assert len(whole) > 0, table
        pd.testing.assert_frame_equal(whole, found, rtol=1e-9, obj=table)
    whole, found = (
        pq.read_table(next((tmp_path / name).glob("parts/*/*/observations.parquet"))).to_pandas()
        for name in ("whole", "cut")
    )
    pairs = pd.crosstab(whole["track_id"], found["track_id"]) > 0
    assert (pairs.sum(axis=0) == 1).all()
    assert (pairs.sum(axis=1) == 1).all()
    assert not (tmp_path / "cut" / "work").exists() or not any(
        (tmp_path / "cut" / "work").iterdir()
    )


def test_short_and_damaged_recordings_are_left_whole(tmp_path: Path) -> None:
    path = tmp_path / "long.mcap"
    write_crossings(path, 60)
    assert plan_windows(path, Config(), 50.0) is None
    assert plan_windows(path, Config(), 0.0) is None
    plan = plan_windows(path, Config(), 20.0)
    assert plan is not None
    assert len(plan.windows) == 3
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 0xFF
    path.write_bytes(data)
    assert plan_windows(path, Config(), 20.0) is None
    path.write_bytes(data[: len(data) // 2])
    assert plan_windows(path, Config(), 20.0) is None


@given(
    start_ns=st.integers(0, 2**61), length_ns=st.integers(0, 10**14), window_s=st.floats(100.0, 1e5)
)
def test_every_time_counts_once(start_ns: int, length_ns: int, window_s: float) -> None:
    windows = cut(start_ns, start_ns + length_ns, window_s)
    assert windows[0].from_ns == start_ns
    assert windows[-1].to_ns == start_ns + length_ns + 1
    for before, after in pairwise(windows):
        assert before.to_ns == after.from_ns
        assert after.read_from_ns == max(after.from_ns - round(OVERLAP_S * 1e9), start_ns)


@given(length_s=st.floats(450.0, 1e6), window_s=st.sampled_from([300.0, 123.4]))
def test_all_windows_are_read_for_the_same_time(length_s: float, window_s: float) -> None:
    windows = cut(7, 7 + round(length_s * 1e9), window_s)
    assert all(w.from_ns < w.to_ns for w in windows)
    read_ns = [w.to_ns - w.read_from_ns for w in windows]
    assert max(read_ns) - min(read_ns) <= 2 * len(windows)
