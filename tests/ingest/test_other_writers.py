"""Files as other tools write them: foxglove-sdk, rosbags, and mcap's writers for ROS 1 and 2."""

from __future__ import annotations

import base64
import json
from collections.abc import Callable
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import cv2
import foxglove
import numpy as np
import pytest
from foxglove import messages as fox
from foxglove.channels import (
    CameraCalibrationChannel,
    CompressedImageChannel,
    FrameTransformChannel,
    ImageAnnotationsChannel,
    RawImageChannel,
)
from mcap.writer import Writer as McapWriter
from mcap_ros1.writer import Writer as Ros1Writer
from mcap_ros2.writer import Writer as Ros2Writer
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as BagWriter
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from pipeline.core.config import Config
from pipeline.core.diagnostics import Notes
from pipeline.core.records import Frame, Severity
from pipeline.images.decode import decode
from pipeline.ingest.frames import FrameAssembler
from pipeline.mcap_file.reader import McapFile

START_NS, FRAME_NS, COUNT = 1_700_000_000_000_000_000, 40_000_000, 4
WIDTH, HEIGHT = 64, 48
K = [50.0, 0, 31.5, 0, 51.0, 23.5, 0, 0, 1]
# A camera 3 m above the ground that looks 30 degrees down, without roll: R_x(-90) tilted on.
QUATERNION = (-0.8660254037844387, 0.0, 0.0, 0.5)


def picture() -> np.ndarray:
    y, x = np.mgrid[0:HEIGHT, 0:WIDTH]
    return np.stack([60 + 2 * x, 40 + 3 * y, 200 - x - y], axis=-1).astype(np.uint8)


JPEG = cv2.imencode(".jpg", picture(), [cv2.IMWRITE_JPEG_QUALITY, 95])[1].tobytes()
RAW = picture().tobytes()
TIMES = [START_NS + i * FRAME_NS for i in range(COUNT)]


def read(path: Path) -> tuple[list[Frame], Notes, FrameAssembler]:
    config, notes = Config(), Notes()
    assembler = FrameAssembler(McapFile(path, config.limits, notes.add), config.ingest, notes)
    return list(assembler), notes, assembler


def check(path: Path, *, boxes: bool = True, camera: str = "cam") -> None:
    """Check that everything arrived: pixels, times, calibration, boxes, pose."""
    frames, notes, assembler = read(path)
    assert not [n for n in notes if n.severity is not Severity.INFO], list(notes)
    assert [f.capture_time_ns for f in frames] == TIMES
    assert {f.camera for f in frames} == {camera}
    for frame in frames:
        bgr = decode(frame.image, max_pixels=10**6, layout=frame.layout).bgr
        assert np.abs(bgr.astype(int) - picture()).mean() < 2
        assert frame.intrinsics is not None
        found = frame.intrinsics
        assert (found.fx_px, found.fy_px, found.cx_px, found.cy_px) == (50.0, 51.0, 31.5, 23.5)
        assert (found.width_px, found.height_px) == (WIDTH, HEIGHT)
        assert (found.distortion_model, found.distortion[:2]) == ("plumb_bob", (0.1, -0.02))
    if boxes:
        detections = frames[0].detections
        assert detections is not None
        assert detections.bbox_xyxy_px.tolist() == [[9.5, 4.5, 19.5, 34.5]]
        assert detections.class_name == ("person",)
    pose = assembler.poses[camera]
    assert pose.height_m == pytest.approx(3.0)
    assert np.degrees(pose.tilt_rad) == pytest.approx(30.0)
    assert pose.roll_rad == pytest.approx(0.0, abs=1e-9)
    assert pose.ground_frame == "map"


# foxglove-sdk: protobuf


