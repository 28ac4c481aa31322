"""True objects as they come from a file, whatever its form."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from itertools import pairwise

from pipeline.core.arrays import NAN

# Boxes of a frame number, which a file counts in its own way; None: of every frame.
FrameNumber = int | None


@dataclass(frozen=True, slots=True)
class TruthRow:
    """One object in one frame; NaN is unknown. Edges as in `core.records`: the first pixel is at 0."""

    frame: FrameNumber
    object_id: str
    class_name: str | None = None
    bbox_xyxy_px: tuple[float, float, float, float] = (NAN, NAN, NAN, NAN)
    depth_m: float = NAN
    range_m: float = NAN
    height_m: float = NAN
    width_m: float = NAN
    x_m: float = NAN
    y_m: float = NAN
    time_s: float = NAN  # since the recording's first frame, where no frame is named

    @property
    def has_box(self) -> bool:
        """True if the box is known."""
        return all(math.isfinite(edge) for edge in self.bbox_xyxy_px)


@dataclass(slots=True)
class TruthFile:
    """Content of a file of truth."""

    form: str
    first_frame: (
        int  # the number that it gives to a recording's first frame, unless the user knows better
    )
    objects: list[TruthRow] = field(default_factory=list)
    ignored: list[TruthRow] = field(default_factory=list)  # regions in which boxes do not count
    frames: set[int] = field(default_factory=set)  # those that were looked at
    refused: list[str] = field(default_factory=list)  # lines that mean nothing, with the reason
    doubts: list[str] = field(default_factory=list)  # what was assumed

    def add(self, row: TruthRow, *, ignored: bool = False) -> None:
        """Take a row, if it has a box that is one, or values that can be."""
        problem = _impossible(row)
        if problem:
            self.refused.append(f"object {row.object_id} in frame {row.frame}: {problem}")
            return
        (self.ignored if ignored else self.objects).append(row)
        if row.frame is not None:
            self.frames.add(row.frame)

    def fill_frames(self) -> None:
        """Count the frames between as looked at, by the step at which frames are labelled.

        Forms that list objects alone do not tell an empty frame from one that nobody looked at.
        """
        known = sorted(self.frames)
        if len(known) < 2:
            return
        steps = [b - a for a, b in pairwise(known)]
        step = max(set(steps), key=lambda s: (steps.count(s), -s))
        self.frames.update(range(known[0], known[-1] + 1, step))


def _impossible(row: TruthRow) -> str:
    """Return the reason why a row cannot be true; empty if it can."""
    if any(math.isinf(edge) for edge in row.bbox_xyxy_px):
        return f"{row.bbox_xyxy_px} is no box"
    if row.has_box:
        x0, y0, x1, y1 = row.bbox_xyxy_px
        if not (x1 > x0 and y1 > y0):
            return f"{row.bbox_xyxy_px} is no box"
    for name in ("depth_m", "range_m", "height_m", "width_m"):
        value = getattr(row, name)
        if not math.isnan(value) and not 0 < value < math.inf:
            return f"{name} {value:g} is impossible"
    return ""
