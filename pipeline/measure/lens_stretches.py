"""Lenses of the pictures of one camera, and how many have each: one odd picture decides nothing."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from pipeline.core.arrays import NAN
from pipeline.core.records import Intrinsics

NO_SIZE = (0, 0)
# Sizes and calibrations that are told apart; a calibration that is new in every message has no stretch.
MOST = 256
# Focal lengths that differ by less than this are one lens: drivers round, and focus breathes.
SAME_FOCAL = 0.01


@dataclass(slots=True)
class LensStretch:
    """A size of pictures with its calibration, and the number of frames that have both."""

    size_px: tuple[int, int]
    stated: Intrinsics | None
    focal_px: float = NAN  # by the frame's lens data, where there is no calibration
    frames: int = 0
    intrinsics: Intrinsics | None = None
    source: str | None = None
    rectified: Intrinsics | None = None

    def has(
        self, size_px: tuple[int, int], stated: Intrinsics | None, focal_px: float = NAN
    ) -> bool:
        """Return True if a frame of this size and lens belongs here."""
        if size_px != self.size_px or (stated is None) != (self.stated is None):
            return False
        if stated is None or self.stated is None:
            unknown = math.isnan(focal_px) and math.isnan(self.focal_px)
            return unknown or abs(focal_px / self.focal_px - 1) < SAME_FOCAL
        return stated is self.stated or _alike(stated, self.stated)


def _alike(a: Intrinsics, b: Intrinsics) -> bool:
    """Return True if two calibrations are of one lens; all by shares of the focal length."""
    off_px = (a.fx_px - b.fx_px, a.fy_px - b.fy_px, a.cx_px - b.cx_px, a.cy_px - b.cy_px)
    return max(map(abs, off_px)) < SAME_FOCAL * b.fx_px


@dataclass(slots=True)
class LensStretches:
    """All lenses of a camera, in the order in which they were seen."""

    _all: list[LensStretch] = field(default_factory=list)
    _last: LensStretch | None = None

    def of_frame(
        self, size_px: tuple[int, int], stated: Intrinsics | None, focal_px: float = NAN
    ) -> tuple[LensStretch, bool]:
        """Count a frame; return its stretch, and True if there was none like it before.

        Args:
            size_px: width and height of the picture.
            stated: its calibration, None if there is none.
            focal_px: its focal length by lens data, NaN if there are none.
        """
        found = self._last
        if found is None or not found.has(size_px, stated, focal_px):
            found = next((s for s in self._all if s.has(size_px, stated, focal_px)), None)
        is_new = found is None and len(self._all) < MOST
        if found is None:
            found = LensStretch(size_px, stated, focal_px)
            if is_new:
                self._all.append(found)
        found.frames += 1
        self._last = found
        return found, is_new

    @property
    def several(self) -> bool:
        """True if there is more than one lens that is known."""
        return len({s.intrinsics for s in self._all if s.intrinsics is not None}) > 1

    @property
    def usual(self) -> LensStretch:
        """The stretch of most frames, among those whose lens is known if there are any."""
        known = [s for s in self._all if s.intrinsics is not None] or self._all
        return max(known, key=lambda s: s.frames, default=LensStretch(NO_SIZE, None))
