"""Recordings that are intact and say something odd: right, or told; each situation changes one scene."""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import cv2
import numpy as np
import pytest
from google.protobuf.message import Message

import stadimeter
from pipeline.core.config import CameraConfig, Config
from pipeline.core.records import Intrinsics
from pipeline.mcap_file.writer import (
    RecordingWriter,
    calibration_message,
    image_message,
    timestamp,
)
from pipeline.optics.pinhole import PinholeCamera
from schemas.stadimeter_pb2 import CameraExposure, Detections, GroundTruth

START_NS, SECOND_NS, MS_NS = 1_700_000_000_000_000_000, 1_000_000_000, 1_000_000
LENS = Intrinsics(640, 480, 500.0, 500.0, 319.5, 239.5)
TILT, ABOVE_M = np.deg2rad(15.0), 4.0
POSE = Config(camera=(CameraConfig("cam", camera_height_m=ABOVE_M, tilt_deg=15.0, roll_deg=0.0),))
SIDES = ("x_min_px", "y_min_px", "x_max_px", "y_max_px")
FRAMES = 40


class Said(NamedTuple):
    """One message of a recording."""

    topic: str
    log_ns: int
    message: Any


def box_of(x_m: float, ahead_m: float, height_m: float) -> tuple[list[float], float]:
    camera = PinholeCamera(LENS.fx_px, LENS.fy_px, LENS.cx_px, LENS.cy_px)
    ends = []
    for up_m in (0.0, height_m):
        down = ABOVE_M - up_m
        y, z = (
            down * np.cos(TILT) - ahead_m * np.sin(TILT),
            ahead_m * np.cos(TILT) + down * np.sin(TILT),
        )
        ends.append(camera.project(np.array([x_m, y, z])))
    (x, low), (_, high) = ends
    half = 0.2 * (low - high)
    depth_m = ahead_m * np.cos(TILT) + ABOVE_M * np.sin(TILT)
    return [float(x - half), float(high), float(x + half), float(low)], float(depth_m)


@cache
def scene() -> tuple[Said, ...]:
    """Four people who walk, ten frames a second, each frame with boxes, truth, lens and exposure."""
    grain = np.random.default_rng(0).integers(60, 160, (480, 640, 3)).astype(np.uint8)
    said = []
    for index in range(FRAMES):
        t_s, ns = index / 10, START_NS + index * 100 * MS_NS
        grain[0, 0] = index  # no two pictures are equal
        image = cv2.imencode(".jpg", cv2.GaussianBlur(grain, (0, 0), 3))[1].tobytes()
        found = Detections(timestamp=timestamp(ns), frame_id="cam", detector="hand")
        truth = GroundTruth(timestamp=timestamp(ns), frame_id="cam")
        for i in range(4):
            height_m = 1.6 + 0.06 * i
            x_m, ahead_m = -2.5 + 1.2 * t_s + 0.8 * i, 9 + 4 * i + np.sin(0.5 * t_s + i)
            edges, depth_m = box_of(x_m, ahead_m, height_m)
            box = dict(zip(SIDES, edges, strict=True))
            found.objects.add(box=box, class_name="person", object_id=f"p{i}", box_std_px=0.5)
            truth.objects.add(
                object_id=f"p{i}",
                class_name="person",
                depth_m=depth_m,
                height_m=height_m,
                box=box,
            )
        exposure = CameraExposure(timestamp=timestamp(ns), frame_id="cam", f_number=4.0)
        exposure.exposure_time_s = 0.01 + 0.0001 * index
        said += [
            Said("/cam/info", ns + MS_NS, calibration_message(LENS, ns, "cam")),
            Said("/cam/exposure", ns + 2 * MS_NS, exposure),
            Said("/cam/image", ns + 3 * MS_NS, image_message(image, "jpeg", ns, "cam")),
            Said("/cam/found", ns + 30 * MS_NS, found),
            Said("/cam/truth", ns + 30 * MS_NS, truth),
        ]
    return tuple(said)


def stamp_of(message: Message) -> int:
    stamp: Any = message.timestamp  # type: ignore[attr-defined]
    return int(stamp.seconds * SECOND_NS + stamp.nanos)


def restamped(*topics: str, to: Callable[[int], float]) -> Iterator[Said]:
    for one in scene():
        if one.topic in topics:
            message = copy.deepcopy(one.message)
            message.timestamp.CopyFrom(timestamp(max(int(to(stamp_of(message))), 0)))
            yield one._replace(message=message)
        else:
            yield one


