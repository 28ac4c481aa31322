"""Heights from marks that a person sets: head and feet in chosen frames, several times.

A CSV with a header: `frame, head_x, head_y, foot_x, foot_y` in pixels of the stored picture (the centre
of the first is 0, 0), and, where wanted, `by` (who marked), `repeat`, `what` (`person`, or `reference`
for an upright thing of known length) and `length_m`. The feet are marked in the middle between the soles.

    Z = h / (y_f cos t + sin t),   H = Z (y_f - y_h) / (cos t - y_h sin t)      (optics.ground_plane)

What the repeats differ by is the error of the marks. References give the scale by their length:
H times the ratio of known and measured length, in which the errors of the pose all but cancel.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from pipeline.core.arrays import FloatArray
from pipeline.core.errors import UsageError, Where
from pipeline.core.records import GroundPlane, Intrinsics
from pipeline.estimate.boxes.ends import camera_of
from pipeline.optics.ground_plane import foot_depth_m, height_m, remove_roll

NUMBERS = ("head_x", "head_y", "foot_x", "foot_y")
# Somebody who marks once is taken to be as unsure as people who mark by eye: a pixel and a half an end.
ONCE_STD_PX = 1.5
MOST_MARKS = 100_000
PERSON, REFERENCE = "person", "reference"
_STEPS = (0.001, 1e-4, 1e-4)  # log camera height, tilt, roll


@dataclass(frozen=True, slots=True)
class Mark:
    """Head and feet in one frame, marked once."""

    frame_index: int
    ends_px: tuple[float, float, float, float]  # head x, y, feet x, y
    by: str = ""
    repeat: str = ""
    what: str = PERSON
    length_m: float = math.nan


@dataclass(frozen=True, slots=True)
class Marked:
    """A height by marks, and the parts of its standard deviation."""

    height_m: float
    pose_std_m: float
    marks_std_m: float
    between_frames_std_m: float
    scale_std_m: float  # of the references, 0 where there are none
    depth_m: float
    frames: int
    marks: int
    people: tuple[str, ...]  # who marked
    repeated: bool
    references: int

    @property
    def std_m(self) -> float:
        """The standard deviation of the height."""
        own = max(self.marks_std_m, self.between_frames_std_m)
        return float(np.linalg.norm([self.pose_std_m, own, self.scale_std_m]))


def read_marks(path: Path) -> list[Mark]:
    """Read a CSV of marks.

    Raises:
        UsageError: it cannot be read, a column is missing, or a value is none.
    """
    try:
        with path.open(encoding="utf-8-sig", newline="") as stream:
            rows = list(csv.DictReader(stream))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise UsageError(f"the marks cannot be read: {error}", where=Where(path)) from error
    if len(rows) > MOST_MARKS:
        raise UsageError(f"more than {MOST_MARKS:,} marks", where=Where(path))
    missing = [name for name in ("frame", *NUMBERS) if rows and name not in rows[0]]
    if missing or not rows:
        raise UsageError(
            f"columns are missing: {', '.join(missing)}" if missing else "the file has no marks",
            where=Where(path),
            remedy="Its header is frame,head_x,head_y,foot_x,foot_y,by,repeat,what,length_m",
        )
    return [_mark(path, number, row) for number, row in enumerate(rows, start=2)]


def _mark(path: Path, line: int, row: Mapping[str, str | None]) -> Mark:
    def refused(text: str) -> UsageError:
        return UsageError(f"line {line}: {text}", where=Where(path))

    try:
        frame = int(row["frame"] or "")
        x_h, y_h, x_f, y_f = (float(row[name] or "") for name in NUMBERS)
        length_m = float(row.get("length_m") or "nan")
    except ValueError as error:
        raise refused(f"{error}") from error
    what = (row.get("what") or PERSON).strip()
    if what not in (PERSON, REFERENCE):
        raise refused(f"what is {what!r}; it must be {PERSON} or {REFERENCE}")
    if what == REFERENCE and not 0.01 < length_m < 1000:
        raise refused("a reference needs its length_m, from 0.01 to 1000")
    if not all(abs(v) < 1e6 for v in (x_h, y_h, x_f, y_f)) or frame < 0:
        raise refused("a mark outside of any picture")
    if y_h >= y_f:
        raise refused("the head is not above the feet")
    who, repeat = (row.get("by") or "").strip(), (row.get("repeat") or "").strip()
    return Mark(frame, (x_h, y_h, x_f, y_f), who, repeat, what, length_m)


def measure_marks(marks: Iterable[Mark], lens: Intrinsics, plane: GroundPlane) -> Marked:
    """Return the height of the person who was marked.

    Raises:
        UsageError: nobody was marked, or a mark has no place on the ground.
    """
    every = list(marks)
    people = [m for m in every if m.what == PERSON]
    references = [m for m in every if m.what == REFERENCE]
    if not people:
        raise UsageError("no row of the marks is of a person")
    heights, depths = _lengths(people, lens, plane)
    if not np.isfinite(heights).all() or (heights <= 0).any():
        raise UsageError(
            "a mark has no place on the ground: feet above the horizon, or head and feet exchanged"
        )

    def scaled(posed: GroundPlane) -> float:
        by_frame, _ = _lengths(people, lens, posed)
        return float(_by_frame(people, by_frame).mean() * _ratio(references, lens, posed))

    table = pd.DataFrame({"frame": [m.frame_index for m in people], "height_m": heights})
    by_frame = table.groupby("frame")["height_m"]
    per_frame = by_frame.count().to_numpy()
    repeated = bool((per_frame > 1).any())
    marks_std_m = _marks_std_m(by_frame, per_frame, people, lens, plane, repeated=repeated)
    means = by_frame.mean()
    between = float(means.std(ddof=1) / math.sqrt(len(means))) if len(means) > 1 else 0.0
    return Marked(
        height_m=scaled(plane),
        pose_std_m=_pose_std(scaled, plane),
        marks_std_m=marks_std_m,
        between_frames_std_m=between,
        scale_std_m=_scale_std(references, lens, plane) * float(means.mean()),
        depth_m=float(np.median(depths)),
        frames=len(means),
        marks=len(people),
        people=tuple(dict.fromkeys(m.by for m in people if m.by)),
        repeated=repeated,
        references=len(references),
    )


def _lengths(
    marks: list[Mark], lens: Intrinsics, plane: GroundPlane
) -> tuple[FloatArray, FloatArray]:
    """Return how tall what is marked is, and how far away, (n,) each."""
    ends = np.array([m.ends_px for m in marks], dtype=np.float64).reshape(-1, 2, 2)
    points = remove_roll(camera_of(lens).normalize(ends), plane.roll_rad)
    y_h, y_f = points[:, 0, 1], points[:, 1, 1]
    depth_m = foot_depth_m(plane.camera_height_m, plane.tilt_rad, y_f)
    return height_m(depth_m, y_f, y_h, plane.tilt_rad), depth_m


def _by_frame(marks: list[Mark], values: FloatArray) -> FloatArray:
    frames = [m.frame_index for m in marks]
    return np.asarray(pd.Series(values).groupby(frames).mean(), dtype=np.float64)


def _ratio(references: list[Mark], lens: Intrinsics, plane: GroundPlane) -> float:
    """Return by how much lengths are to be multiplied so that the references are right; 1 without any."""
    if not references:
        return 1.0
    return float(np.mean(_ratios(references, lens, plane)))


def _ratios(references: list[Mark], lens: Intrinsics, plane: GroundPlane) -> FloatArray:
    found, _ = _lengths(references, lens, plane)
    if not (found > 0).all():
        raise UsageError("a reference has no place on the ground: its foot is above the horizon")
    return np.array([m.length_m for m in references]) / found


def _scale_std(references: list[Mark], lens: Intrinsics, plane: GroundPlane) -> float:
    """Return the relative deviation of the mean ratio of the references."""
    if not references:
        return 0.0
    ratios = _ratios(references, lens, plane)
    tall_px = np.array([m.ends_px[3] - m.ends_px[1] for m in references])
    stated = float(np.mean(math.sqrt(2) * ONCE_STD_PX / tall_px)) / math.sqrt(len(references))
    seen = float(ratios.std(ddof=1) / math.sqrt(len(ratios))) if len(ratios) > 1 else 0.0
    return max(stated, seen)


def _marks_std_m(
    by_frame: Any,
    per_frame: np.ndarray,
    people: list[Mark],
    lens: Intrinsics,
    plane: GroundPlane,
    *,
    repeated: bool,
) -> float:
    """Return the error of the marks in the mean: by what repeats differ by, else what is usual."""
    if repeated:
        variance = by_frame.var(ddof=1).fillna(0.0).to_numpy()
        pooled = float((variance * (per_frame - 1)).sum() / max((per_frame - 1).sum(), 1))
        return math.sqrt(pooled / per_frame.sum())
    shares = []
    for edge in (1, 3):
        moved = [replace(m, ends_px=_moved(m.ends_px, edge)) for m in people]
        shares.append(_lengths(moved, lens, plane)[0] - _lengths(people, lens, plane)[0])
    one = float(np.mean(np.hypot(*shares))) * ONCE_STD_PX
    return one / math.sqrt(len(people))


def _moved(ends: tuple[float, float, float, float], edge: int) -> tuple[float, float, float, float]:
    x_h, y_h, x_f, y_f = (v + (1.0 if i == edge else 0.0) for i, v in enumerate(ends))
    return x_h, y_h, x_f, y_f


def _pose_std(length_of: Callable[[GroundPlane], float], plane: GroundPlane) -> float:
    """Return what the errors of the pose make of a length, to first order."""
    relative = np.diag([1 / plane.camera_height_m, 1.0, 1.0])
    covariance = relative @ plane.covariance @ relative
    slopes = []
    for step, posed in zip(
        _STEPS,
        (
            replace(plane, camera_height_m=plane.camera_height_m * (1 + _STEPS[0])),
            replace(plane, tilt_rad=plane.tilt_rad + _STEPS[1]),
            replace(plane, roll_rad=plane.roll_rad + _STEPS[2]),
        ),
        strict=True,
    ):
        slopes.append((length_of(posed) - length_of(plane)) / step)
    return float(math.sqrt(max(np.array(slopes) @ covariance @ np.array(slopes), 0.0)))
