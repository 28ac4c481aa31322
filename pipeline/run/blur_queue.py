"""Blur of boxes, measured in threads while the frames after them are followed."""

from __future__ import annotations

from collections import deque
from concurrent.futures import Executor, Future

from pipeline.core.arrays import BoolArray
from pipeline.core.lens import Lens
from pipeline.core.timing import Spent, StageTimes, Stopwatch
from pipeline.measure.blur.widths import Blur, expected, measure_frame, unmeasured
from pipeline.measure.observations import Seen
from pipeline.run.camera_stage import CameraStage

# The blur of a frame, or the promise of it.
BlurLater = Blur | Future[tuple[Blur, Spent]]


class BlurQueue:
    """Frames whose blur is being measured: each holds a picture, so their number is bounded."""

    def __init__(self, times: StageTimes, threads: int) -> None:
        self._times = times
        self._longest = 2 * threads + 2  # no more pictures than are decoded ahead
        self._running: deque[Future[tuple[Blur, Spent]]] = deque()

    def submit(self, stage: CameraStage, seen: Seen, lens: Lens, pool: Executor) -> BlurLater:
        """Have the boxes of a frame measured whose lens data say that their blur tells anything."""
        with self._times.stage("measure"):
            worth = expected(seen.boxes, lens, stage.config, seen.frame.camera)
            if not worth.any():
                return unmeasured(len(seen.boxes), lens)
        blur = pool.submit(self._measure, stage, seen, worth, lens)
        self._running.append(blur)
        if len(self._running) > self._longest:
            with self._times.stage("wait for blur"):
                self._running.popleft().result()
        return blur

    def _measure(
        self, stage: CameraStage, seen: Seen, worth: BoolArray, lens: Lens
    ) -> tuple[Blur, Spent]:
        with Stopwatch() as watch:
            blur = measure_frame(
                seen.picture,
                seen.boxes,
                worth,
                lens,
                stage.config,
                seen.frame.camera,
                lambda: stage.decode_whole(seen.frame),
            )
        return blur, watch.spent

    def result(self, blur: BlurLater) -> Blur:
        """Wait for the blur of a frame."""
        if isinstance(blur, Blur):
            return blur
        measured, spent = blur.result()
        self._times.add("blur", spent)
        return measured
