"""Finding objects in a frame: one small protocol, and one file for each way.

recorded:   the detections that the recording holds
roi:        a region of interest in which one object stands (the paper's cropping)
motion:     what differs from the learned background of a fixed camera
onnx:       a network from a file that the user has
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from pipeline.core.config import CameraConfig, DetectConfig
from pipeline.core.errors import UsageError
from pipeline.core.records import Boxes, Expected, Frame
from pipeline.detect.motion.detector import MotionDetector
from pipeline.detect.network.detector import OnnxDetector
from pipeline.detect.recorded import RecordedDetector
from pipeline.detect.roi import RoiDetector
from pipeline.images.decode import Picture


class Detector(Protocol):
    """Finds objects in the frames of one camera, in order of time."""

    @property
    def name(self) -> str:
        """What the observations are marked with."""

    @property
    def learning_s(self) -> float:
        """How much of the recording it wants to see before its first answer."""

    @property
    def full_resolution(self) -> bool:
        """Whether it needs every pixel of the stored picture."""

    def prepared(self, picture: Picture) -> Picture:
        """Return a picture with what can be done to it alone: in any order, in several threads."""

    def learn(self, pictures: Sequence[Picture]) -> None:
        """Look at pictures spread over the first `learning_s`; called once, if that is positive."""

    def detect(
        self, frame: Frame, picture: Picture | None, expected: Expected | None = None
    ) -> Boxes:
        """Return the objects of a frame.

        Args:
            frame: which.
            picture: None where it could not be decoded.
            expected: where the frames before say that objects are.
        """


def make_detector(config: DetectConfig, camera: CameraConfig, recorded: bool) -> Detector:
    """Return the detector for a camera.

    `auto` takes the recorded detections if there are any, else the region of interest if the camera
    file gives one, else motion.

    Raises:
        UsageError: the method is unknown, or lacks what it needs.
        UnusableModel: the network's file is no model, or not one that is understood.
    """
    method = config.method
    if method == "auto":
        method = "recorded" if recorded else "roi" if camera.roi_xyxy_px else "motion"
    if method == "recorded":
        return RecordedDetector()
    if method == "roi":
        return RoiDetector(camera)
    if method == "motion":
        return MotionDetector(config)
    if method == "onnx":
        return OnnxDetector(config)
    raise UsageError(
        f"unknown detector {method!r}", remedy="Known are auto, recorded, roi, motion and onnx"
    )
