"""Pass 1: the pixels of one recording, touched once. Out come columns; no picture is needed again.

ingest (a thread, ahead) -> decode (threads, ahead) -> detect -> track -> measure -> Parquet parts
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from dataclasses import asdict, replace
from itertools import chain
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np
import pyarrow as pa

from pipeline.core.arrays import BoolArray
from pipeline.core.config import Config, Limits
from pipeline.core.diagnostics import Notes, diagnostics_table
from pipeline.core.errors import UndecodableImage
from pipeline.core.lens import Lens, intrinsics_of, lens_of
from pipeline.core.progress import Progress, Report, silent
from pipeline.core.records import Diagnostic, Frame, Intrinsics, Severity
from pipeline.core.tables import CAMERAS, FRAMES, GROUND_TRUTH
from pipeline.core.timing import NOTHING, Spent, StageTimes, Stopwatch
from pipeline.detect import Detector, make_detector
from pipeline.images.decode import Picture, decode
from pipeline.images.raw import compressed
from pipeline.ingest.frames import FrameAssembler
from pipeline.ingest.plausibility import inside_picture
from pipeline.mcap_file.reader import McapFile, Note
from pipeline.measure.background_lines import Backdrop
from pipeline.measure.blur.widths import Blur, expected, measure_frame, unmeasured
from pipeline.measure.observations import Seen, luminance_inside, observe
from pipeline.optics.exposure import exposure_value_100, scene_luminance_cd_m2
from pipeline.parallel.prefetch import ahead
from pipeline.store.database import RecordingRow
from pipeline.store.parquet_parts import PartWriter, as_table
from pipeline.track.tracker import Tracker

# Frames whose rows are gathered before they are written: large enough for columns to pay, small
# enough to be nothing in memory.
BATCH_FRAMES = 256
# Frames go from the thread that reads to the one that uses them several at once, as every hand-over
# wakes a thread; and so many such lists are read before they are asked for.
READ_TOGETHER, READ_TOGETHER_BYTES = 4, 1024**2
READ_AHEAD = 2
# The detector learns from this many pictures, spread over its learning time, during which frames
# wait, still encoded, in at most this much memory: fifteen seconds of 1080p at 25 frames/s and 400 KB.
LEARNING_PICTURES = 25
LEARNING_BYTES = 160 * 1024**2
# Where neither the recording's nor the picture's size is known (nothing could be decoded).
NO_SIZE = (0, 0)

OpenFile = Callable[[Path, Limits, Note], McapFile]


class Decoded(NamedTuple):
    """A frame and its picture, None where it could not be decoded."""

    frame: Frame
    picture: Picture | None


class Timed(NamedTuple):
    """A picture and what it took to decode it."""

    picture: Picture
    spent: Spent


class Kept(NamedTuple):
    """What is left of a frame until its batch is written: no pixels."""

    seen: Seen
    frame_row: dict[str, object]
    blur: Blur | Future[tuple[Blur, Spent]]


class CameraStage:
    """What one camera's frames go through, and the state that lives between them."""

    def __init__(self, config: Config, camera: str, topic: str, *, recorded: bool) -> None:
        self.camera = camera
        self.topic = topic
        self.settings = config.camera_named(camera)
        self.detector: Detector = make_detector(config.detect, self.settings, recorded)
        self.tracker = Tracker(config.track, camera)
        self.backdrop = Backdrop()
        self.intrinsics: Intrinsics | None = None
        self.intrinsics_source: str | None = None
        self.size_px = NO_SIZE
        self.learning = self.detector.learning_s > 0
        self._waiting: list[Frame] = []
        self._held = 0  # bytes that wait

    def ready(self, frame: Frame) -> list[Frame]:
        """Return the frames that can go on: none while the detector's learning time lasts.

        What waits is encoded, so it is small; pictures for learning are decoded from it.
        """
        if not self.learning:
            return [frame]
        self._waiting.append(compressed(frame))
        waited_s = (frame.capture_time_ns - self._waiting[0].capture_time_ns) / 1e9
        self._held += len(self._waiting[-1].image)
        if waited_s < self.detector.learning_s and self._held < LEARNING_BYTES:
            return []
        return self.release()

    def release(self) -> list[Frame]:
        """End the learning time and return what waited, in order."""
        self.learning = False
        waiting, self._waiting = self._waiting, []
        return waiting

    def follow(self, item: Decoded, times: StageTimes) -> Seen:
        """Detect and track in one frame; frames must come in order."""
        frame, picture = item
        with times.stage("detect"):
            self.backdrop.add(picture)
            expected = self.tracker.expected(frame.capture_time_ns)
            boxes = self.detector.detect(frame, picture, expected)
        with times.stage("track"):
            ids = self.tracker.update(frame.capture_time_ns, frame.frame_index, boxes)
        with times.stage("measure"):
            return Seen(frame, picture, boxes, ids, luminance_inside(picture, boxes))


