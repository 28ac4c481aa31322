"""People whom motion finds confirmed by a pose network (MediaPipe's), some crops of each track.

The network takes one person upright in the middle of a square and says, beside the joints, whether there
is one (Bazarevsky et al. 2020, BlazePose: On-device Real-time Body Pose tracking, arXiv:2006.10204).
OpenCV reads its TFLite file by the classic engine; the new one keeps one output only.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np

from pipeline.core.arrays import NAN, BoolArray, FloatArray, IntArray
from pipeline.core.config import DetectConfig
from pipeline.core.errors import UnusableModel, Where
from pipeline.core.records import Boxes, Frame
from pipeline.images.decode import Image, Picture

INPUT_PX = 256
# The square is larger than the person by this, as in the network's own pipeline.
MARGIN = 1.25
# Of five crops a track, spread, people have a median of 0.92 and more, cars and bottles of 0.02 and less.
LEAST_PRESENCE = 0.8
# A track is looked at again after half a second, one, two, and then every four: in between its tracker
# may have taken somebody else for it.
FIRST_AGAIN_S, LAST_AGAIN_S = 0.5, 4.0
MIN_TALL_PX = 24  # smaller people are nothing to it


class PoseVerifier:
    """A pose network that looks at a few boxes of each track.

    Raises:
        UnusableModel: the file is no such network.
    """

    runs_on_opencv = False  # one crop is too small for several cores

    def __init__(self, config: DetectConfig) -> None:
        self._every = max(config.verify_every, 1)
        self._looks = Counter[int]()  # by track
        self._next_ns = defaultdict[int, int](lambda: -(1 << 62))  # time to look at a track again
        path = Path(config.model)
        try:
            self._net = cv2.dnn.readNetFromTFLite(str(path), cv2.dnn.ENGINE_CLASSIC)
            self._names = self._net.getUnconnectedOutLayersNames()
            self._presence = self._output(np.zeros((INPUT_PX, INPUT_PX, 3), np.uint8))
        except (cv2.error, OSError, ValueError) as error:
            raise UnusableModel(
                "it is no pose network that is understood",
                where=Where(path),
                remedy="`stadimeter models get pose_landmark_full` brings one that is",
            ) from error

    def confirmed(
        self,
        frame: Frame,
        boxes: Boxes,
        track_ids: IntArray,
        whole: BoolArray,
        decoded: Callable[[Frame], Picture],
    ) -> FloatArray | None:
        """Return 1 for each box with a person in it, 0 without, NaN if it was not looked at, (n,).

        None is returned in most frames. Arguments are those of `verify.Verifier.confirmed`.
        """
        if frame.frame_index % self._every or not len(boxes):
            return None
        tall = boxes.bbox_xyxy_px[:, 3] - boxes.bbox_xyxy_px[:, 1]
        due = frame.capture_time_ns >= np.array([self._next_ns[t] for t in track_ids.tolist()])
        chosen = np.flatnonzero(due & whole & (tall >= MIN_TALL_PX))
        if not len(chosen):
            return None
        picture = decoded(frame)
        found = np.full(len(boxes), NAN)
        for box in chosen:
            edges = (boxes.bbox_xyxy_px[box] + 0.5) / picture.reduction
            found[box] = float(self._present(picture.bgr, edges) >= LEAST_PRESENCE)
        for track in track_ids[chosen].tolist():
            again_s = min(FIRST_AGAIN_S * 2 ** min(self._looks[track], 10), LAST_AGAIN_S)
            self._looks[track] += 1
            self._next_ns[track] = frame.capture_time_ns + round(again_s * 1e9)
        return found

    def _present(self, image: Image, edges: FloatArray) -> float:
        """Return how sure the network is that a person is in a box."""
        x0, y0, x1, y1 = edges
        scale = INPUT_PX / (MARGIN * max(x1 - x0, y1 - y0))
        middle = INPUT_PX / 2 - scale * np.array([(x0 + x1) / 2, (y0 + y1) / 2])
        crop = cv2.warpAffine(
            image,
            np.array([[scale, 0.0, middle[0]], [0.0, scale, middle[1]]]),
            (INPUT_PX, INPUT_PX),
        )
        return float(np.asarray(self._run(np.asarray(crop, np.uint8))[self._presence]).ravel()[0])

    def _run(self, crop: Image) -> list[FloatArray]:
        self._net.setInput(cv2.dnn.blobFromImage(crop, 1 / 255, swapRB=True))
        return list(self._net.forward(self._names))

    def _output(self, crop: Image) -> int:
        """Return the place of the output that says whether a person is there: the only single number."""
        single = [i for i, o in enumerate(self._run(crop)) if np.size(o) == 1]
        if len(single) != 1:
            raise ValueError("no output says whether a person is there")
        return single[0]


def is_tflite(path: Path) -> bool:
    """Return true if a file is a TensorFlow Lite model, by its identifier."""
    try:
        with path.open("rb") as stream:
            return stream.read(8)[4:] == b"TFL3"
    except OSError:
        return False
