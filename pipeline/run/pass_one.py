"""Pass 1: the pixels of one recording, read once, become columns; no picture is needed again.

ingest (a thread, ahead) -> decode (threads, ahead) -> detect -> track -> measure -> Parquet parts
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import Executor, ThreadPoolExecutor
from pathlib import Path
from typing import NamedTuple

from pipeline.core.camera_row import camera_table
from pipeline.core.config import Config, Limits
from pipeline.core.diagnostics import Notes, diagnostics_table
from pipeline.core.progress import Progress, Report, silent
from pipeline.core.records import Diagnostic, Severity
from pipeline.core.sensors.hints import WAYS_TO_GIVE_A_LENS
from pipeline.core.timing import NOTHING, StageTimes
from pipeline.ingest.cameras import unmatched
from pipeline.ingest.frames import FrameAssembler
from pipeline.mcap_file.reader import McapFile, Note
from pipeline.measure.frame_rows import Row, frame_row, frames_table, truth_table
from pipeline.measure.observations import Seen, observe
from pipeline.parallel.opencv_threads import OpenCvThreads
from pipeline.run.blur_queue import BlurLater, BlurQueue
from pipeline.run.camera_stage import Decoded
from pipeline.run.picture_stream import PictureStream
from pipeline.store.parquet_parts import PartWriter
from pipeline.store.recordings import RecordingRow

# Frames whose rows are gathered before they are written: large enough for columns to pay, small
# enough to be nothing in memory.
BATCH_FRAMES = 256

OpenFile = Callable[[Path, Limits, Note], McapFile]


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
    times.add("read", NOTHING)  # before two threads add to them
    times.threads["decode"] = times.threads["blur"] = threads
    notes = Notes()
    file = open_file(path, config.limits, notes.add)
    with (
        OpenCvThreads() as opencv,
        PartWriter(parts) as writer,
        ThreadPoolExecutor(threads) as pool,
    ):
        assembler = FrameAssembler(file, config.ingest, notes, config.camera)
        stream = PictureStream(assembler, config, notes, times, threads, opencv)
        blurs = BlurQueue(times, threads)
        return FirstPass(path, file, assembler, stream, blurs, notes, times, report).run(
            pool, writer
        )


class Kept(NamedTuple):
    """The rest of a frame that stays until its batch is written: no pixels."""

    seen: Seen
    frame_row: Row
    blur: BlurLater


class FirstPass:
    """One recording on its way through pass 1: frames in, batches of rows out."""

    def __init__(
        self,
        path: Path,
        file: McapFile,
        assembler: FrameAssembler,
        stream: PictureStream,
        blurs: BlurQueue,
        notes: Notes,
        times: StageTimes,
        report: Report,
    ) -> None:
        self.path = path
        self.file = file
        self.assembler = assembler
        self.stream = stream
        self.blurs = blurs
        self.notes = notes
        self.times = times
        self.report = report
        self.written = Written()

    def run(self, pool: Executor, parts: PartWriter) -> RecordingRow:
        """Read, decode, detect, track and measure; return what is known of the recording."""
        batch: list[Kept] = []
        for item in self.stream.decoded(pool):
            batch.append(self._keep(item, pool))
            if len(batch) >= BATCH_FRAMES:
                self._write_batch(batch, parts)
                batch = []
        stages = list(self.stream.stages.values())
        lines = pool.map(lambda stage: stage.background_lines(), stages)
        self._write_batch(batch, parts)
        for stage, edges in zip(stages, lines, strict=True):
            parts.write("tracks", stage.tracker.tracks())
            parts.write("background_lines", edges)
            stage.note_boxes_outside()
            frame_id = self.assembler.frame_ids.get(stage.camera)
            pose, moves = self.assembler.poses.get(stage.camera), self.assembler.moving
            camera = stage.row(frame_id, pose, moves=stage.camera in moves)
            parts.write("cameras", camera_table([camera]))
        self._note_absences()
        for note in self._unmatched():
            self.notes.add(note)
        parts.write("diagnostics", diagnostics_table(list(self.notes)))
        return self._recording_row()

    def _keep(self, item: Decoded, pool: Executor) -> Kept:
        """Take from a picture what needs its pixels, and let them go."""
        stage = self.stream.stages[item.frame.camera]
        seen = stage.follow(item, self.times)
        with self.times.stage("measure"):
            lens = stage.lens(seen.frame, seen.picture)
            row = frame_row(seen, lens, stage.stretch if seen.picture else None)
        return Kept(seen.without_pixels(), row, self.blurs.submit(stage, seen, lens, pool))

    def _write_batch(self, batch: list[Kept], parts: PartWriter) -> None:
        if not batch:
            return
        blurs = [self.blurs.result(kept.blur) for kept in batch]
        seen = [kept.seen for kept in batch]
        with self.times.stage("measure"):
            detectors = {name: stage.detector.name for name, stage in self.stream.stages.items()}
            observations = observe(seen, detectors, self.written.observations, blurs)
            parts.write("frames", frames_table([kept.frame_row for kept in batch]))
            parts.write("ground_truth", truth_table([s.frame for s in seen]))
            parts.write("observations", observations)
        times_ns = [s.frame.log_time_ns for s in seen]
        self.written = self.written.with_batch(times_ns, observations.num_rows)
        self._report(seen[-1].frame.byte_offset)

    def _report(self, byte_offset: int) -> None:
        fraction = min(byte_offset / max(self.file.size_bytes, 1), 1.0)
        slowest = self.times.slowest
        self.report(Progress(self.path.name, "measure", self.written.frames, fraction, slowest))

    def _unmatched(self) -> Iterator[Diagnostic]:
        """Yield notes on what the camera file states, and nothing in the recording matches."""
        topics = {channel.topic for channel in self.file.channels.values()}
        known, fields = self.assembler.cameras, self.assembler.named_fields
        return unmatched(self.stream.entries, known, topics, fields)

    def _note_absences(self) -> None:
        """Say what a recording lacks without which some numbers cannot be had."""
        if not self.stream.stages:
            text = "the recording holds no pictures that are read"
            self.notes.add(Diagnostic(Severity.WARNING, "no_images", text))
        for stage in self.stream.stages.values():
            if stage.intrinsics is None:
                text = (
                    "neither a calibration nor focal length and pixel pitch are known: "
                    "distances can be estimated only if enough people walk here to find the focal "
                    f"length; give {WAYS_TO_GIVE_A_LENS} in a camera file"
                )
                self.notes.add(
                    Diagnostic(
                        Severity.WARNING,
                        "no_lens_data",
                        text,
                        camera=stage.camera,
                        topic=stage.topic,
                    )
                )

    def _recording_row(self) -> RecordingRow:
        return RecordingRow(
            path=self.path,
            content_sha256=self.file.content_sha256,
            size_bytes=self.file.size_bytes,
            start_time_ns=self.written.start_time_ns,
            end_time_ns=self.written.end_time_ns,
            frame_count=self.written.frames,
            frames_lost=self.stream.undecodable + self.assembler.frames_lost,
            damaged=self.notes.lost_data,
        )


class Written(NamedTuple):
    """Extent of a recording that has been written as rows."""

    frames: int = 0
    observations: int = 0
    start_time_ns: int | None = None
    end_time_ns: int | None = None

    def with_batch(self, log_times_ns: list[int], observations: int) -> Written:
        """Return the same with a batch of frames more."""
        known = [t for t in (self.start_time_ns, self.end_time_ns) if t is not None]
        return Written(
            self.frames + len(log_times_ns),
            self.observations + observations,
            min(log_times_ns + known),
            max(log_times_ns + known),
        )
