"""People whom motion finds confirmed by a network, which looks at some of the frames only.

A network on every frame costs more than all else together. On every fifth it sees each track often
enough to tell whether it is a person, and motion finds where everybody is meanwhile.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from pipeline.core.arrays import FloatArray, IntArray
from pipeline.core.config import DetectConfig
from pipeline.core.records import Boxes, Frame
from pipeline.detect.network.detector import OnnxDetector
from pipeline.images.decode import Picture

# That something is a person at all takes less than to find one: half of the usual least score.
SCORE_SHARE = 0.5
# A share of so many looks is known to 0.15; frames that hold nobody else are not looked at any more.
ENOUGH_LOOKS = 10
# Boxes of motion and of a network, around one person who is partly hidden, share a third and more.
LEAST_OVERLAP = 0.3


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
        self.runs_on_opencv = self._network.runs_on_opencv

    def confirmed(
        self,
        frame: Frame,
        boxes: Boxes,
        track_ids: IntArray,
        whole: Callable[[Frame], Picture],
    ) -> FloatArray | None:
        """Return 1 for each box that the network finds a person in, else 0, (n,); None in most frames.

        Args:
            frame: the frame.
            boxes: of the motion detector.
            track_ids: of the boxes, (n,).
            whole: gives the frame's picture at its full resolution.
        """
        if frame.frame_index % self._every or not len(boxes):
            return None
        if all(self._looks[track] >= ENOUGH_LOOKS for track in track_ids.tolist()):
            return None
        self._looks.update(track_ids.tolist())
        found = self._network.detect(frame, whole(frame))
        shares = _overlapped(boxes.bbox_xyxy_px, found.bbox_xyxy_px)
        score = np.where(shares, found.score, 0.0)
        wanted = np.isin(np.array(found.class_name, dtype=object), self._classes)
        person = score[:, wanted].max(axis=1, initial=0.0)
        other = score[:, ~wanted].max(axis=1, initial=0.0)
        # A network that is surer of a bottle there has not found a person.
        return ((person > 0) & (person >= other)).astype(np.float64)


def _overlapped(boxes: FloatArray, by: FloatArray) -> np.ndarray:
    """Return whether each of `by` (m, 4) shares enough with each of `boxes` (n, 4), (n, m)."""
    low = np.maximum(boxes[:, None, :2], by[None, :, :2])
    high = np.minimum(boxes[:, None, 2:], by[None, :, 2:])
    shared = np.clip(high - low, 0.0, None).prod(axis=2)
    sizes = [(b[:, 2:] - b[:, :2]).prod(axis=1) for b in (boxes, by)]
    union = sizes[0][:, None] + sizes[1][None, :] - shared
    return np.asarray(shared >= LEAST_OVERLAP * union)
