"""Pass 1: the pixels of one recording, touched once. Out come columns; no picture is needed again.

    ingest -> decode (threads, ahead) -> detect -> track -> measure -> Parquet parts
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import asdict
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pyarrow as pa

from pipeline.config import Config
from pipeline.detect import Detector, make_detector
from pipeline.diagnostics import Notes, diagnostics_table
from pipeline.errors import UndecodableImage
from pipeline.ingest.frames import FrameAssembler
from pipeline.ingest.lens import Lens, intrinsics_of, lens_of
from pipeline.ingest.mcap_records import McapFile
from pipeline.measure import observe
from pipeline.optics.exposure import exposure_value_100, scene_luminance_cd_m2
from pipeline.picture import Picture, decode
from pipeline.progress import Progress, Report, silent
from pipeline.records import (
    CAMERAS,
    FRAMES,
    GROUND_TRUTH,
    OBSERVATIONS,
    TRACKS,
    Boxes,
    Diagnostic,
    Frame,
    Intrinsics,
    Severity,
)
from pipeline.store.database import RecordingRow
from pipeline.store.parts import PartWriter, as_table
from pipeline.track import Tracker

# Frames whose rows are gathered before they are written: large enough for columns to pay, small
# enough to be nothing in memory.
BATCH_FRAMES = 256
# Where neither the recording's nor the picture's size is known (nothing could be decoded).
NO_SIZE = (0, 0)


class Decoded(NamedTuple):
    """A frame and its picture; `error` says why there is none."""

    frame: Frame
    picture: Picture | None
    error: str | None


class CameraStage:
    """What one camera's frames go through, and the state that lives between them."""

    def __init__(self, config: Config, camera: str, *, recorded: bool) -> None:
        self.camera = camera
        self.settings = config.camera_named(camera)
        self.detector: Detector = make_detector(config.detect, self.settings, recorded)
        self.tracker = Tracker(config.track, camera)
        self.intrinsics: Intrinsics | None = None
        self.intrinsics_source: str | None = None
        self.size_px = NO_SIZE
        self.topic = ""
        self._learning: list[Decoded] | None = [] if self.detector.learning_pictures else None

    def take(self, item: Decoded) -> Iterator[tuple[Decoded, Boxes, np.ndarray]]:
        """Yield the frame with its boxes and track ids, and those that waited for the background."""
        if self._learning is None:
            yield self._follow(item)
            return
        self._learning.append(item)
        if len(self._learning) >= self.detector.learning_pictures:
            yield from self.finish()

    def finish(self) -> Iterator[tuple[Decoded, Boxes, np.ndarray]]:
        """Yield what still waits: the background is learned from as many pictures as there are."""
        waiting, self._learning = self._learning or [], None
        if waiting:
            self.detector.learn([d.picture for d in waiting if d.picture is not None])
        for item in waiting:
            yield self._follow(item)

    def _follow(self, item: Decoded) -> tuple[Decoded, Boxes, np.ndarray]:
        boxes = self.detector.detect(item.frame, item.picture)
        return item, boxes, self.tracker.update(item.frame.capture_time_ns, boxes)


