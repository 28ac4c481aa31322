"""Lenses of the pictures of one camera, and how many have each: one odd picture decides nothing."""

from __future__ import annotations

from dataclasses import dataclass, field

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
    frames: int = 0
    intrinsics: Intrinsics | None = None
    source: str | None = None
    rectified: Intrinsics | None = None

    def has(self, size_px: tuple[int, int], stated: Intrinsics | None) -> bool:
        """Return True if a frame of this size and calibration belongs here."""
        if size_px != self.size_px or (stated is None) != (self.stated is None):
            return False
        if stated is None or self.stated is None or stated is self.stated:
            return True
        return abs(stated.fx_px / self.stated.fx_px - 1) < SAME_FOCAL


@dataclass(slots=True)
class LensStretches:
    """All lenses of a camera, in the order in which they were seen."""

    _all: list[LensStretch] = field(default_factory=list)
    _last: LensStretch | None = None

    def of_frame(
        self, size_px: tuple[int, int], stated: Intrinsics | None
    ) -> tuple[LensStretch, bool]:
        """Count a frame; return its stretch, and True if there was none like it before.

        Args:
            size_px: width and height of the picture.
            stated: its calibration, None if there is none.
        """
        found = self._last
        if found is None or not found.has(size_px, stated):
            found = next((s for s in self._all if s.has(size_px, stated)), None)
        is_new = found is None and len(self._all) < MOST
        if found is None:
            found = LensStretch(size_px, stated)
            if is_new:
                self._all.append(found)
        found.frames += 1
        self._last = found
        return found, is_new

    @property
    def usual(self) -> LensStretch:
        """The stretch of most frames, among those whose lens is known if there are any."""
        known = [s for s in self._all if s.intrinsics is not None] or self._all
        return max(known, key=lambda s: s.frames, default=LensStretch(NO_SIZE, None))