def with_boxes(change: Callable[[list[float]], list[float]]) -> Iterator[Said]:
    for one in scene():
        if one.topic != "/cam/found":
            yield one
            continue
        message = copy.deepcopy(one.message)
        for found in message.objects:
            edges = change([getattr(found.box, side) for side in SIDES])
            for side, value in zip(SIDES, edges, strict=True):
                setattr(found.box, side, value)
        yield one._replace(message=message)


def changed(topic: str, change: Callable[[Any], None]) -> Iterator[Said]:
    """Yield the scene with the messages of a topic changed in place."""
    for one in scene():
        if one.topic == topic:
            one = one._replace(message=copy.deepcopy(one.message))
            change(one.message)
        yield one


def in_millimetres(truth: Any) -> None:
    for true in truth.objects:
        true.depth_m, true.height_m = 1000 * true.depth_m, 1000 * true.height_m


def in_milliseconds(exposure: Any) -> None:
    exposure.exposure_time_s *= 1000


def folding(lens: Any) -> None:
    lens.distortion_model = "plumb_bob"
    lens.D[:] = [-1.5, 0.0, 0.0, 0.0, 0.0]


class Outcome(NamedTuple):
    """Result of a run."""

    depths: int
    ratio: float  # median of found over true depth
    codes: set[str]
    in_doubt: bool
    exposed: int  # frames whose exposure is that of their own time


def outcome(folder: Path, said: Iterator[Said] | tuple[Said, ...]) -> Outcome:
    with RecordingWriter(folder / "a.mcap") as writer:
        for one in sorted(said, key=lambda s: s.log_ns):
            writer.write(one.topic, one.message, one.log_ns)
    stadimeter.measure(folder / "a.mcap", folder / "x.duckdb", camera=POSE, strict=False)
    with stadimeter.open(folder / "x.duckdb") as results:
        summary = stadimeter.summarize(results)
        row = results.query(
            """
            SELECT count(*) AS n, median(e.depth_m / m.true_depth_m) AS ratio
            FROM current_estimates AS e JOIN matches AS m USING (recording_id, observation_index)
            WHERE method = 'fused'
            """
        ).rows()[0]
        exposed = results.query(
            "SELECT count(*) AS n FROM frames "
            "WHERE abs(exposure_time_s - 0.01 - 0.0001 * frame_index) < 1e-9"
        ).rows()[0]["n"]
        codes = {f.code for f in summary.findings if f.severity != "info"}
    return Outcome(row["n"], row["ratio"] or np.nan, codes, summary.in_doubt, exposed)


def drifting(share: float) -> Callable[[int], float]:
    return lambda ns: START_NS + (ns - START_NS) * (1 + share)