@pytest.mark.parametrize("raw", [False, True])
def test_foxglove_sdk(tmp_path: Path, raw: bool) -> None:
    path, context = tmp_path / "x.mcap", foxglove.Context()
    with foxglove.open_mcap(path, context=context):
        image: Any = (RawImageChannel if raw else CompressedImageChannel)("/i", context=context)
        lens = CameraCalibrationChannel("/k", context=context)
        tf = FrameTransformChannel("/tf", context=context)
        notes = ImageAnnotationsChannel("/boxes", context=context)
        for time_ns in TIMES:
            at = fox.Timestamp(time_ns // 10**9, time_ns % 10**9)
            tf.log(
                fox.FrameTransform(
                    timestamp=at,
                    parent_frame_id="map",
                    child_frame_id="cam",
                    translation=fox.Vector3(x=5.0, y=1.0, z=3.0),
                    rotation=fox.Quaternion(**dict(zip("xyzw", QUATERNION, strict=True))),
                ),
                log_time=time_ns,
            )
            lens.log(
                fox.CameraCalibration(
                    timestamp=at,
                    frame_id="cam",
                    width=WIDTH,
                    height=HEIGHT,
                    distortion_model="plumb_bob",
                    D=[0.1, -0.02, 0, 0, 0],
                    K=K,
                ),
                log_time=time_ns,
            )
            if raw:
                message: Any = fox.RawImage(
                    timestamp=at,
                    frame_id="cam",
                    width=WIDTH,
                    height=HEIGHT,
                    encoding="bgr8",
                    step=WIDTH * 3,
                    data=RAW,
                )
            else:
                message = fox.CompressedImage(
                    timestamp=at, frame_id="cam", data=JPEG, format="jpeg"
                )
            image.log(message, log_time=time_ns)
            corners = [(10, 5), (20, 5), (20, 35), (10, 35)]
            notes.log(
                fox.ImageAnnotations(
                    points=[
                        fox.PointsAnnotation(
                            timestamp=at,
                            type=fox.PointsAnnotationType.LineLoop,
                            points=[fox.Point2(x=x, y=y) for x, y in corners],
                        )
                    ],
                    texts=[
                        fox.TextAnnotation(
                            timestamp=at, position=fox.Point2(x=10, y=4), text="person"
                        )
                    ],
                ),
                log_time=time_ns,
            )
    check(path)


# foxglove's schemas as JSON, and ours


def write_json(path: Path, raw: bool) -> None:
    def stamp(time_ns: int) -> dict[str, int]:
        return {"sec": time_ns // 10**9, "nsec": time_ns % 10**9}

    def text(data: bytes) -> str:
        return base64.b64encode(data).decode()

    with path.open("wb") as stream:
        w = McapWriter(stream)
        w.start()

        def channel(topic: str, name: str, schema: bytes = b"{}") -> int:
            number = w.register_schema(name, "jsonschema", schema)
            return w.register_channel(topic, "json", number)

        image = channel("/i", "foxglove.RawImage" if raw else "foxglove.CompressedImage")
        lens, tf = (
            channel("/k", "foxglove.CameraCalibration"),
            channel("/tf", "foxglove.FrameTransforms"),
        )
        boxes = channel("/b", "stadimeter.Detections")
        by_name = w.register_channel("/settings", "json", 0)  # no schema at all
        declared = channel("/more", "Mine", b'{"properties": {"gain_db": {"type": "number"}}}')
        for time_ns in TIMES:
            head = {"timestamp": stamp(time_ns), "frame_id": "cam"}
            if raw:
                body = {"width": WIDTH, "height": HEIGHT, "encoding": "bgr8", "step": 0}
                body |= {"data": text(RAW)}
            else:
                body = {"format": "jpeg", "data": text(JPEG)}
            lens_body = {"width": WIDTH, "height": HEIGHT, "K": K, "D": [0.1, -0.02, 0, 0, 0]}
            lens_body |= {"distortion_model": "plumb_bob"}
            moved = {
                "timestamp": stamp(time_ns),
                "parent_frame_id": "map",
                "child_frame_id": "cam",
                "translation": {"x": 0, "y": 0, "z": 3},
                "rotation": dict(zip("xyzw", QUATERNION, strict=True)),
            }
            box = {"x_min_px": 9.5, "y_min_px": 4.5, "x_max_px": 19.5, "y_max_px": 34.5}
            for number, value in (
                (tf, {"transforms": [moved]}),
                (lens, head | lens_body),
                (image, head | body),
                (boxes, head | {"objects": [{"box": box, "class_name": "person"}]}),
                (by_name, head | {"f_number": 2.8, "photographic_sensitivity": 200}),
                (declared, {"timestamp": stamp(time_ns), "gain_db": 6.0}),
            ):
                data = json.dumps(value).encode()
                w.add_message(number, log_time=time_ns, data=data, publish_time=time_ns)
        w.finish()


@pytest.mark.parametrize("raw", [False, True])
def test_json(tmp_path: Path, raw: bool) -> None:
    path = tmp_path / "x.mcap"
    write_json(path, raw)
    check(path)
    exposures = [f.exposure for f in read(path)[0]]
    assert {(e.f_number, e.iso_speed) for e in exposures} == {(2.8, 200.0)}


# ROS 2: rosbags, with every compression, and mcap's own writer

VISION = """
std_msgs/Header header
vision_msgs/Detection2D[] detections
"""
DETECTION = """
std_msgs/Header header
vision_msgs/ObjectHypothesisWithPose[] results
vision_msgs/BoundingBox2D bbox
string id
"""
HYPOTHESIS = """
vision_msgs/ObjectHypothesis hypothesis
geometry_msgs/PoseWithCovariance pose
"""


def ros2_store() -> Any:
    store = get_typestore(Stores.ROS2_HUMBLE)
    added: dict[str, Any] = {}
    for name, text in {
        "Detection2DArray": VISION,
        "Detection2D": DETECTION,
        "ObjectHypothesisWithPose": HYPOTHESIS,
        "ObjectHypothesis": "string class_id\nfloat64 score\n",
        "BoundingBox2D": "vision_msgs/Pose2D center\nfloat64 size_x\nfloat64 size_y\n",
        "Pose2D": "vision_msgs/Point2D position\nfloat64 theta\n",
        "Point2D": "float64 x\nfloat64 y\n",
    }.items():
        added |= get_types_from_msg(text, f"vision_msgs/msg/{name}")
    added |= get_types_from_msg(
        "builtin_interfaces/Time timestamp\nstring frame_id\nuint8[] data\nstring format\n",
        "foxglove_msgs/msg/CompressedImage",
    )
    store.register(added)
    return store


def ros2_messages(store: Any, kind: str) -> Callable[[int], list[tuple[str, str, Any]]]:
    """Return topic, type and message of everything that belongs to a time."""
    t = store.types
    stamp_of, header_of = t["builtin_interfaces/msg/Time"], t["std_msgs/msg/Header"]

    def messages(time_ns: int) -> list[tuple[str, str, Any]]:
        stamp = stamp_of(sec=time_ns // 10**9, nanosec=time_ns % 10**9)
        head = header_of(stamp=stamp, frame_id="cam")
        data = np.frombuffer(RAW if kind == "raw" else JPEG, np.uint8)
        if kind == "raw":
            name = "sensor_msgs/msg/Image"
            image = t[name](
                header=head,
                height=HEIGHT,
                width=WIDTH,
                encoding="bgr8",
                is_bigendian=0,
                step=WIDTH * 3,
                data=data,
            )
        elif kind == "foxglove":
            name = "foxglove_msgs/msg/CompressedImage"
            image = t[name](timestamp=stamp, frame_id="cam", data=data, format="jpeg")
        else:
            name = "sensor_msgs/msg/CompressedImage"
            image = t[name](header=head, format="bgr8; jpeg compressed bgr8", data=data)
        lens = t["sensor_msgs/msg/CameraInfo"](
            header=head,
            height=HEIGHT,
            width=WIDTH,
            distortion_model="plumb_bob",
            d=np.array([0.1, -0.02, 0, 0, 0]),
            k=np.array(K),
            r=np.eye(3).ravel(),
            p=np.zeros(12),
            binning_x=0,
            binning_y=0,
            roi=t["sensor_msgs/msg/RegionOfInterest"](
                x_offset=0, y_offset=0, height=0, width=0, do_rectify=False
            ),
        )
        vector, turn = t["geometry_msgs/msg/Vector3"], t["geometry_msgs/msg/Quaternion"]
        moved = t["geometry_msgs/msg/TransformStamped"](
            header=header_of(stamp=stamp, frame_id="map"),
            child_frame_id="cam",
            transform=t["geometry_msgs/msg/Transform"](
                translation=vector(x=0.0, y=0.0, z=3.0),
                rotation=turn(**dict(zip("xyzw", QUATERNION, strict=True))),
            ),
        )
        pose = t["geometry_msgs/msg/Pose"](
            position=t["geometry_msgs/msg/Point"](x=0.0, y=0.0, z=0.0),
            orientation=turn(x=0.0, y=0.0, z=0.0, w=1.0),
        )
        found = t["vision_msgs/msg/Detection2DArray"](
            header=head,
            detections=[
                t["vision_msgs/msg/Detection2D"](
                    header=head,
                    results=[
                        t["vision_msgs/msg/ObjectHypothesisWithPose"](
                            hypothesis=t["vision_msgs/msg/ObjectHypothesis"](
                                class_id=name_, score=score
                            ),
                            pose=t["geometry_msgs/msg/PoseWithCovariance"](
                                pose=pose, covariance=np.zeros(36)
                            ),
                        )
                        for name_, score in (("dog", 0.2), ("person", 0.9))
                    ],
                    bbox=t["vision_msgs/msg/BoundingBox2D"](
                        center=t["vision_msgs/msg/Pose2D"](
                            position=t["vision_msgs/msg/Point2D"](x=15.0, y=20.0), theta=0.0
                        ),
                        size_x=10.0,
                        size_y=30.0,
                    ),
                    id="7",
                )
            ],
        )
        tf = t["tf2_msgs/msg/TFMessage"](transforms=[moved])
        return [
            ("/tf", "tf2_msgs/msg/TFMessage", tf),
            ("/camera/info", "sensor_msgs/msg/CameraInfo", lens),
            ("/camera/image", name, image),
            ("/camera/found", "vision_msgs/msg/Detection2DArray", found),
        ]

    return messages


@pytest.mark.parametrize("kind", ["raw", "compressed", "foxglove"])
@pytest.mark.parametrize("mode", [None, CompressionMode.STORAGE, CompressionMode.MESSAGE])
def test_rosbags_ros2(tmp_path: Path, kind: str, mode: CompressionMode | None) -> None:
    """rosbag2 can compress message by message inside chunks that are not compressed."""
    store = ros2_store()
    messages = ros2_messages(store, kind)
    bag = BagWriter(tmp_path / "bag", version=9, storage_plugin=StoragePlugin.MCAP)
    if mode is not None:
        bag.set_compression(mode, CompressionFormat.ZSTD)
    with bag:
        known: dict[str, Any] = {}
        for time_ns in TIMES:
            for topic, type_name, message in messages(time_ns):
                if topic not in known:
                    known[topic] = bag.add_connection(topic, type_name, typestore=store)
                bag.write(known[topic], time_ns, store.serialize_cdr(message, type_name))
    (path,) = (tmp_path / "bag").glob("*.mcap")
    check(path)
    detections = read(path)[0][0].detections
    assert detections is not None
    assert (detections.object_id, detections.score.tolist()) == (("7",), [0.9])


def plain(value: Any) -> Any:
    """Return a message of rosbags as the dictionaries and lists that mcap's writer takes."""
    if is_dataclass(value):
        return {f.name: plain(getattr(value, f.name)) for f in fields(value)}
    if isinstance(value, np.ndarray):
        return value.tobytes() if value.dtype == np.uint8 else value.tolist()
    return [plain(v) for v in value] if isinstance(value, list) else value


def test_mcap_ros2_writer(tmp_path: Path) -> None:
    store = ros2_store()
    messages = ros2_messages(store, "compressed")
    path = tmp_path / "x.mcap"
    writer = Ros2Writer(str(path))
    schemas: dict[str, Any] = {}
    for time_ns in TIMES:
        for topic, type_name, message in messages(time_ns):
            if type_name not in schemas:
                text, _ = store.generate_msgdef(type_name, ros_version=2)
                schemas[type_name] = writer.register_msgdef(type_name, text)
            writer.write_message(topic, schemas[type_name], plain(message), log_time=time_ns)
    writer.finish()
    check(path)


# ROS 1: mcap's writer, with bytes serialised by rosbags


@pytest.mark.parametrize("raw", [False, True])
def test_mcap_ros1_writer(tmp_path: Path, raw: bool) -> None:
    store = get_typestore(Stores.ROS1_NOETIC)
    tf_type, tf_text = "tf2_msgs/msg/TFMessage", "geometry_msgs/TransformStamped[] transforms\n"
    store.register(get_types_from_msg(tf_text, tf_type))
    t = store.types
    stamp_of, header_of = t["builtin_interfaces/msg/Time"], t["std_msgs/msg/Header"]
    path = tmp_path / "x.mcap"
    writer = Ros1Writer(str(path))

    def write(topic: str, type_name: str, message: Any, time_ns: int) -> None:
        text, md5 = store.generate_msgdef(type_name, ros_version=1)
        data = bytes(store.serialize_ros1(message, type_name))
        generated = {"_type": type_name.replace("/msg/", "/"), "_full_text": text, "_md5sum": md5}
        generated["serialize"] = lambda _, buffer: buffer.write(data)
        writer.write_message(topic, type("Generated", (), generated)(), log_time=time_ns)

    for number, time_ns in enumerate(TIMES):
        stamp = stamp_of(sec=time_ns // 10**9, nanosec=time_ns % 10**9)
        head = header_of(seq=number, stamp=stamp, frame_id="/cam")
        vector, turn = t["geometry_msgs/msg/Vector3"], t["geometry_msgs/msg/Quaternion"]
        moved = t["geometry_msgs/msg/TransformStamped"](
            header=header_of(seq=number, stamp=stamp, frame_id="/map"),
            child_frame_id="/cam",
            transform=t["geometry_msgs/msg/Transform"](
                translation=vector(x=0.0, y=0.0, z=3.0),
                rotation=turn(**dict(zip("xyzw", QUATERNION, strict=True))),
            ),
        )
        write("/tf", tf_type, t[tf_type](transforms=[moved]), time_ns)
        lens = t["sensor_msgs/msg/CameraInfo"](
            header=head,
            height=HEIGHT,
            width=WIDTH,
            distortion_model="plumb_bob",
            D=np.array([0.1, -0.02, 0, 0, 0]),
            K=np.array(K),
            R=np.eye(3).ravel(),
            P=np.zeros(12),
            binning_x=0,
            binning_y=0,
            roi=t["sensor_msgs/msg/RegionOfInterest"](
                x_offset=0, y_offset=0, height=0, width=0, do_rectify=False
            ),
        )
        write("/info", "sensor_msgs/msg/CameraInfo", lens, time_ns)
        if raw:
            image = t["sensor_msgs/msg/Image"](
                header=head,
                height=HEIGHT,
                width=WIDTH,
                encoding="bgr8",
                is_bigendian=0,
                step=WIDTH * 3,
                data=np.frombuffer(RAW, np.uint8),
            )
            write("/image", "sensor_msgs/msg/Image", image, time_ns)
        else:
            data = np.frombuffer(JPEG, np.uint8)
            image = t["sensor_msgs/msg/CompressedImage"](header=head, format="jpeg", data=data)
            write("/image", "sensor_msgs/msg/CompressedImage", image, time_ns)
    writer.finish()
    check(path, boxes=False)