class FirstPass:
    """One recording on its way through pass 1."""

    def __init__(
        self,
        path: Path,
        config: Config,
        parts: Path,
        threads: int,
        report: Report,
        times: StageTimes,
        open_file: OpenFile = McapFile,
    ) -> None:
        self.path = path
        self.config = config
        self.notes = Notes()
        self.file = open_file(path, config.limits, self.notes.add)
        self.assembler = FrameAssembler(self.file, config.ingest, self.notes, config.camera)
        self.stages: dict[str, CameraStage] = {}
        self.batch: list[Kept] = []
        self.blurring: deque[Future[tuple[Blur, Spent]]] = deque()
        self.start_time_ns: int | None = None
        self.end_time_ns: int | None = None
        self.frame_count = 0
        self.undecodable = 0
        self.observation_count = 0
        self.threads = threads
        self.parts_folder = parts
        self.report = report
        self.times = times
        times.add("read", NOTHING)  # before two threads add to them
        times.threads["decode"] = times.threads["blur"] = threads

    def run(self) -> RecordingRow:
        """Read, decode, detect, track and measure; return what is known of the recording."""
        # The decoding threads keep the cores busy; OpenCV's own would only get in their way.
        cv2.setNumThreads(1)
        with PartWriter(self.parts_folder) as parts, ThreadPoolExecutor(self.threads) as pool:
            for item in self._decoded(pool):
                self.batch.append(self._keep(self._follow(item), pool))
                if len(self.batch) >= BATCH_FRAMES:
                    self._write_batch(parts)
            stages = list(self.stages.values())
            lines = pool.map(lambda stage: stage.backdrop.lines(stage.camera), stages)
            self._write_batch(parts)
            for stage, edges in zip(stages, lines, strict=True):
                parts.write("tracks", stage.tracker.tracks())
                parts.write("background_lines", edges)
                parts.write("cameras", self._camera_row(stage))
            self._note_absences()
            parts.write("diagnostics", diagnostics_table(list(self.notes)))
        return RecordingRow(
            path=self.path,
            content_sha256=self.file.content_sha256,
            size_bytes=self.file.size_bytes,
            start_time_ns=self.start_time_ns,
            end_time_ns=self.end_time_ns,
            frame_count=self.frame_count,
            frames_lost=self.undecodable + self.assembler.frames_lost,
            damaged=self.notes.lost_data,
        )

    def _follow(self, item: Decoded) -> Seen:
        """Detect and track in a frame, without recorded boxes that lie outside of its picture."""
        frame, picture = item
        if picture is not None and frame.detections is not None and len(frame.detections):
            size_px = picture.width_px, picture.height_px
            inside, outside = inside_picture(frame.detections, *size_px)
            for edges in outside:
                text = f"box {edges} lies outside of the picture of {size_px[0]} x {size_px[1]}"
                self._note(frame, "invalid_value", text)
            if outside:
                item = Decoded(replace(frame, detections=inside), picture)
        return self.stages[frame.camera].follow(item, self.times)

    def _read(self) -> Iterator[list[tuple[Frame, bool]]]:
        """Yield lists of frames, and whether their camera's detections were seen by then."""
        some: list[tuple[Frame, bool]] = []
        held = 0
        for frame in self.times.each("read", self.assembler):
            some.append((frame, self.assembler.has_detections(frame.camera)))
            held += len(frame.image)
            if len(some) >= READ_TOGETHER or held >= READ_TOGETHER_BYTES:
                yield some
                some, held = [], 0
        yield some

    def _frames(self, pool: Executor) -> Iterator[Frame]:
        """Yield frames whose camera's detector is ready for them."""
        for frame, recorded in chain.from_iterable(ahead(self._read(), READ_AHEAD)):
            stage = self.stages.get(frame.camera)
            if stage is None:
                stage = CameraStage(self.config, frame.camera, frame.topic, recorded=recorded)
                self.stages[frame.camera] = stage
            yield from self._taught(stage, stage.ready(frame), pool)
        for stage in self.stages.values():
            yield from self._taught(stage, stage.release(), pool)

    def _taught(self, stage: CameraStage, frames: list[Frame], pool: Executor) -> list[Frame]:
        """Return the frames after the detector has learned from them, if they waited for that."""
        if len(frames) > 1:
            spread = np.linspace(0, len(frames) - 1, min(LEARNING_PICTURES, len(frames)))
            sample = [frames[round(i)] for i in spread]
            with self.times.stage("learn"):
                pictures = list(pool.map(self._try_decode, sample))
                stage.detector.learn([p for p in pictures if p is not None])
        return frames

    def _try_decode(self, frame: Frame) -> Picture | None:
        try:
            return self._decode(frame).picture
        except UndecodableImage:
            return None  # it is reported when its turn comes

    def _decode(self, frame: Frame, *, whole: bool = False) -> Timed:
        detector = self.stages[frame.camera].detector
        full = whole or detector.full_resolution
        limits = self.config.limits
        with Stopwatch() as watch:
            picture = decode(
                frame.image,
                max_pixels=limits.image_pixels,
                max_scans=limits.image_scans,
                full_resolution=full,
                min_side_px=self.config.detect.min_side_px,
                layout=frame.layout,
            )
            if not whole:
                picture = detector.prepared(picture)
        return Timed(picture, watch.spent)

    def _decoded(self, pool: Executor) -> Iterator[Decoded]:
        """Yield frames in order with their pictures, decoded in threads a few frames ahead."""
        ahead: deque[tuple[Frame, Future[Timed]]] = deque()
        for frame in self._frames(pool):
            ahead.append((frame, pool.submit(self._decode, frame)))
            if len(ahead) > 2 * self.threads + 2:
                yield self._result(*ahead.popleft())
        while ahead:
            yield self._result(*ahead.popleft())

    def _result(self, frame: Frame, future: Future[Timed]) -> Decoded:
        try:
            with self.times.stage("wait for decode"):
                picture, spent = future.result()
            self.times.add("decode", spent)
            return Decoded(frame, picture)
        except UndecodableImage as error:
            self.undecodable += 1
            self.notes.add(
                Diagnostic(
                    Severity.ERROR,
                    "undecodable_image",
                    f"the picture was left out: {error.problem}",
                    camera=frame.camera,
                    topic=frame.topic,
                    byte_offset=frame.byte_offset,
                    log_time_ns=frame.log_time_ns,
                )
            )
            return Decoded(frame, None)

    def _keep(self, seen: Seen, pool: Executor) -> Kept:
        """Take from a picture what needs its pixels, and let them go."""
        with self.times.stage("measure"):
            lens = self._lens(seen.frame, seen.picture)
            row = self._frame_row(seen, lens)
            worth = expected(seen.boxes, lens, self.config, seen.frame.camera)
            if not worth.any():
                return Kept(seen.without_pixels(), row, unmeasured(len(seen.boxes), lens))
        blur = pool.submit(self._blur, seen, worth, lens)
        self.blurring.append(blur)
        # Each that waits holds a picture: no more of them than of frames decoded ahead.
        if len(self.blurring) > 2 * self.threads + 2:
            with self.times.stage("wait for blur"):
                self.blurring.popleft().result()
        return Kept(seen.without_pixels(), row, blur)

    def _blur(self, seen: Seen, worth: BoolArray, lens: Lens) -> tuple[Blur, Spent]:
        """Measure how blurred the boxes of a frame are that its lens data say can tell."""
        frame = seen.frame
        with Stopwatch() as watch:
            blur = measure_frame(
                seen.picture,
                seen.boxes,
                worth,
                lens,
                self.config,
                frame.camera,
                lambda: self._decode(frame, whole=True).picture,
            )
        return blur, watch.spent

    def _lens(self, frame: Frame, picture: Picture | None) -> Lens:
        stage = self.stages[frame.camera]
        size_px = (picture.width_px, picture.height_px) if picture else stage.size_px
        return lens_of(frame.exposure, stage.settings, frame.intrinsics, *size_px)

    def _write_batch(self, parts: PartWriter) -> None:
        batch, self.batch = self.batch, []
        if not batch:
            return
        blurs = []
        for kept in batch:
            if isinstance(kept.blur, Blur):
                blurs.append(kept.blur)
                continue
            blur, spent = kept.blur.result()
            blurs.append(blur)
            self.times.add("blur", spent)
        seen = [kept.seen for kept in batch]
        with self.times.stage("measure"):
            parts.write("frames", _with_light([kept.frame_row for kept in batch]))
            self._write_rows(seen, blurs, parts)
        fraction = min(seen[-1].frame.byte_offset / max(self.file.size_bytes, 1), 1.0)
        slowest = self.times.slowest
        self.report(Progress(self.path.name, "measure", self.frame_count, fraction, slowest))

    def _write_rows(self, batch: list[Seen], blurs: list[Blur], parts: PartWriter) -> None:
        parts.write("ground_truth", _truth_rows([seen.frame for seen in batch]))
        detectors = {name: stage.detector.name for name, stage in self.stages.items()}
        observations = observe(batch, detectors, self.observation_count, blurs)
        self.observation_count += observations.num_rows
        parts.write("observations", observations)
        times_ns = [seen.frame.log_time_ns for seen in batch]
        known = [t for t in (self.start_time_ns, self.end_time_ns) if t is not None]
        self.start_time_ns, self.end_time_ns = min(times_ns + known), max(times_ns + known)
        self.frame_count += len(batch)

    def _frame_row(self, seen: Seen, lens: Lens) -> dict[str, object]:
        frame, picture, exposure = seen.frame, seen.picture, seen.frame.exposure
        stage = self.stages[frame.camera]
        size_px = (picture.width_px, picture.height_px) if picture else stage.size_px
        if picture is not None:
            self._learn_intrinsics(stage, frame, lens, size_px)
        return {
            "camera": frame.camera,
            "frame_index": frame.frame_index,
            "log_time_ns": frame.log_time_ns,
            "capture_time_ns": frame.capture_time_ns,
            "image_format": frame.image_format,
            "image_bytes": len(frame.image),
            "width_px": picture.width_px if picture else None,
            "height_px": picture.height_px if picture else None,
            "decoded": picture is not None,
            "exposure_pairing": str(frame.exposure_pairing),
            "exposure_offset_ns": frame.exposure_offset_ns,
            "exposure_time_s": exposure.exposure_time_s,
            "f_number": lens.f_number,
            "iso_speed": exposure.iso_speed,
            "exposure_bias_ev": exposure.exposure_bias_ev,
            "gain_db": exposure.gain_db,
            "focal_length_mm": lens.focal_length_mm,
            "focus_distance_m": lens.focus_distance_m,
            "pixel_pitch_x_um": lens.pixel_pitch_x_um,
            "pixel_pitch_y_um": lens.pixel_pitch_y_um,
            "luminance": picture.luminance if picture else None,
            "clipped_fraction": picture.clipped_fraction if picture else None,
        }

    def _learn_intrinsics(
        self, stage: CameraStage, frame: Frame, lens: Lens, size_px: tuple[int, int]
    ) -> None:
        """Keep the first usable intrinsics of a camera; say when a later picture differs."""
        if size_px != stage.size_px:
            if stage.size_px != NO_SIZE:
                self._note(frame, "size_changed", f"the pictures change their size to {size_px}")
            stage.size_px = size_px
        elif stage.intrinsics is not None and (
            stage.intrinsics_source == "recording" or frame.intrinsics is None
        ):
            return
        found, source, complaint = intrinsics_of(frame.intrinsics, stage.settings, lens, *size_px)
        if complaint:
            self._note(frame, "doubtful_calibration", complaint)
        if found is not None:
            stage.intrinsics, stage.intrinsics_source = found, source

    def _note(self, frame: Frame, code: str, message: str) -> None:
        self.notes.add(
            Diagnostic(
                Severity.WARNING,
                code,
                message,
                camera=frame.camera,
                topic=frame.topic,
                log_time_ns=frame.log_time_ns,
            )
        )

    def _note_absences(self) -> None:
        """Say what a recording lacks without which some numbers cannot be had."""
        if not self.stages:
            self.notes.add(
                Diagnostic(
                    Severity.WARNING, "no_images", "the recording holds no pictures that are read"
                )
            )
        for stage in self.stages.values():
            if stage.intrinsics is None:
                self.notes.add(
                    Diagnostic(
                        Severity.WARNING,
                        "no_lens_data",
                        "neither a calibration nor focal length and pixel pitch are known: "
                        "distances can be told only if enough people walk here to find the focal "
                        "length; give lens data in a camera file",
                        camera=stage.camera,
                        topic=stage.topic,
                    )
                )

    def _camera_row(self, stage: CameraStage) -> pa.Table:
        intrinsics = stage.intrinsics
        row = dict.fromkeys(CAMERAS.names) | {
            "camera": stage.camera,
            "topic": stage.topic,
            "frame_id": self.assembler.frame_ids.get(stage.camera),
            "width_px": stage.size_px[0] or None,
            "height_px": stage.size_px[1] or None,
            "intrinsics_source": stage.intrinsics_source,
        }
        pose = self.assembler.poses.get(stage.camera)
        if pose is not None:
            row |= {
                "recorded_height_m": pose.height_m,
                "recorded_tilt_rad": pose.tilt_rad,
                "recorded_roll_rad": pose.roll_rad,
                "recorded_ground_frame": pose.ground_frame,
            }
        if intrinsics is not None:
            row |= asdict(intrinsics) | {"distortion": list(intrinsics.distortion)}
        return as_table({name: [value] for name, value in row.items()}, CAMERAS)


