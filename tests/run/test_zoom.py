"""A camera that zooms, or stores pictures of another size, is measured by the lens of each picture."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

import stadimeter
from pipeline.core.camera_row import camera_rows
from pipeline.core.records import Intrinsics
from pipeline.estimate.track_batches import Tracks
from pipeline.mcap_file.writer import (
    RecordingWriter,
    calibration_message,
    image_message,
    timestamp,
)
from pipeline.optics.pinhole import PinholeCamera
from pipeline.run.stored_camera import StoredCamera
from pipeline.store.database import Store
from pipeline.store.track_rows import tracks_of
from schemas.stadimeter_pb2 import Detections
from tests.run.test_recordings import CAMERA, INTRINSICS, LEVEL, START_NS

FRAMES = 24
DEPTH_M = 10.0
HEIGHTS_M = (1.6, 1.8)
LensOfFrame = Callable[[int], Intrinsics]


def write_zoomed(path: Path, lens_of_frame: LensOfFrame, *, calibrated: bool = True) -> None:
    """Two people 10 m before a level camera at 1.5 m, each frame through a lens of its own."""
    with RecordingWriter(path) as writer:
        for index in range(FRAMES):
            lens = lens_of_frame(index)
            time_ns = START_NS + index * 100_000_000
            picture = np.full((lens.height_px, lens.width_px, 3), 90, np.uint8)
            data = cv2.imencode(".jpg", picture)[1].tobytes()
            if calibrated:
                writer.write("/calib", calibration_message(lens, time_ns, CAMERA), time_ns)
            writer.write("/image", image_message(data, "jpeg", time_ns, CAMERA), time_ns)
            found = Detections(timestamp=timestamp(time_ns), frame_id=CAMERA, detector="hand")
            for number, height_m in enumerate(HEIGHTS_M):
                x_min, y_min, x_max, y_max = box_through(lens, -0.6 + 1.2 * number, height_m)
                box = {"x_min_px": x_min, "y_min_px": y_min, "x_max_px": x_max, "y_max_px": y_max}
                found.objects.add(
                    box=box, class_name="person", object_id=f"p{number}", box_std_px=0.5
                )
            writer.write("/found", found, time_ns + 5_000_000)


def box_through(lens: Intrinsics, x_m: float, height_m: float) -> list[float]:
    camera = PinholeCamera(
        lens.fx_px,
        lens.fy_px,
        lens.cx_px,
        lens.cy_px,
        lens.width_px,
        lens.height_px,
        lens.distortion_model,
        lens.distortion,
    )
    low, high = 1.5, 1.5 - height_m
    middle_m = (low + high) / 2
    sides = [(x_m - 0.2, middle_m), (x_m, high), (x_m + 0.2, middle_m), (x_m, low)]
    points = camera.project(np.array([(x, y, DEPTH_M) for x, y in sides]))
    return [float(points[0, 0]), float(points[1, 1]), float(points[2, 0]), float(points[3, 1])]


def measured(recording: Path, database: Path) -> tuple[dict[int, list[float]], set[str]]:
    stadimeter.measure(recording, database, camera=LEVEL, strict=False)
    with stadimeter.open(database) as results:
        rows = results.query(
            "SELECT frame_index, depth_m FROM current_estimates WHERE method = 'ground'"
        ).rows()
        codes = {row["code"] for row in results.view("diagnostics").rows()}
    depths: dict[int, list[float]] = {}
    for row in rows:
        depths.setdefault(row["frame_index"], []).append(row["depth_m"])
    return depths, codes


def zoomed(focal_px: float) -> Intrinsics:
    return replace(INTRINSICS, fx_px=focal_px, fy_px=focal_px)


def sized(factor: float) -> Intrinsics:
    """The same lens in pictures of another size."""
    size = round(320 * factor), round(240 * factor)
    middle = 160 * factor - 0.5, 120 * factor - 0.5
    return Intrinsics(*size, 400 * factor, 400 * factor, *middle)


BENT = replace(zoomed(300.0), distortion_model="plumb_bob", distortion=(-0.2, 0.05, 0.0, 0.0, 0.0))
LENSES: dict[str, LensOfFrame] = {
    "in": lambda i: zoomed(400.0 if i < 15 else 600.0),
    "in, out": lambda i: zoomed(520.0 if 8 <= i < 16 else 400.0),
    "at once, after a moment": lambda i: zoomed(300.0 if i < 2 else 600.0),
    "slowly": lambda i: zoomed(400.0 * 1.03**i),
    "another size": lambda i: sized(1.0 if i < 14 else 2.0),
    "another shape": lambda i: (
        sized(1.0) if i < 14 else Intrinsics(320, 180, 400.0, 400.0, 159.5, 89.5)
    ),
    "a window of the sensor that moves": lambda i: (
        sized(1.0) if i < 14 else replace(INTRINSICS, cx_px=139.5, cy_px=99.5)
    ),
    "a lens that bends at its short end": lambda i: zoomed(400.0) if i < 14 else BENT,
}


@pytest.mark.parametrize("name", LENSES)
def test_every_picture_is_measured_through_its_own_lens(name: str, tmp_path: Path) -> None:
    write_zoomed(tmp_path / "zoom.mcap", LENSES[name])
    depths, codes = measured(tmp_path / "zoom.mcap", tmp_path / "x.duckdb")
    assert sorted(depths) == list(range(FRAMES))
    found = np.array([depths[i] for i in range(FRAMES)])
    assert found == pytest.approx(DEPTH_M, rel=0.05)  # the reach of a body is in it
    assert np.ptp(found, axis=0).max() < 0.02
    assert codes & {"lens_changed", "size_changed"}


def test_a_dummy_calibration_in_between_changes_nothing(tmp_path: Path) -> None:
    write_zoomed(tmp_path / "zoom.mcap", lambda i: zoomed(1.0 if i in {0, 9} else 400.0))
    write_zoomed(tmp_path / "plain.mcap", lambda i: zoomed(400.0))
    depths, codes = measured(tmp_path / "zoom.mcap", tmp_path / "x.duckdb")
    plain, _ = measured(tmp_path / "plain.mcap", tmp_path / "y.duckdb")
    for index in set(range(FRAMES)) - {0, 9}:
        assert depths[index] == pytest.approx(plain[index], rel=1e-3)
    assert "impossible_lens" in codes


def test_the_lens_of_a_camera_file_holds_for_all_pictures(tmp_path: Path) -> None:
    """The file's focal length is for the whole recording: what the recording says of zoom is void."""
    (tmp_path / "camera.toml").write_text(
        f'[[camera]]\nname = "{CAMERA}"\nfx_px = 400\ncamera_height_m = 1.5\ntilt_deg = 0\n'
    )
    write_zoomed(tmp_path / "plain.mcap", lambda i: zoomed(400.0))
    stadimeter.measure(
        tmp_path / "plain.mcap",
        tmp_path / "y.duckdb",
        camera=tmp_path / "camera.toml",
        strict=False,
    )
    with stadimeter.open(tmp_path / "y.duckdb") as results:
        rows = results.query("SELECT depth_m FROM current_estimates WHERE method = 'ground'").rows()
    assert [row["depth_m"] for row in rows] == pytest.approx([DEPTH_M] * len(rows), rel=0.05)


def test_other_boxes_in_a_frame_are_taken_to_the_usual_lens_too(tmp_path: Path) -> None:
    """A batch holds some of the tracks; those that stand beside them are read with their frames."""
    write_zoomed(tmp_path / "zoom.mcap", LENSES["in"])
    stadimeter.measure(tmp_path / "zoom.mcap", tmp_path / "x.duckdb", camera=LEVEL, strict=False)
    with Store.open(tmp_path / "x.duckdb", read_only=True) as store:
        (key,) = store.query("SELECT recording_id FROM recordings").to_pylist()
        recording_id = key["recording_id"]
        (row,) = camera_rows(store.read("cameras", recording_id))
        camera = StoredCamera(store, recording_id, row)
        tracks = Tracks.of(tracks_of(store, recording_id, "person"))
        whole = camera.measured(tracks)
        one = camera.measured(tracks.take(slice(0, 1)))
    assert one.others is not None
    beside = whole.bbox_xyxy_px[np.isin(whole.observation_index, one.others.observation_index)]
    assert len(beside) == FRAMES
    assert one.others.bbox_xyxy_px == pytest.approx(beside)
    assert np.ptp(one.others.bbox_xyxy_px, axis=0).max() < 0.01