class FirstPass:
    """One recording on its way through pass 1."""

    def __init__(
        self, path: Path, config: Config, parts: Path, threads: int, report: Report
    ) -> None:
        self.path = path
        self.config = config
        self.notes = Notes()
        self.file = McapFile(path, config.limits, self.notes.add)
        self.assembler = FrameAssembler(self.file, config.ingest, self.notes)
        self.stages: dict[str, CameraStage] = {}
        self.batch: list[tuple[Decoded, Boxes, np.ndarray]] = []
        self.times_ns: list[int] = []
        self.frame_count = 0
        self.undecodable = 0
        self.observation_count = 0
        self.threads = threads
        self.parts_folder = parts
        self.report = report

    def run(self) -> RecordingRow:
        """Read, decode, detect, track and measure; return what is known of the recording."""
        with PartWriter(self.parts_folder) as parts:
            for item in self._decoded():
                for followed in self._stage(item.frame).take(item):
                    self._gather(followed, parts)
            for stage in self.stages.values():
                for followed in stage.finish():
                    self._gather(followed, parts)
            self._write_batch(parts)
            for stage in self.stages.values():
                parts.write("tracks", stage.tracker.tracks().cast(TRACKS))
                parts.write("cameras", self._camera_row(stage))
            self._note_absences()
            parts.write("diagnostics", diagnostics_table(list(self.notes)))
        lost = self.undecodable + self.notes.count("lost_frames")
        return RecordingRow(
            path=self.path,
            content_sha256=self.file.content_sha256,
            size_bytes=self.file.size_bytes,
            start_time_ns=min(self.times_ns, default=None),
            end_time_ns=max(self.times_ns, default=None),
            frame_count=self.frame_count,
            frames_lost=lost,
            damaged=self.notes.lost_data,
        )

    def _stage(self, frame: Frame) -> CameraStage:
        stage = self.stages.get(frame.camera)
        if stage is None:
            recorded = self.assembler.has_detections(frame.camera)
            stage = CameraStage(self.config, frame.camera, recorded=recorded)
            self.stages[frame.camera] = stage
            stage.topic = frame.topic
        return stage

    def _decoded(self) -> Iterator[Decoded]:
        """Yield frames in order with their pictures, decoded in threads a few frames ahead."""
        with ThreadPoolExecutor(self.threads) as pool:
            ahead: deque[tuple[Frame, Future[Picture]]] = deque()
            for frame in self.assembler:
                full = self._stage(frame).detector.full_resolution
                max_pixels = self.config.limits.image_pixels
                future = pool.submit(
                    decode, frame.image, max_pixels=max_pixels, full_resolution=full
                )
                ahead.append((frame, future))
                if len(ahead) > 2 * self.threads + 2:
                    yield self._result(*ahead.popleft())
            while ahead:
                yield self._result(*ahead.popleft())

    def _result(self, frame: Frame, future: Future[Picture]) -> Decoded:
        try:
            return Decoded(frame, future.result(), None)
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
            return Decoded(frame, None, error.problem)

    def _gather(self, followed: tuple[Decoded, Boxes, np.ndarray], parts: PartWriter) -> None:
        self.batch.append(followed)
        if len(self.batch) >= BATCH_FRAMES:
            self._write_batch(parts)

    def _write_batch(self, parts: PartWriter) -> None:
        batch, self.batch = self.batch, []
        if not batch:
            return
        frames = [self._frame_row(item) for item, _, _ in batch]
        parts.write("frames", _columns(frames, FRAMES))
        parts.write("ground_truth", _columns(_truth_rows(batch), GROUND_TRUTH))
        observations = observe(
            [(item.frame, item.picture, boxes, ids) for item, boxes, ids in batch],
            detectors={name: stage.detector.name for name, stage in self.stages.items()},
            first_index=self.observation_count,
        )
        self.observation_count += observations.num_rows
        parts.write("observations", observations.cast(OBSERVATIONS))
        last = batch[-1][0].frame
        self.frame_count += len(batch)
        self.times_ns += [min(f["log_time_ns"] for f in frames), max(f["log_time_ns"] for f in frames)]
        fraction = min(last.byte_offset / max(self.file.size_bytes, 1), 1.0)
        self.report(Progress(self.path.name, "measure", self.frame_count, fraction))

    def _frame_row(self, item: Decoded) -> dict[str, object]:
        frame, picture, exposure = item.frame, item.picture, item.frame.exposure
        stage = self.stages[frame.camera]
        size_px = (picture.width_px, picture.height_px) if picture else stage.size_px
        lens = lens_of(exposure, stage.settings, frame.intrinsics, *size_px)
        if picture is not None:
            self._learn_intrinsics(stage, frame, lens, size_px)
        ev100 = exposure_value_100(lens.f_number, exposure.exposure_time_s, exposure.iso_speed)
        scene = scene_luminance_cd_m2(lens.f_number, exposure.exposure_time_s, exposure.iso_speed)
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
            "iso_speed": exposure.iso_speed,
            "exposure_bias_ev": exposure.exposure_bias_ev,
            "gain_db": exposure.gain_db,
            **asdict(lens),
            "luminance": picture.luminance if picture else None,
            "clipped_fraction": picture.clipped_fraction if picture else None,
            "ev100": float(ev100),
            "scene_luminance_cd_m2": float(scene),
        }

    def _learn_intrinsics(
        self, stage: CameraStage, frame: Frame, lens: Lens, size_px: tuple[int, int]
    ) -> None:
        """Keep the first usable intrinsics of a camera; say when a later picture differs."""
        if stage.size_px != size_px and stage.size_px != NO_SIZE:
            self._note(frame, "size_changed", f"the pictures change size to {size_px}")
        if stage.intrinsics_source == "recording" or (
            stage.intrinsics is not None and frame.intrinsics is None
        ):
            return
        stage.size_px = size_px
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
                        "no distance can be told; give them in a camera file",
                        camera=stage.camera,
                        topic=stage.topic,
                    )
                )

    def _camera_row(self, stage: CameraStage) -> pa.Table:
        intrinsics = stage.intrinsics
        row = {name: None for name in CAMERAS.names} | {
            "camera": stage.camera,
            "topic": stage.topic,
            "frame_id": self.assembler.frame_ids.get(stage.camera),
            "width_px": stage.size_px[0] or None,
            "height_px": stage.size_px[1] or None,
            "intrinsics_source": stage.intrinsics_source,
        }
        if intrinsics is not None:
            row |= asdict(intrinsics) | {"distortion": list(intrinsics.distortion)}
        return as_table({name: [value] for name, value in row.items()}, CAMERAS)


def measure_recording(
    path: Path, config: Config, parts: Path, *, threads: int = 2, report: Report = silent
) -> RecordingRow:
    """Run pass 1 over a recording; its tables are written to the folder `parts`.

    Raises:
        NotARecording: the file is empty, or is no MCAP.
    """
    return FirstPass(path, config, parts, threads, report).run()


def _columns(rows: list[dict[str, object]], schema: pa.Schema) -> pa.Table:
    return as_table({name: [row[name] for row in rows] for name in schema.names}, schema)


def _truth_rows(batch: list[tuple[Decoded, Boxes, np.ndarray]]) -> list[dict[str, object]]:
    edges = ("x_min_px", "y_min_px", "x_max_px", "y_max_px")
    return [
        {
            "camera": item.frame.camera,
            "frame_index": item.frame.frame_index,
            **{n: getattr(t, n) for n in GROUND_TRUTH.names if hasattr(t, n)},
            **dict(zip(edges, t.bbox_xyxy_px, strict=True)),
        }
        for item, _, _ in batch
        for t in item.frame.truth
    ]
