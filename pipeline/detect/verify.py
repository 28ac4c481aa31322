"""People whom motion finds confirmed by a network, which looks at some of the frames only.

A network on every frame costs more than all else together. On every fifth it sees each track often
enough to tell whether it is a person, and motion finds where everybody is meanwhile.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from pipeline.core.arrays import NAN, BoolArray, FloatArray, IntArray
from pipeline.core.config import DetectConfig
from pipeline.core.records import Boxes, Frame
from pipeline.detect.network.detector import OnnxDetector
from pipeline.detect.pose_verify import PoseVerifier, is_tflite
from pipeline.images.decode import Picture

# That something is a person at all takes less than to find one: half of the usual least score.
SCORE_SHARE = 0.5
# A share of so many looks is known to 0.15. Frames that hold nobody else are looked at seldom: the
# tracker may have taken somebody else for them meanwhile.
ENOUGH_LOOKS, AGAIN_S = 10, 4.0
# Boxes of motion and of a network, around one person who is partly hidden, share a third and more.
LEAST_OVERLAP = 0.3


def make_verifier(config: DetectConfig) -> Verifier | PoseVerifier:
    """Return the verifier for the configured model: a pose network (TFLite), or a detector (ONNX).

    Raises:
        UsageError: the configuration names an unknown family or backend.
        UnusableModel: the file is no model, or not one that is understood.
    """
    return PoseVerifier(config) if is_tflite(Path(config.model)) else Verifier(config)


class Verifier:
    """A network that looks at every n-th frame of a camera.

    Raises:
        UsageError: the configuration names an unknown family or backend.
        UnusableModel: the file is no model, or its outputs are not understood.
    """

    def __init__(self, config: DetectConfig) -> None:
        self._every = max(config.verify_every, 1)
        asked = replace(config, min_score=SCORE_SHARE * config.min_score)
        self._network = OnnxDetector(asked, every_class=True)
        self._classes = config.classes
        self._looks = Counter[int]()  # by track
        self._looked_ns = -(1 << 62)
        self.runs_on_opencv = self._network.runs_on_opencv

    def confirmed(
        self,
        frame: Frame,
        boxes: Boxes,
        track_ids: IntArray,
        whole: BoolArray,
        decoded: Callable[[Frame], Picture],
    ) -> FloatArray | None:
        """Return 1 for each box with a person in it, 0 without, NaN for a part; None in most frames.

        Args:
            frame: the frame.
            boxes: of the motion detector.
            track_ids: of the boxes, (n,).
            whole: whether the picture cuts no side of each box, (n,); parts are not judged.
            decoded: gives the frame's picture at its full resolution.
        """
        if frame.frame_index % self._every or not len(boxes):
            return None
        asked = track_ids[whole].tolist()
        if not asked:
            return None
        since_s = (frame.capture_time_ns - self._looked_ns) / 1e9
        if all(self._looks[track] >= ENOUGH_LOOKS for track in asked) and 0 <= since_s < AGAIN_S:
            return None
        self._looks.update(asked)
        self._looked_ns = frame.capture_time_ns
        found = self._network.detect(frame, decoded(frame))
        shares = _overlapped(boxes.bbox_xyxy_px, found.bbox_xyxy_px)
        score = np.where(shares, found.score, 0.0)
        wanted = np.isin(np.array(found.class_name, dtype=object), self._classes)
        person = score[:, wanted].max(axis=1, initial=0.0)
        other = score[:, ~wanted].max(axis=1, initial=0.0)
        # A network that is surer of a bottle there has not found a person.
        found_there = (person > 0) & (person >= other)
        return np.where(whole, found_there.astype(np.float64), NAN)


def _overlapped(boxes: FloatArray, by: FloatArray) -> np.ndarray:
    """Return whether each of `by` (m, 4) shares enough with each of `boxes` (n, 4), (n, m)."""
    low = np.maximum(boxes[:, None, :2], by[None, :, :2])
    high = np.minimum(boxes[:, None, 2:], by[None, :, 2:])
    shared = np.clip(high - low, 0.0, None).prod(axis=2)
    sizes = [(b[:, 2:] - b[:, :2]).prod(axis=1) for b in (boxes, by)]
    union = sizes[0][:, None] + sizes[1][None, :] - shared
    return np.asarray(shared >= LEAST_OVERLAP * union)
