"""Cuts and movements of a camera that should stand still, found from the place itself.

Once a second a picture is made small, its edges are taken, and each block of it is looked for about its
own place in a reference picture of the place. People hide some blocks; if the camera stands, the others
are where they were. If it turns, most that can be found are displaced by the same way; if the recording
cuts to another place, they are found nowhere, though the new pictures agree among themselves.

Light changes the contrast of edges and not their places, so blocks are compared by their normalised
correlation. What is seen twice in a row is told; a gust that shakes the camera for less is not.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from pipeline.core.arrays import FloatArray
from pipeline.core.records import Diagnostic, Severity
from pipeline.images.decode import Picture

CUT, MOVED = "camera_cut", "moving_camera"
EVERY_S = 1.0
SIDE_PX = 320  # of the longer side of the small picture: a pixel of it is some 0.2 degrees
BLOCK_PX = 20
REACH_PX = 6  # a block is looked for this far away: over a degree, in a second
# A sensor's noise, 1 to 2 grey levels of 255, is below one after averaging: what has less shows no place.
MIN_CONTRAST = 2.5
MIN_BLOCKS = 20  # of about 120
# By chance, the best of 169 places correlates by about 3 / sqrt(independent pixels): of a block of 400,
# whose edges are some 3 pixels wide, 0.4. What is found correlates by more than half as much again.
FOUND = 0.6
# A straight edge fits as well along itself: a block tells a displacement if it fits clearly worse where
# it was. Edges 3 pixels wide lose a tenth within half a pixel.
CLEARLY = 0.1
MOVED_PX = 1.5  # 0.3 degrees in a usual view of 65: the error of a tilt from walkers
AGREE_PX = 1.0  # blocks that are displaced alike
MOST = 0.5  # of the blocks that show a place
FEW = 0.25
TWICE = 2
KEPT = 5  # pictures in a reference, which is their median: people who walk through are not in it


@dataclass(frozen=True, slots=True)
class Shift:
    """Displacement of the place between two small pictures."""

    blocks: int  # that show anything
    found: float  # share of them that is in the other picture
    stay: float  # share of those found that fit as well where they were
    moved_px: float  # by which the others are displaced, if alike, in small pixels

    @property
    def cut(self) -> bool:
        """True if it is another place."""
        return self.blocks >= MIN_BLOCKS and self.found < FEW

    @property
    def moved(self) -> bool:
        """True if it is the place, elsewhere: by chance a block agrees with others once in 50."""
        seen = self.blocks >= MIN_BLOCKS and self.found >= FEW
        return seen and self.stay < FEW and self.moved_px > MOVED_PX


NOTHING_SEEN = Shift(0, 1.0, 1.0, 0.0)


class CameraMotion:
    """Watch over one camera's pictures, in order of time."""

    def __init__(self, camera: str) -> None:
        self.camera = camera
        self._kept: list[FloatArray] = []  # the last ones
        self._anchor: FloatArray | None = None  # the first ones since anything happened
        self._odd: list[tuple[FloatArray, int, Shift]] = []  # after the reference, and unlike it
        self._first_ns: int | None = None
        self._next_ns: int | None = None
        self._last_ns = 0

    def add(self, picture: Picture | None, time_ns: int, log_time_ns: int) -> Diagnostic | None:
        """Look at the next picture; return what has happened, once it is sure."""
        if picture is None:
            return None
        if self._first_ns is None:
            self._first_ns = log_time_ns
        if self._next_ns is not None and self._last_ns <= time_ns < self._next_ns:
            return None
        self._next_ns, self._last_ns = time_ns + round(EVERY_S * 1e9), time_ns
        edges = small_edges(picture.bgr)
        if self._kept and self._kept[0].shape != edges.shape:
            self._begin(None)
        if not self._kept:
            self._begin(edges)
            return None
        shift = self._compared(edges)
        if not (shift.cut or shift.moved):
            self._odd = []
            self._kept = [*self._kept, edges][-KEPT:]
            return None
        return self._unlike(edges, log_time_ns, shift)

    def _begin(self, edges: FloatArray | None) -> None:
        """Start anew from a picture, or from none."""
        self._kept = [] if edges is None else [edges]
        self._anchor, self._odd = None, []

    def _compared(self, edges: FloatArray) -> Shift:
        """Compare a picture with the last ones, and with the first ones: a slow turn shows there alone.

        Over hours light makes a place unlike itself; what are the first ones is then told anew.
        """
        recent = shift_of(np.median(np.stack(self._kept), axis=0), edges)
        if recent.cut:  # a median is unsharp where the camera turns slowly
            return shift_of(self._kept[-1], edges)
        if recent.moved or len(self._kept) < KEPT:
            return recent
        since = None if self._anchor is None else shift_of(self._anchor, edges)
        if since is None or since.found < FEW:
            self._anchor = np.median(np.stack(self._kept), axis=0)
            return recent
        return since if since.moved else recent

    def _unlike(self, edges: FloatArray, log_time_ns: int, shift: Shift) -> Diagnostic | None:
        """Take a picture that is unlike the reference; a second one makes it sure."""
        self._odd.append((edges, log_time_ns, shift))
        if len(self._odd) < TWICE:
            return None
        (before, since_ns, first), (after, _, _) = self._odd[-TWICE:]
        if first.cut and shift_of(before, after).found < MOST:
            self._odd = self._odd[-1:]  # noise, or pictures that have nothing in common
            return None
        self._begin(after)
        return self._describe(first.cut, shift, since_ns)

    def _describe(self, cut: bool, shift: Shift, log_time_ns: int) -> Diagnostic:
        at_s = (log_time_ns - (self._first_ns or 0)) / 1e9
        if cut:
            what, code = "the pictures show another place, or from elsewhere", CUT
        else:
            share = shift.moved_px / SIDE_PX
            what = f"the camera has moved: the place is displaced by {share:.1%} of the width"
            code = MOVED
        return Diagnostic(
            Severity.WARNING,
            code,
            f"{what}, at {at_s:.1f} s. A pose is of one place: that from walkers is of the longest "
            "part that stands still, and other parts get none. Split the recording here, or give the "
            "pose of a camera that drives",
            camera=self.camera,
            log_time_ns=log_time_ns,
        )


