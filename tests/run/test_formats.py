"""Bare pixels, video and transforms through both passes and onto a timeline."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import av
import numpy as np
import pytest
from foxglove_schemas_protobuf.CompressedVideo_pb2 import CompressedVideo
from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
from foxglove_schemas_protobuf.Quaternion_pb2 import Quaternion
from foxglove_schemas_protobuf.RawImage_pb2 import RawImage
from foxglove_schemas_protobuf.Vector3_pb2 import Vector3

from dashboards.timeline.split import write_timelines
from pipeline.core.config import CameraConfig, Config
from pipeline.core.records import Intrinsics
from pipeline.mcap_file.writer import RecordingWriter, calibration_message, timestamp
from pipeline.run.recording import Timelines
from pipeline.run.recordings import estimate_again, run
from pipeline.store.database import Store
from tests.support.footage import FRAME_NS, HEIGHT_PX, WIDTH_PX, Walker, ground, paint

START_NS, COUNT = 1_700_000_000_000_000_000, 80
HEIGHT_M, FOCAL_PX = 3.0, 500.0


def pictures(count: int) -> list[np.ndarray]:
    base, random = ground(), np.random.default_rng(2)
    walker = Walker((60.0, 400.0), (6.5, 0.0), 120.0)
    found = []
    for index in range(count):
        image = base.copy()
        paint(image, walker, index)
        image += random.normal(0, 3, image.shape)
        found.append(np.clip(image, 0, 255).astype(np.uint8))
    return found


def video_packets(images: list[np.ndarray]) -> list[bytes]:
    context = av.CodecContext.create("libx264", "w")
    context.width, context.height, context.pix_fmt = WIDTH_PX, HEIGHT_PX, "yuv420p"
    context.time_base, context.framerate = Fraction(1, 25), Fraction(25)
    context.gop_size, context.options = 20, {"bf": "0", "crf": "18", "preset": "veryfast"}
    packets: list[bytes] = []
    for index, image in enumerate(images):
        picture = av.VideoFrame.from_ndarray(image, format="bgr24").reformat(format="yuv420p")
        picture.pts = index
        packets += map(bytes, context.encode(picture))
    return packets + [bytes(p) for p in context.encode(None)]


def write(path: Path, kind: str, count: int = COUNT) -> None:
    images = pictures(count)
    packets = video_packets(images) if kind == "video" else []
    intrinsics = Intrinsics(
        WIDTH_PX, HEIGHT_PX, FOCAL_PX, FOCAL_PX, (WIDTH_PX - 1) / 2, (HEIGHT_PX - 1) / 2
    )
    with RecordingWriter(path) as writer:
        for index, image in enumerate(images):
            time_ns = START_NS + index * FRAME_NS
            at = {"timestamp": timestamp(time_ns), "frame_id": "cam"}
            moved = FrameTransform(
                timestamp=timestamp(time_ns),
                parent_frame_id="map",
                child_frame_id="cam",
                translation=Vector3(z=HEIGHT_M),
                rotation=Quaternion(x=-(0.5**0.5), w=0.5**0.5),  # level
            )
            writer.write("/tf", moved, time_ns)
            writer.write("/k", calibration_message(intrinsics, time_ns, "cam"), time_ns)
            if kind == "video":
                message = CompressedVideo(**at, data=packets[index], format="h264")
            else:
                message = RawImage(
                    **at,
                    width=WIDTH_PX,
                    height=HEIGHT_PX,
                    encoding="rgb8",
                    step=WIDTH_PX * 3,
                    data=image[..., ::-1].tobytes(),
                )
            writer.write("/i", message, time_ns)


@pytest.mark.parametrize("kind", ["raw", "video"])
def test_walkers_are_measured_in_any_pictures(kind: str, tmp_path: Path) -> None:
    recording, database = tmp_path / "x.mcap", tmp_path / "x.duckdb"
    write(recording, kind)
    result = run([recording], database, Config(), timelines=Timelines(tmp_path, write_timelines))
    assert not result.failed
    assert not result.damaged
    # the pictures are on it, as JPEGs: bare they are 900 kB each
    assert COUNT * 10_000 < (tmp_path / "x.rrd").stat().st_size < COUNT * 400_000
    with Store.open(database, read_only=True) as store:
        camera = store.query("FROM cameras").to_pylist()[0]
        frames = store.query(
            "SELECT count(*) AS n, bool_and(decoded) AS all_decoded, any_value(width_px) AS width_px,"
            " any_value(image_format) AS image_format FROM frames"
        ).to_pylist()[0]
        depth_m = store.query(
            "SELECT median(depth_m) AS d FROM estimates WHERE method = 'ground'"
        ).to_pylist()[0]["d"]
    assert frames == {
        "n": COUNT,
        "all_decoded": True,
        "width_px": WIDTH_PX,
        "image_format": {"raw": "rgb8", "video": "h264"}[kind],
    }
    assert (camera["pose_source"], camera["recorded_ground_frame"]) == ("transforms", "map")
    assert camera["camera_height_m"] == pytest.approx(HEIGHT_M)
    assert camera["tilt_rad"] == pytest.approx(0.0, abs=1e-9)
    foot_depth_m = HEIGHT_M * FOCAL_PX / (400 - (HEIGHT_PX - 1) / 2)
    assert depth_m == pytest.approx(foot_depth_m, rel=0.05)


def test_the_camera_file_goes_before_the_transforms_and_they_are_kept(tmp_path: Path) -> None:
    recording, database = tmp_path / "x.mcap", tmp_path / "x.duckdb"
    write(recording, "raw", 40)
    surveyed = Config(camera=(CameraConfig("cam", camera_height_m=2.5, tilt_deg=0.0),))
    run([recording], database, surveyed)
    sources = []
    for config in (None, Config()):
        if config is not None:
            estimate_again(database, config, None)
        with Store.open(database, read_only=True) as store:
            row = store.query("SELECT camera_height_m, pose_source FROM cameras").to_pylist()[0]
            sources.append((row["camera_height_m"], row["pose_source"]))
    assert sources == [(2.5, "given"), (pytest.approx(HEIGHT_M), "transforms")]
