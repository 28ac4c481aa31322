"""Recordings whose clocks are wrong, and whose messages stand in another order than their pictures."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest

from pipeline.core.config import Config
from pipeline.core.diagnostics import Notes
from pipeline.core.records import Boxes, Frame, Intrinsics, Pairing
from pipeline.ingest.frames import FrameAssembler
from pipeline.mcap_file.reader import McapFile
from pipeline.mcap_file.writer import (
    RecordingWriter,
    calibration_message,
    image_message,
    timestamp,
)
from pipeline.track.tracker import Tracker
from schemas.stadimeter_pb2 import CameraExposure, Detections

START_NS = 1_700_000_000_000_000_000
MS, S = 1_000_000, 1_000_000_000
DAY = 86_400 * S
FRAME = 100 * MS
COUNT = 40


def read(path: Path) -> tuple[list[Frame], Notes]:
    config, notes = Config(), Notes()
    file = McapFile(path, config.limits, notes.add)
    return list(FrameAssembler(file, config.ingest, notes)), notes


def image(number: int, stamp_ns: int):
    """Return picture `number`; its bytes are its number."""
    message = image_message(b"%d" % number, "jpeg", max(stamp_ns, 0), "cam")
    if stamp_ns < 0:
        message.ClearField("timestamp")
    return message


def boxes(number: int, stamp_ns: int) -> Detections:
    """Return a box whose left edge is the number of its picture."""
    found = Detections(frame_id="cam")
    if stamp_ns >= 0:
        found.timestamp.CopyFrom(timestamp(stamp_ns))
    edges = {"x_min_px": number, "y_min_px": 2, "x_max_px": number + 9, "y_max_px": 40}
    found.objects.add(box=edges, class_name="person")
    return found


Clock = Callable[[int], int]


def true_clock(number: int) -> int:
    return START_NS + number * FRAME


def record(
    path: Path,
    *,
    image_stamp: Clock = true_clock,
    image_log: Clock = true_clock,
    box_stamp: Clock = true_clock,
    box_log: Clock = lambda n: true_clock(n) + 5 * MS,
    order: str = "live",
    count: int = COUNT,
) -> Path:
    """Write a recording of pictures and of a box for each, on clocks as given."""
    pictures = [(image_log(n), "/cam/i", image(n, image_stamp(n))) for n in range(count)]
    found = [(box_log(n), "/cam/d", boxes(n, box_stamp(n))) for n in range(count)]
    rows: Sequence[tuple[int, str, object]] = {
        "live": sorted([*pictures, *found], key=lambda row: row[0]),
        "pictures first": [*pictures, *found],
        "boxes first": [*found, *pictures],
        "backwards": sorted([*pictures, *found], key=lambda row: -row[0]),
        "as written": [row for pair in zip(pictures, found, strict=True) for row in pair],
    }[order]
    with RecordingWriter(path) as writer:
        for log_ns, topic, message in rows:
            writer.write(topic, message, log_ns)  # type: ignore[arg-type]
    return path


def paired(frames: list[Frame]) -> int:
    """Return how many pictures have their own box, and none another's."""
    own = 0
    for frame in frames:
        if frame.detections is not None and len(frame.detections):
            assert frame.detections.bbox_xyxy_px[0, 0] == int(frame.image)
            own += 1
    return own


def codes(notes: Notes) -> set[str]:
    return {note.code for note in notes}


def steps_s(frames: list[Frame]) -> np.ndarray:
    return np.diff([f.capture_time_ns for f in frames]) / 1e9


@pytest.mark.parametrize("order", ["live", "pictures first", "boxes first", "backwards"])
def test_the_order_in_the_file_does_not_matter(tmp_path: Path, order: str) -> None:
    frames, notes = read(record(tmp_path / "x.mcap", order=order))
    assert [int(f.image) for f in frames] == list(range(COUNT))
    assert paired(frames) == COUNT
    assert not codes(notes)


