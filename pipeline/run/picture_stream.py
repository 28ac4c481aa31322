"""Pictures of a recording in order, read and decoded ahead of their use.

ingest (a thread, ahead) -> learning time of the detectors -> decode (threads, ahead)
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator
from concurrent.futures import Executor, Future
from dataclasses import replace
from itertools import chain
from typing import NamedTuple

import numpy as np

from pipeline.core.config import Config
from pipeline.core.diagnostics import Notes
from pipeline.core.errors import UndecodableImage
from pipeline.core.records import Diagnostic, Frame, Severity
from pipeline.core.timing import Spent, StageTimes, Stopwatch
from pipeline.images.decode import Picture
from pipeline.ingest.frames import FrameAssembler
from pipeline.ingest.video.video_stream import READ_CODECS
from pipeline.parallel.opencv_threads import OpenCvThreads
from pipeline.parallel.prefetch import ahead
from pipeline.run.camera_stage import LEARNING_PICTURES, CameraStage, Decoded

# Frames go from the thread that reads to the one that uses them several at once, as every hand-over
# wakes a thread; and so many such lists are read before they are asked for.
READ_TOGETHER, READ_TOGETHER_BYTES = 4, 1024**2
READ_AHEAD = 2


class Timed(NamedTuple):
    """A picture and the time that it took to decode it."""

    picture: Picture
    spent: Spent


class PictureStream:
    """The frames of a recording with their pictures, and a stage for each camera met so far.

    Args:
        assembler: gives the frames.
        config: how to work them.
        notes: receives what could not be decoded.
        times: is added to, stage by stage.
        threads: how many decode, which is how far ahead they may be.
        opencv: OpenCV's thread count while the stream is used.
    """

    def __init__(
        self,
        assembler: FrameAssembler,
        config: Config,
        notes: Notes,
        times: StageTimes,
        threads: int,
        opencv: OpenCvThreads,
    ) -> None:
        self.stages: dict[str, CameraStage] = {}
        self.entries = config.camera  # of the camera file
        self.undecodable = 0
        self._assembler = assembler
        self._config = config
        self._notes = notes
        self._times = times
        self._ahead = 2 * threads + 2
        self._opencv = opencv

    def decoded(self, pool: Executor) -> Iterator[Decoded]:
        """Yield frames in order with their pictures, decoded in threads a few frames ahead."""
        waiting: deque[tuple[Frame, Future[Timed]]] = deque()
        for frame in self._frames(pool):
            waiting.append((frame, pool.submit(self._decode, frame)))
            if len(waiting) > self._ahead:
                yield self._result(*waiting.popleft())
        while waiting:
            yield self._result(*waiting.popleft())

    def _read(self) -> Iterator[list[tuple[Frame, bool]]]:
        """Yield lists of frames, and whether their camera's detections were seen by then."""
        some: list[tuple[Frame, bool]] = []
        held_bytes = 0
        for frame in self._chosen(self._times.each("read", self._assembler)):
            some.append((frame, self._assembler.has_detections(frame.camera)))
            held_bytes += len(frame.image)
            if len(some) >= READ_TOGETHER or held_bytes >= READ_TOGETHER_BYTES:
                yield some
                some, held_bytes = [], 0
        yield some

    def _chosen(self, frames: Iterable[Frame]) -> Iterator[Frame]:
        """Yield every so manieth frame of each camera, numbered anew; the others are never decoded.

        What belongs to a picture was taken for it already, so no box or truth goes to another.
        """
        every = self._config.ingest.every
        seen: dict[str, int] = {}
        topics: dict[str, str] = {}
        for frame in frames:
            number = seen.get(frame.camera, 0)
            seen[frame.camera] = number + 1
            topics[frame.camera] = frame.topic
            if every == 1:
                yield frame
            elif number % every == 0:
                yield replace(frame, frame_index=number // every)
        for camera, count in seen.items() if every > 1 else ():
            self._notes.add(_skipped(camera, topics[camera], count, every))

    def _frames(self, pool: Executor) -> Iterator[Frame]:
        """Yield frames whose camera's detector is ready for them."""
        for frame, recorded in chain.from_iterable(ahead(self._read(), READ_AHEAD)):
            stage = self.stages.get(frame.camera) or self._new_stage(frame, recorded)
            yield from self._taught(stage, stage.ready(frame), pool)
        for stage in self.stages.values():
            yield from self._taught(stage, stage.release(), pool)

    def _new_stage(self, frame: Frame, recorded: bool) -> CameraStage:
        stage = CameraStage(self._config, frame.camera, frame.topic, self._notes, recorded=recorded)
        if stage.detector.runs_on_opencv or (stage.verifier and stage.verifier.runs_on_opencv):
            self._opencv.use_all_cores()
        self.stages[frame.camera] = stage
        return stage

    def _taught(self, stage: CameraStage, frames: list[Frame], pool: Executor) -> list[Frame]:
        """Return the frames after the detector has learned from them, if they waited for that."""
        if len(frames) > 1:
            spread = np.linspace(0, len(frames) - 1, min(LEARNING_PICTURES, len(frames)))
            sample = [frames[round(i)] for i in spread]
            with self._times.stage("learn"):
                pictures = list(pool.map(self._try_decode, sample))
                stage.detector.learn([p for p in pictures if p is not None])
        return frames

    def _try_decode(self, frame: Frame) -> Picture | None:
        try:
            return self.stages[frame.camera].decode(frame)
        except UndecodableImage:
            return None  # it is reported when its turn comes

    def _decode(self, frame: Frame) -> Timed:
        with Stopwatch() as watch:
            picture = self.stages[frame.camera].decode(frame)
        return Timed(picture, watch.spent)

    def _result(self, frame: Frame, future: Future[Timed]) -> Decoded:
        try:
            with self._times.stage("wait for decode"):
                picture, spent = future.result()
            self._times.add("decode", spent)
            return Decoded(frame, picture)
        except UndecodableImage as error:
            self.undecodable += 1
            if frame.image or frame.image_format not in READ_CODECS:  # else it is told as a gap
                self._notes.add(_undecodable(frame, error))
            return Decoded(frame, None)


def _skipped(camera: str, topic: str, count: int, every: int) -> Diagnostic:
    """Return the note of pictures that were left out by request."""
    used = -(-count // every)
    text = (
        f"one of {every} pictures was measured, {used:,} of {count:,}, as asked for (`--every`); "
        "the others are in no table"
    )
    return Diagnostic(Severity.INFO, "frames_skipped", text, camera=camera, topic=topic)


def _undecodable(frame: Frame, error: UndecodableImage) -> Diagnostic:
    return Diagnostic(
        Severity.ERROR,
        "undecodable_image",
        f"the picture was left out: {error.problem}",
        camera=frame.camera,
        topic=frame.topic,
        byte_offset=frame.byte_offset,
        log_time_ns=frame.log_time_ns,
    )