def small_edges(image: npt.NDArray[np.uint8]) -> FloatArray:
    """Return the strength of edges in a small picture, float32, its longer side `SIDE_PX`."""
    scale = SIDE_PX / max(image.shape[:2])
    height, width = (max(round(n * scale), 1) for n in image.shape[:2])
    small = cv2.resize(image, (width, height), interpolation=cv2.INTER_AREA)
    grey = cv2.cvtColor(small, cv2.COLOR_BGR2GRAY) if small.ndim == 3 else small
    grey = grey.astype(np.float32)
    across, down = cv2.Sobel(grey, cv2.CV_32F, 1, 0), cv2.Sobel(grey, cv2.CV_32F, 0, 1)
    return np.asarray(cv2.magnitude(across, down) / 4.0)  # 4: of a step, its height in grey levels


def shift_of(reference: FloatArray, other: FloatArray) -> Shift:
    """Return how the place of a reference lies in another small picture.

    Args:
        reference: of `small_edges`, (h, w).
        other: the same of another time.
    """
    height, width = reference.shape
    low, high = REACH_PX, BLOCK_PX + REACH_PX
    moves, blocks, found = [], 0, 0
    rows: set[int] = set()
    columns: set[int] = set()
    tops = range(low, height - high + 1, BLOCK_PX)
    lefts = range(low, width - high + 1, BLOCK_PX)
    for top in tops:
        for left in lefts:
            block = reference[top : top + BLOCK_PX, left : left + BLOCK_PX]
            if block.std() < MIN_CONTRAST:
                continue
            blocks += 1
            rows.add(top)
            columns.add(left)
            around = other[top - low : top + high, left - low : left + high]
            scores = cv2.matchTemplate(
                np.ascontiguousarray(around, np.float32),
                np.ascontiguousarray(block, np.float32),
                cv2.TM_CCOEFF_NORMED,
            )
            _, best, _, at = cv2.minMaxLoc(scores)
            if best >= FOUND:
                found += 1
                if best - scores[low, low] > CLEARLY:
                    moves.append((at[0] - low, at[1] - low))
    if len(rows) < MOST * len(tops) or len(columns) < MOST * len(lefts):
        return NOTHING_SEEN  # one thing before a plain wall, which is not the place
    share = found / max(blocks, 1)
    if len(moves) <= MOST * found:
        return Shift(blocks, share, 1.0 - len(moves) / max(found, 1), 0.0)
    ways = np.array(moves, dtype=np.float64)
    common = np.median(ways, axis=0)
    alike = np.hypot(*(ways - common).T) <= AGREE_PX + 0.25 * float(np.hypot(*common))
    moved = float(np.hypot(*ways[alike].mean(axis=0))) if alike.mean() > MOST else 0.0
    return Shift(blocks, share, 1.0 - len(moves) / found, moved)
