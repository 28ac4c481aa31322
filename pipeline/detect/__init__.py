"""Detection of objects in frames: one protocol, one table of detectors, one file for each.

A new detector is a file with a function `make(config, camera)`, and its row in `DETECTORS`. The command
line's choices, the check of the configuration and pass 1 read the table.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol, cast

from pipeline.core.errors import UsageError

if TYPE_CHECKING:  # the command line reads the table, and should not load numpy and OpenCV for it
    from pipeline.core.config import CameraConfig, DetectConfig
    from pipeline.core.records import Boxes, Expected, Frame
    from pipeline.images.decode import Picture

AUTO = "auto"
# Detectors whose boxes are somebody's statement, and stay as they are.
AS_GIVEN = ("recorded", "roi")


class Detector(Protocol):
    """Finds objects in the frames of one camera, in order of time."""

    @property
    def name(self) -> str:
        """Mark of its observations, in the column `detector`."""

    @property
    def learning_s(self) -> float:
        """Length of the recording's beginning that it wants to see before its first answer."""

    @property
    def full_resolution(self) -> bool:
        """Return whether it needs every pixel of the stored picture."""

    @property
    def runs_on_opencv(self) -> bool:
        """Return whether OpenCV runs a network for it, which wants all cores."""

    def prepared(self, picture: Picture) -> Picture:
        """Return a picture with what can be done to it alone: in any order, in several threads."""

    def learn(self, pictures: Sequence[Picture]) -> None:
        """Look at pictures spread over the first `learning_s`; called once, if that is positive."""

    def detect(
        self, frame: Frame, picture: Picture | None, expected: Expected | None = None
    ) -> Boxes:
        """Return the objects of a frame.

        Args:
            frame: the frame.
            picture: None if it could not be decoded.
            expected: boxes predicted from the previous frames.
        """


@dataclass(frozen=True, slots=True)
class DetectorRow:
    """One way to find objects."""

    name: str  # in a camera file and on the command line
    text: str  # one line of help
    needs: str  # what must be given or recorded; empty: nothing
    module: str  # whose function `make(config, camera)` returns it
    # Whether `auto` takes it for a camera, given whether the recording holds detections.
    suits: Callable[[CameraConfig, bool], bool] = lambda camera, recorded: False
    # Whether it depends on the configuration alone, so that it is tried before any footage is read.
    tried_first: bool = False


# By precedence: `auto` takes the first that suits.
DETECTORS: tuple[DetectorRow, ...] = (
    DetectorRow(
        "recorded",
        "the detections that the recording holds",
        "detections in the recording",
        "pipeline.detect.recorded",
        suits=lambda camera, recorded: recorded,
    ),
    DetectorRow(
        "roi",
        "the one object in a region of interest (the paper's cropping)",
        "roi_xyxy_px of the camera in the camera file",
        "pipeline.detect.roi",
        suits=lambda camera, recorded: bool(camera.roi_xyxy_px),
    ),
    DetectorRow(
        "motion",
        "objects that differ from the learned background of a fixed camera",
        "",
        "pipeline.detect.motion.detector",
        suits=lambda camera, recorded: True,
    ),
    DetectorRow(
        "onnx",
        "objects that a network finds",
        "an ONNX file (--model FILE)",
        "pipeline.detect.network.detector",
        tried_first=True,
    ),
)
CHOICES = (AUTO, *(row.name for row in DETECTORS))


def make_detector(config: DetectConfig, camera: CameraConfig, recorded: bool) -> Detector:
    """Return the detector for a camera.

    Args:
        config: names the method; `auto` takes the first row of `DETECTORS` that suits.
        camera: the camera's entry in the camera file.
        recorded: whether the recording holds detections for the camera.

    Raises:
        UsageError: the method is unknown, or lacks what it needs.
        UnusableModel: the network's file is no model, or not one that is understood.
    """
    if config.method == AUTO:
        row = next(row for row in DETECTORS if row.suits(camera, recorded))
    else:
        row = _row_named(config.method)
    return cast(Detector, importlib.import_module(row.module).make(config, camera))


def check_detector(config: DetectConfig) -> None:
    """Try what can be tried before hours of footage: the method's name, and a network's file.

    Raises:
        UsageError: the method is unknown, or lacks what it needs.
        UnusableModel: the network's file is no model, or not one that is understood.
    """
    from pipeline.core.config import CameraConfig

    if config.method != AUTO and _row_named(config.method).tried_first:
        make_detector(config, CameraConfig(""), recorded=False)
    elif config.model:
        from pipeline.detect.verify import make_verifier

        make_verifier(config)


def _row_named(name: str) -> DetectorRow:
    for row in DETECTORS:
        if row.name == name:
            return row
    known = ", ".join(CHOICES[:-1])
    raise UsageError(f"unknown detector {name!r}", remedy=f"Known are {known} and {CHOICES[-1]}")