BOXES = ("/cam/found", "/cam/truth")
RIGHT: dict[str, Callable[[], Any]] = {
    "as it is": scene,
    "every message twice, as two recorders write it": lambda: (
        *scene(),
        *(s._replace(log_ns=s.log_ns + MS_NS // 2) for s in scene()),
    ),
    "one picture ten times": lambda: (
        *scene(),
        *[s for s in scene() if s.topic == "/cam/image"][20:21] * 9,
    ),
    "boxes in whole seconds": lambda: restamped(*BOXES, to=lambda ns: ns // SECOND_NS * SECOND_NS),
    "pictures in whole seconds": lambda: restamped(
        "/cam/image", to=lambda ns: ns // SECOND_NS * SECOND_NS
    ),
    "boxes an hour ahead": lambda: restamped(*BOXES, to=lambda ns: ns + 3600 * SECOND_NS),
    "boxes since boot": lambda: restamped(*BOXES, to=lambda ns: ns - START_NS + 77 * SECOND_NS),
    "boxes in microseconds": lambda: restamped(*BOXES, to=lambda ns: ns // 1000),
    "exposure 0.3 s ahead": lambda: restamped("/cam/exposure", to=lambda ns: ns + 300 * MS_NS),
    "pictures whose clock is slewed": lambda: restamped("/cam/image", to=drifting(0.0005)),
    "all stamps back an hour": lambda: restamped(
        *("/cam/image", "/cam/info", "/cam/exposure", *BOXES),
        to=lambda ns: ns - (3600 * SECOND_NS if ns > START_NS + 2 * SECOND_NS else 0),
    ),
    "pictures whose clock is set back an hour": lambda: restamped(
        "/cam/image", to=lambda ns: ns - (3600 * SECOND_NS if ns > START_NS + 2 * SECOND_NS else 0)
    ),
    "the lens in the last message alone": lambda: (
        *(s for s in scene() if s.topic != "/cam/info"),
        *[s for s in scene() if s.topic == "/cam/info"][-1:],
    ),
}


@pytest.fixture(scope="module")
def right(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Outcome]:
    """Give the outcome of a situation, made once."""
    return cache(lambda name: outcome(tmp_path_factory.mktemp("right"), RIGHT[name]()))


@pytest.mark.parametrize("name", RIGHT)
def test_every_box_is_measured_right(right: Callable[[str], Outcome], name: str) -> None:
    found = right(name)
    assert found.depths == 4 * FRAMES
    assert found.ratio == pytest.approx(1.0, abs=0.02)


@pytest.mark.parametrize(
    ("name", "code"),
    [
        ("every message twice, as two recorders write it", "repeated_message"),
        ("one picture ten times", "repeated_message"),
        ("boxes in whole seconds", "paired_by_log_time"),
        ("pictures in whole seconds", "stamps_unused"),
        ("all stamps back an hour", "clock_step"),
    ],
)
def test_it_is_told(right: Callable[[str], Outcome], name: str, code: str) -> None:
    found = right(name)
    assert code in found.codes
    assert found.in_doubt


@pytest.mark.parametrize("name", ["as it is", "the lens in the last message alone"])
def test_nothing_is_told_where_nothing_is_odd(right: Callable[[str], Outcome], name: str) -> None:
    found = right(name)
    assert found.codes == set()
    assert found.exposed == FRAMES


def letterboxed(box: list[float]) -> list[float]:
    return [box[0], box[1] + 80, box[2], box[3] + 80]


TOLD: dict[str, tuple[Callable[[], Any], str]] = {
    "a clock ten times too fast": (
        lambda: [
            s._replace(
                log_ns=START_NS + (s.log_ns - START_NS) // 10,
                message=t.message,
            )
            for s, t in zip(
                scene(),
                restamped(*("/cam/image", "/cam/info", "/cam/exposure", *BOXES), to=drifting(-0.9)),
                strict=True,
            )
        ],
        "impossible_speeds",
    ),
    "boxes of a picture twice as large": (
        lambda: with_boxes(lambda box: [2 * v for v in box]),
        "boxes_of_another_size",
    ),
    "boxes in thousandths": (
        lambda: with_boxes(
            lambda b: [b[0] / 0.64, b[1] / 0.48, b[2] / 0.64, b[3] / 0.48],
        ),
        "boxes_of_another_size",
    ),
    "boxes of a picture half as large": (
        lambda: with_boxes(lambda box: [v / 2 for v in box]),
        "impossible_people",
    ),
    "boxes of a letterboxed picture": (lambda: with_boxes(letterboxed), "impossible_people"),
    "columns and rows exchanged": (
        lambda: with_boxes(lambda b: [b[1], b[0], b[3], b[2]]),
        "impossible_people",
    ),
    "rows counted from below": (
        lambda: with_boxes(lambda b: [b[0], 479 - b[3], b[2], 479 - b[1]]),
        "impossible_people",
    ),
    "boxes of heads": (
        lambda: with_boxes(lambda b: [b[0], b[1], b[2], b[1] + 0.15 * (b[3] - b[1])]),
        "impossible_people",
    ),
    "width and height for the far corner": (
        lambda: with_boxes(lambda b: [b[0], b[1], b[2] - b[0], b[3] - b[1]]),
        "invalid_value",
    ),
    "boxes of a clock that runs 2 % fast": (
        lambda: restamped(*BOXES, to=drifting(0.02)),
        "paired_by_nearest",
    ),
    "pictures whose clock jumps by 0.3 s": (
        lambda: restamped(
            "/cam/image",
            to=lambda ns: ns + (300 * MS_NS if ns > START_NS + 2 * SECOND_NS else 0),
        ),
        "unpaired_boxes",
    ),
    "exposure always 60 ms before": (
        lambda: restamped("/cam/exposure", to=lambda ns: ns - 60 * MS_NS),
        "exposure_offset",
    ),
    "true depths in millimetres": (
        lambda: changed("/cam/truth", in_millimetres),
        "truth_contradicted",
    ),
    "exposure times in milliseconds": (
        lambda: changed("/cam/exposure", in_milliseconds),
        "impossible_exposure_time",
    ),
    "a distortion that folds over in the picture": (
        lambda: changed("/cam/info", folding),
        "doubtful_lens",
    ),
}


@pytest.mark.parametrize("name", TOLD)
def test_what_makes_numbers_wrong_is_told(tmp_path: Path, name: str) -> None:
    make, code = TOLD[name]
    found = outcome(tmp_path, make())
    assert code in found.codes
    assert found.in_doubt