@pytest.mark.parametrize("behind_s", [6, 100, 86_400])
def test_boxes_logged_long_after_their_pictures_are_read_first(
    tmp_path: Path, behind_s: int
) -> None:
    log = lambda n: true_clock(n) + behind_s * S  # noqa: E731
    frames, notes = read(record(tmp_path / "x.mcap", box_log=log, order="pictures first"))
    assert paired(frames) == COUNT
    assert codes(notes) == {"logged_behind"}


def test_boxes_logged_long_before_their_pictures_wait(tmp_path: Path) -> None:
    log = lambda n: true_clock(n) - 100 * S  # noqa: E731
    frames, notes = read(record(tmp_path / "x.mcap", box_log=log))
    assert paired(frames) == COUNT
    assert not codes(notes)


@pytest.mark.parametrize("late_ms", [300, 900, 2500])
def test_pictures_wait_for_a_slow_detector(tmp_path: Path, late_ms: int) -> None:
    log = lambda n: true_clock(n) + late_ms * MS  # noqa: E731
    frames, notes = read(record(tmp_path / "x.mcap", box_log=log))
    assert paired(frames) >= COUNT - 2
    assert len(frames) == COUNT
    assert "paired_by_nearest" not in codes(notes)


@pytest.mark.parametrize("late_ms", [12, 45, 70, 85])
def test_stamps_of_a_detector_of_its_own_find_the_picture_before(
    tmp_path: Path, late_ms: int
) -> None:
    late = lambda n: true_clock(n) + late_ms * MS + (n % 3) * MS  # noqa: E731
    frames, notes = read(record(tmp_path / "x.mcap", box_stamp=late, box_log=late))
    assert paired(frames) == COUNT
    assert codes(notes) == {"paired_by_nearest"}
    assert f"{late_ms + 1:.1f} ms" in next(iter(notes)).message


