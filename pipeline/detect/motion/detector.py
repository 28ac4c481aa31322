"""People and things that move before a fixed camera: silhouettes against the learned background.

    difference -> shadows out -> silhouettes -> fragments joined, groups split -> tight ends

Lengths are shares of the picture or of the object, never pixels: a recording may have any size.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import hypot
from typing import NamedTuple

import cv2
import numpy as np
import numpy.typing as npt

from pipeline.core.config import CameraConfig, DetectConfig
from pipeline.core.records import Boxes, Expected, Frame
from pipeline.detect.motion.background import Background, medians_of_5
from pipeline.detect.motion.edges import Unshaded, ends_of
from pipeline.detect.motion.ghosts import Box, Ghosts, is_hole
from pipeline.detect.motion.groups import NOBODY, Pieces, split_groups
from pipeline.detect.motion.person_scale import PERSON_ASPECT, PersonScale, join_parts
from pipeline.detect.motion.predicted_people import Known
from pipeline.detect.motion.shadow import UNIT, ShadowLight
from pipeline.detect.motion.shadow_repair import repair
from pipeline.images.decode import Image, Picture

# Noise is less in the mean of 3 x 3 pixels; a person of a twentieth of the picture is wider than that.
SOFT_PX = (3, 3)
# What is a step apart is joined, further up and down than to the sides.
_JOIN = np.ones((5, 3), np.uint8)
MIN_AREA_PX = 12  # of an outline: a person of the smallest height is two dozen pixels
MIN_FILLED = 0.15  # of its box: a line of noise is less
UNSEEN_STD = 0.07  # of the height: statures differ by 5 %, where feet are by a little more
BoxArray = npt.NDArray[np.intp]


class Foreground(NamedTuple):
    """Masks of the difference from the background, (h, w) each."""

    mask: Image  # 255 where bodies are, shadows taken out
    raw: Image  # the same with shadows
    differs: Image  # grey levels
    occupied: Image  # 255 where anything is that the background must not learn
    outlined: list[Box]  # x0, y0, x1, y1 of what is connected, shadows too


class Silhouettes(NamedTuple):
    """Objects in the foreground."""

    pieces: Pieces  # one person each
    whole: BoxArray  # of which all is seen, groups as one


class MotionDetector:
    """Finds what moves; the background is learned from the recording's beginning."""

    name = "motion"
    full_resolution = False
    runs_on_opencv = False

    def __init__(self, config: DetectConfig) -> None:
        self.learning_s = config.learning_s
        self._min_height = config.min_height
        self._shape: tuple[int, ...] = ()
        self._begin([])

    def _begin(self, soft: Sequence[Image]) -> None:
        self._background = Background(soft) if soft else None
        self._people = PersonScale()
        self._shadow = ShadowLight()
        self._ghosts = Ghosts()

    def prepared(self, picture: Picture) -> Picture:
        """Return a picture with less noise beside it."""
        return picture if picture.soft is not None else replace(picture, soft=_softened(picture))

    def learn(self, pictures: Sequence[Picture]) -> None:
        """Learn background, light and people from pictures spread over time, of the commonest size."""
        shapes = [p.bgr.shape for p in pictures]
        if not shapes:
            return
        self._shape = max(set(shapes), key=shapes.count)
        soft = [_softened(p) for p in pictures if p.bgr.shape == self._shape]
        self._begin(soft)
        assert self._background is not None  # noqa: S101  (narrowing)
        self._fill_holes(soft)
        for image in soft:
            reference = self._background.relit(image)
            differs = self._background.difference(image, reference)
            mask = _joined(self._background.foreground(differs))
            ratio = cv2.divide(image, reference, scale=UNIT)
            self._shadow.learn(ratio, mask, _outlined(mask))
        self._shadow.fit()
        for image in soft:
            seen = self._foreground(image, self._background.relit(image))
            self._teach(self._silhouettes(seen), seen)

    def _fill_holes(self, soft: Sequence[Image]) -> None:
        """Remove people from the background who stood there for most of the time, but not for all.

        They are missing in some part of the time, and leave a hole there.
        """
        background = self._background
        assert background is not None  # noqa: S101  (narrowing)
        for image in medians_of_5(soft):
            reference = background.relit(image)
            mask = _joined(background.foreground(background.difference(image, reference)))
            for box in _outlined(mask):
                if is_hole(box, image, reference, mask):
                    background.take(image, box, mask)

    def detect(
        self, frame: Frame, picture: Picture | None, expected: Expected | None = None
    ) -> Boxes:
        """Return what stands before the background."""
        if picture is None:
            return Boxes.empty()
        image = _softened(picture)
        if self._background is None or picture.bgr.shape != self._shape:
            # A new picture size is a new view: begin again with what is there.
            self._shape = picture.bgr.shape
            self._begin([image])
            assert self._background is not None  # noqa: S101  (narrowing)
        background = self._background
        reference = background.relit(image)
        seen = self._foreground(image, reference)
        known, came = NOBODY, []
        if expected is not None and len(expected.walked):
            boxes = (expected.bbox_xyxy_px + 0.5) / picture.reduction
            known = Known.of_boxes(boxes)
            came = boxes[expected.walked].round().astype(int).tolist()
        found = self._silhouettes(seen, known)
        self._teach(found, seen)
        time_s = frame.capture_time_ns / 1e9
        if background.follow(image, seen.occupied, time_s, came):
            self._follow(seen, image, reference, time_s)

        def unshaded(parts: Sequence[Box]) -> Sequence[Image]:
            return self._shadow.unshaded_in(image, reference, parts)

        return self._tighten(found, seen, picture, unshaded)

    def _follow(self, seen: Foreground, image: Image, reference: Image, time_s: float) -> None:
        """Follow what changes slowly: the light in shadows, and holes in the background."""
        assert self._background is not None  # noqa: S101  (narrowing)
        self._shadow.learn(cv2.divide(image, reference, scale=UNIT), seen.raw, seen.outlined)
        self._shadow.maybe_fit()
        for hole in self._ghosts.find(seen.outlined, image, reference, seen.raw, time_s):
            self._background.take(image, hole)

    def _foreground(self, image: Image, reference: Image) -> Foreground:
        """Return where bodies are, how they differ, and where anything is."""
        assert self._background is not None  # noqa: S101  (narrowing)
        differs = self._background.difference(image, reference)
        raw = _joined(self._background.foreground(differs))
        mask, occupied = raw, raw.copy()
        outlined = _outlined(raw)
        for x0, y0, x1, y1 in outlined:
            cv2.rectangle(occupied, (x0, y0), (x1 - 1, y1 - 1), (255,), cv2.FILLED)
            if self._shadow.factors is None:
                continue
            part = slice(y0, y1), slice(x0, x1)
            shade = self._shadow.find(cv2.divide(image[part], reference[part], scale=UNIT))
            if shade is not None:
                mask = raw.copy() if mask is raw else mask
                cv2.subtract(mask[part], shade, dst=mask[part])
        return Foreground(mask, raw, differs, occupied, outlined)

    def _silhouettes(self, seen: Foreground, known: Known = NOBODY) -> Silhouettes:
        """Return what is connected, or belongs together, one person each."""
        mask = seen.mask
        # Where nothing was taken for shadow, outlines are those that are known.
        outlined = seen.outlined if mask is seen.raw else _outlined(mask)
        boxes = np.array(outlined, dtype=np.intp).reshape(-1, 4)
        weight = np.array(
            [float(cv2.countNonZero(mask[y0:y1, x0:x1])) for x0, y0, x1, y1 in boxes.tolist()]
        )
        boxes, weight = join_parts(boxes, weight, self._people)
        size = boxes[:, 2:] - boxes[:, :2]
        tall = size[:, 1] >= self._min_height * mask.shape[0]
        filled = weight / np.maximum(size.prod(axis=1), 1) > MIN_FILLED
        boxes = boxes[tall & filled]
        doubt = np.zeros(len(boxes), dtype=bool)
        if self._shadow.factors is not None:
            boxes, doubt = repair(boxes, mask, seen.raw, self._people)
        size = np.array([mask.shape[1], mask.shape[0]])
        inside = (boxes[:, :2] > 1).all(axis=1) & (boxes[:, 2:] < size - 1).all(axis=1)
        pieces = split_groups(boxes, mask, self._people, known)
        return Silhouettes(pieces, boxes[inside & ~doubt])

    def _teach(self, found: Silhouettes, seen: Foreground) -> None:
        """Learn the height of people in the picture from those who are wholly seen."""
        self._people.learn(found.whole)

    def _tighten(
        self, found: Silhouettes, seen: Foreground, picture: Picture, unshaded: Unshaded
    ) -> Boxes:
        """Return the boxes with their ends found to a fraction of a pixel, in stored pixels."""
        edges, spreads, scores = [], [], []
        mask, differs, pieces = seen.mask, seen.differs, found.pieces
        boxes = pieces.boxes.tolist()
        all_ends = ends_of(mask, differs, unshaded, boxes)
        for box, ends, unseen in zip(boxes, all_ends, pieces.unseen.tolist(), strict=True):
            if ends is None or ends[0][3] - ends[0][1] < self._min_height * mask.shape[0]:
                continue
            for end, hidden in zip((1, 3), unseen, strict=True):
                if hidden:
                    ends[0][end] = float(box[end])
            tall = ends[0][3] - ends[0][1]
            edges.append(ends[0])
            loose = [0.0, unseen[0] * UNSEEN_STD * tall, 0.0, unseen[1] * UNSEEN_STD * tall]
            spreads.append([hypot(*pair) for pair in zip(ends[1], loose, strict=True)])
            scores.append(_score(differs, mask, box))
        if not edges:
            return Boxes.empty()
        # Silhouette coordinates count pixel edges from 0; stored pixels have their centre at 0.
        bbox = np.array(edges) * picture.reduction - 0.5
        size = bbox[:, 2:] - bbox[:, :2]
        aspect = size[:, 1] / np.maximum(size[:, 0], 1e-9)
        person = (aspect >= PERSON_ASPECT[0]) & (aspect <= PERSON_ASPECT[1])
        return Boxes(
            bbox,
            np.array(scores),
            tuple("person" if p else "unknown" for p in person),
            np.array(spreads) * picture.reduction,
            (None,) * len(edges),
        )