def measure_recording(
    path: Path,
    config: Config,
    parts: Path,
    *,
    threads: int = 2,
    report: Report = silent,
    times: StageTimes | None = None,
    open_file: OpenFile = McapFile,
) -> RecordingRow:
    """Run pass 1 over a recording; its tables are written to the folder `parts`.

    Args:
        path: the recording.
        config: how to work it.
        parts: a folder, created if need be.
        threads: how many decode pictures.
        report: is told how far it is.
        times: is added to, stage by stage.
        open_file: gives the messages; a part of them, for one.

    Raises:
        NotARecording: the file is empty, or is no MCAP.
    """
    times = StageTimes() if times is None else times
    return FirstPass(path, config, parts, threads, report, times, open_file).run()


def _with_light(rows: list[dict[str, object]]) -> pa.Table:
    """Return rows of the table `frames`, with what the exposure says of the light in the scene."""
    columns: dict[str, Sequence[object]] = {name: [row[name] for row in rows] for name in rows[0]}
    settings = [
        np.array(columns[name], dtype=np.float64)
        for name in ("f_number", "exposure_time_s", "iso_speed")
    ]
    columns["ev100"] = exposure_value_100(*settings).tolist()
    columns["scene_luminance_cd_m2"] = scene_luminance_cd_m2(
        settings[0], settings[1], settings[2]
    ).tolist()
    return as_table(columns, FRAMES)


def _truth_rows(frames: list[Frame]) -> pa.Table:
    rows = [(frame, truth) for frame in frames for truth in frame.truth]
    columns: dict[str, Sequence[object]] = {
        "camera": [frame.camera for frame, _ in rows],
        "frame_index": [frame.frame_index for frame, _ in rows],
    }
    for name in GROUND_TRUTH.names:
        if name not in columns and not name.endswith("_px"):
            columns[name] = [getattr(truth, name) for _, truth in rows]
    for side, name in enumerate(("x_min_px", "y_min_px", "x_max_px", "y_max_px")):
        columns[name] = [truth.bbox_xyxy_px[side] for _, truth in rows]
    return as_table(columns, GROUND_TRUTH)
