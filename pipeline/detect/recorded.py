"""Detector that returns the detections of the recording, unchanged."""

from __future__ import annotations

from collections.abc import Sequence

from pipeline.core.config import CameraConfig, DetectConfig
from pipeline.core.records import Boxes, Expected, Frame
from pipeline.images.decode import Picture


class RecordedDetector:
    """Passes on what a detector, or a person with a ruler, wrote into the recording."""

    name = "recorded"
    learning_s = 0.0
    full_resolution = False
    runs_on_opencv = False

    def prepared(self, picture: Picture) -> Picture:
        """Return it as it is."""
        return picture

    def learn(self, pictures: Sequence[Picture]) -> None:
        """Learn nothing."""

    def detect(
        self, frame: Frame, picture: Picture | None, expected: Expected | None = None
    ) -> Boxes:
        """Return the recorded boxes of the frame."""
        return frame.detections if frame.detections is not None else Boxes.empty()


def make(config: DetectConfig, camera: CameraConfig) -> RecordedDetector:
    """Return the detector, for the table `DETECTORS`."""
    return RecordedDetector()