def _softened(picture: Picture) -> Image:
    if picture.soft is not None:
        return picture.soft
    return np.asarray(cv2.blur(picture.bgr, SOFT_PX), np.uint8)


def _joined(mask: Image) -> Image:
    return np.asarray(cv2.morphologyEx(mask, cv2.MORPH_CLOSE, _JOIN), np.uint8)


def _outlined(mask: Image) -> list[Box]:
    """Return the boxes x0, y0, x1, y1 of what is connected and no speck."""
    # Outlines of a sparse mask are found in a quarter of the time that labelling every pixel takes.
    outlines, _ = cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
    boxes = []
    for outline in outlines:
        if len(outline) < 4:
            continue
        x, y, width, height = cv2.boundingRect(outline)
        if width * height >= MIN_AREA_PX and width > 1:
            boxes.append((x, y, x + width, y + height))
    return boxes


def _score(differs: Image, mask: Image, box: Box) -> float:
    """Return how clearly an object stands out, 0..1: its mean contrast, 64 levels being certain."""
    x0, y0, x1, y1 = box
    inside = cv2.mean(differs[y0:y1, x0:x1], mask=mask[y0:y1, x0:x1])[0]
    return float(min(inside / 64.0, 1.0))


def make(config: DetectConfig, camera: CameraConfig) -> MotionDetector:
    """Return the detector, for the table `DETECTORS`."""
    return MotionDetector(config)
