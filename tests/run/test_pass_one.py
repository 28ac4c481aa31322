"""Pass 1 of tiny recordings: what is stored of cameras and frames, and what is told."""

from __future__ import annotations

import math
from pathlib import Path

import cv2
import numpy as np
import pyarrow.parquet as pq
import pytest

from pipeline.core.config import Config
from pipeline.core.exposure import Exposure
from pipeline.mcap_file.writer import RecordingWriter, image_message
from pipeline.messages.exposure import exposure_message
from pipeline.run.pass_one import measure_recording

WIDTH_PX, HEIGHT_PX = 320, 240  # a diagonal of 400 pixels


def measured(
    folder: Path, exposure: Exposure, frames: int = 3
) -> dict[str, list[dict[str, object]]]:
    ok, jpeg = cv2.imencode(".jpg", np.full((HEIGHT_PX, WIDTH_PX, 3), 90, np.uint8))
    assert ok
    path = folder / "r.mcap"
    with RecordingWriter(path) as writer:
        for index in range(frames):
            time_ns = 1_700_000_000_000_000_000 + index * 40_000_000
            writer.write("/image", image_message(jpeg.tobytes(), "jpeg", time_ns, "cam"), time_ns)
            writer.write("/exposure", exposure_message(exposure, time_ns, "cam"), time_ns)
    row = measure_recording(path, Config(), folder / "parts", threads=1)
    assert (row.frame_count, row.frames_lost, row.damaged) == (frames, 0, False)
    assert row.start_time_ns is not None
    return {
        name: pq.read_table(folder / "parts" / f"{name}.parquet").to_pylist()
        for name in ("cameras", "frames", "diagnostics")
    }


def test_the_equivalent_focal_length_alone_gives_the_angles_and_is_told(tmp_path: Path) -> None:
    tables = measured(tmp_path, Exposure(focal_length_35mm_mm=26.0, brightness_ev=-1.5))
    (camera,) = tables["cameras"]
    assert camera["intrinsics_source"] == "lens_data"
    assert camera["fx_px"] == camera["fy_px"] == pytest.approx(26 * 400 / math.hypot(36, 24))
    assert {row["brightness_ev"] for row in tables["frames"]} == {-1.5}
    assert {row["focal_length_35mm_mm"] for row in tables["frames"]} == {26.0}
    (told,) = tables["diagnostics"]
    assert told["code"] == "rounded_focal_length"
    assert "1.9%" in str(told["message"])  # half a millimetre of 26


def test_a_stated_pitch_needs_no_warning(tmp_path: Path) -> None:
    exposure = Exposure(focal_length_mm=4.0, pixel_pitch_x_um=4.0, focal_length_35mm_mm=26.0)
    tables = measured(tmp_path, exposure)
    assert tables["cameras"][0]["fx_px"] == pytest.approx(1000.0)
    assert not tables["diagnostics"]


def test_no_lens_data_is_told(tmp_path: Path) -> None:
    tables = measured(tmp_path, Exposure(exposure_time_s=0.01))
    assert tables["cameras"][0]["fx_px"] is None
    assert [row["code"] for row in tables["diagnostics"]] == ["no_lens_data"]