@pytest.mark.parametrize(
    "clocks",
    [
        {"image_stamp": lambda n: 0},  # the driver leaves it out
        {"image_stamp": lambda n: -1},
        {"box_stamp": lambda n: true_clock(n) - 3600 * S},
        {"box_stamp": lambda n: n * FRAME + 5_000 * S},  # since the machine was started
        {"image_stamp": lambda n: n * FRAME + 5_000 * S},
        {"image_stamp": lambda n: true_clock(n) - 54 * 365 * DAY + 12 * S},
        {"image_stamp": lambda n: START_NS, "box_stamp": lambda n: START_NS},  # one for all
        {"image_stamp": lambda n: true_clock(n) // S * S},  # whole seconds
        {
            "image_stamp": lambda n: true_clock(n) // S * S,
            "box_stamp": lambda n: true_clock(n) // S * S,
        },
        {"image_stamp": lambda n: true_clock(n) // 1000},  # microseconds taken for nanoseconds
        {"image_stamp": lambda n: true_clock(n) // 10**6},
        {
            "image_stamp": lambda n: true_clock(n) // 1000,
            "box_stamp": lambda n: true_clock(n) // 1000,
        },
    ],
)
def test_where_stamps_cannot_be_compared_log_times_are(
    tmp_path: Path, clocks: dict[str, Clock]
) -> None:
    frames, notes = read(record(tmp_path / "x.mcap", **clocks))
    assert paired(frames) == COUNT
    assert steps_s(frames) == pytest.approx(0.1, abs=1e-3)
    same = len(clocks) == 2 and "time_unit" in codes(notes)
    assert same or "paired_by_log_time" in codes(notes)


@pytest.mark.parametrize("ahead_ns", [DAY, -DAY, 365 * DAY])
@pytest.mark.parametrize("number", [0, 7, COUNT - 1])
def test_one_stamp_a_day_off_changes_nothing_else(
    tmp_path: Path, ahead_ns: int, number: int
) -> None:
    stamp = lambda n: true_clock(n) + (ahead_ns if n == number else 0)  # noqa: E731
    frames, notes = read(record(tmp_path / "x.mcap", image_stamp=stamp))
    assert paired(frames) == COUNT
    assert steps_s(frames) == pytest.approx(0.1, abs=0.02)
    assert "time_outlier" in codes(notes)


@pytest.mark.parametrize("what", ["image_log", "box_log"])
@pytest.mark.parametrize("ahead_ns", [DAY, -DAY])
def test_one_message_logged_a_day_off_changes_nothing_else(
    tmp_path: Path, ahead_ns: int, what: str
) -> None:
    log = lambda n: true_clock(n) + 5 * MS + (ahead_ns if n == 11 else 0)  # noqa: E731
    frames, _ = read(record(tmp_path / "x.mcap", order="as written", **{what: log}))
    assert paired(frames) >= COUNT - 1
    assert len(frames) == COUNT
    others = [f for f in frames if int(f.image) != 11]
    assert [int(f.image) for f in others] == [n for n in range(COUNT) if n != 11]
    assert steps_s(others)[11:] == pytest.approx(0.1, abs=1e-6)


@pytest.mark.parametrize("step_ns", [3600 * S, -3600 * S, -2 * S, 20 * S])
def test_a_clock_of_stamps_that_is_set_goes_on(tmp_path: Path, step_ns: int) -> None:
    stamp = lambda n: true_clock(n) + (step_ns if n >= 20 else 0)  # noqa: E731
    frames, notes = read(record(tmp_path / "x.mcap", image_stamp=stamp, box_stamp=stamp))
    assert paired(frames) == COUNT
    assert steps_s(frames) == pytest.approx(0.1, abs=0.02)
    assert "clock_step" in codes(notes)


@pytest.mark.parametrize("step_ns", [-500 * MS, -1 * S, -2 * S, -2_030 * MS])
def test_a_recorder_whose_clock_is_set_back_is_read_as_it_stands(
    tmp_path: Path, step_ns: int
) -> None:
    clock = lambda n: true_clock(n) + (step_ns if n >= 20 else 0)  # noqa: E731
    box_log = lambda n: clock(n) + 5 * MS  # noqa: E731
    path = record(
        tmp_path / "x.mcap",
        image_stamp=clock,
        image_log=clock,
        box_stamp=clock,
        box_log=box_log,
        order="as written",
    )
    frames, notes = read(path)
    assert [int(f.image) for f in frames] == list(range(COUNT))
    assert paired(frames) >= COUNT - 1
    assert steps_s(frames) == pytest.approx(0.1, abs=1e-3)
    assert "clock_step" in codes(notes)


def test_a_log_whose_clock_is_set_forward_leaves_the_stamps(tmp_path: Path) -> None:
    log = lambda n: true_clock(n) + (7 * S if n >= 20 else 0)  # noqa: E731
    path = record(tmp_path / "x.mcap", image_log=log, box_log=lambda n: log(n) + 5 * MS)
    frames, notes = read(path)
    assert paired(frames) == COUNT
    assert steps_s(frames) == pytest.approx(0.1)
    assert codes(notes) == {"clock_step"}


def test_log_times_that_are_all_the_same_leave_the_stamps(tmp_path: Path) -> None:
    one = lambda n: START_NS  # noqa: E731
    path = record(tmp_path / "x.mcap", image_log=one, box_log=one, order="as written")
    frames, _ = read(path)
    assert paired(frames) == COUNT
    assert steps_s(frames) == pytest.approx(0.1)


def test_pictures_without_any_times_are_told(tmp_path: Path) -> None:
    one = lambda n: START_NS  # noqa: E731
    path = record(tmp_path / "x.mcap", image_log=one, image_stamp=one)
    _, notes = read(path)
    assert "no_times" in codes(notes)


def test_boxes_that_find_no_picture_are_counted(tmp_path: Path) -> None:
    away = lambda n: true_clock(n) + 1000 * S  # noqa: E731
    path = record(tmp_path / "x.mcap", box_stamp=away, box_log=away)
    frames, notes = read(path)
    assert paired(frames) == 0
    told = next(n for n in notes if n.code == "unpaired_boxes")
    assert told.count == COUNT
    assert "copy the stamps" in told.message


def test_boxes_of_another_camera_are_counted(tmp_path: Path) -> None:
    path = tmp_path / "x.mcap"
    with RecordingWriter(path) as writer:
        for n in range(5):
            for name in ("a", "b"):
                message = image_message(b"x", "jpeg", true_clock(n), name)
                writer.write(f"/{name}/i", message, true_clock(n))
            found = boxes(n, true_clock(n))
            found.frame_id = "elsewhere"
            writer.write("/d", found, true_clock(n))
    _, notes = read(path)
    told = next(n for n in notes if n.code == "unpaired_boxes")
    assert told.count == 5
    assert "none of the cameras a, b" in told.message


def test_exposure_of_a_clock_54_years_away_is_paired_by_log_times_or_not_at_all(
    tmp_path: Path,
) -> None:
    for by_log, pairing in ((True, Pairing.NEAREST), (False, Pairing.NONE)):
        path = tmp_path / f"{by_log}.mcap"
        with RecordingWriter(path) as writer:
            for n in range(COUNT):
                stamp_ns = n * FRAME + S
                message = CameraExposure(
                    timestamp=timestamp(stamp_ns), frame_id="cam", f_number=2.0 + n
                )
                writer.write("/e", message, true_clock(n) if by_log else stamp_ns)
                writer.write("/i", image(n, true_clock(n)), true_clock(n))
        frames, notes = read(path)
        assert {f.exposure_pairing for f in frames} == {pairing}
        assert ("unused_exposure" in codes(notes)) is (not by_log)
        if by_log:
            assert [f.exposure.f_number for f in frames] == [2.0 + n for n in range(COUNT)]


def test_a_slow_camera_has_a_wide_tolerance(tmp_path: Path) -> None:
    clock = lambda n: START_NS + n * S  # noqa: E731
    late = lambda n: START_NS + n * S + 300 * MS + n % 4 * 10 * MS  # noqa: E731
    path = record(
        tmp_path / "x.mcap", image_stamp=clock, image_log=clock, box_stamp=late, box_log=late
    )
    frames, _ = read(path)
    assert paired(frames) == COUNT


def test_a_frame_that_has_no_boxes_takes_none_of_its_neighbours(tmp_path: Path) -> None:
    path = tmp_path / "x.mcap"
    times = np.cumsum([0, *([20, 100, 60] * 12)]) * MS + START_NS
    with RecordingWriter(path) as writer:
        for n, time_ns in enumerate(times.tolist()):
            writer.write("/cam/i", image(n, time_ns), time_ns)
            if n % 4:
                writer.write("/cam/d", boxes(n, time_ns), time_ns + MS)
    frames, _ = read(path)
    assert paired(frames) == sum(1 for n in range(len(times)) if n % 4)


def test_the_tracker_begins_anew_where_time_falls_back() -> None:
    tracker = Tracker(Config().track, "cam")
    box = Boxes(np.array([[0.0, 0, 20, 60]]), np.ones(1), ("person",), np.ones((1, 4)), (None,))
    times = [*range(0, 10 * FRAME, FRAME), DAY, *range(10 * FRAME, 40 * FRAME, FRAME)]
    ids = [int(tracker.update(t, n, box)[0]) for n, t in enumerate(times)]
    assert len(set(ids)) <= 3
    assert len(set(ids[11:])) == 1


def test_lens_and_exposure_of_no_camera_are_told(tmp_path: Path) -> None:
    path = tmp_path / "x.mcap"
    with RecordingWriter(path) as writer:
        for n in range(5):
            for name in ("a", "b"):
                message = image_message(b"x", "jpeg", true_clock(n), name)
                writer.write(f"/{name}/i", message, true_clock(n))
            lens = calibration_message(
                Intrinsics(640, 480, 500.0, 500.0, 319.5, 239.5), true_clock(n), "elsewhere"
            )
            writer.write("/lens", lens, true_clock(n))
            known = CameraExposure(timestamp=timestamp(true_clock(n)), frame_id="a", f_number=4)
            writer.write("/a/e", known, true_clock(n))
            known.frame_id = "elsewhere"
            writer.write("/e", known, true_clock(n))
    _, notes = read(path)
    told = {n.code: n.message for n in notes}
    assert "5 messages with calibration" in told["unused_calibration"]
    assert "a, b has none" in told["unused_calibration"]
    assert "b has none" in told["unused_exposure"]
