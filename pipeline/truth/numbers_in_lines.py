"""Truth in lines of numbers: MOT Challenge and KITTI tracking.

MOT    Milan et al. (2016), MOT16: A Benchmark for Multi-Object Tracking, arXiv:1603.00831, section 4:
       frame, id, left, top, width, height, consider, class, visibility; frames and pixels from 1.
       Leal-Taixe et al. (2015), arXiv:1504.01942: the same with x, y, z for class and visibility.
KITTI  Geiger et al. (2012), and the development kit of the tracking benchmark: frame, track, type,
       truncated, occluded, alpha, left, top, right, bottom, height, width, length, x, y, z, rotation;
       frames and pixels from 0; x to the right, y down, z ahead of the camera.
"""

from __future__ import annotations

import math

from pipeline.core.arrays import NAN
from pipeline.truth.rows import TruthFile, TruthRow

# Classes of MOT16 and later: people first. What is no upright person of its own is not counted.
_MOT_CLASSES = {
    1: "person",
    2: "person_on_vehicle",
    3: "car",
    4: "bicycle",
    5: "motorbike",
    6: "vehicle",
    7: "static_person",
    8: "distractor",
    9: "occluder",
    10: "occluder",
    11: "occluder",
    12: "reflection",
    13: "crowd",
}
_MOT_IGNORED = (2, 7, 8, 12, 13)
_KITTI_PERSON = {"Pedestrian": "person", "Person": "person"}
_KITTI_UNKNOWN = -1000.0  # metres: no such object was measured
_MOST_REFUSED = 20  # reasons that are kept


def read_mot(text: str) -> TruthFile:
    """Return the truth of a MOT Challenge file (`gt.txt`)."""
    truth = TruthFile("mot", first_frame=1)
    for number, line in enumerate(text.splitlines(), 1):
        fields = line.replace(",", " ").split()
        if not fields:
            continue
        try:
            values = [float(f) for f in fields]
            frame, identity = _whole(values[0]), _whole(values[1])
            left, top, width, height = values[2:6]
        except (ValueError, IndexError, OverflowError):
            _refuse(truth, number, line)
            continue
        # Pixels count from 1, and an edge is half a pixel outside of the centre.
        box = (left - 1.5, top - 1.5, left - 1.5 + width, top - 1.5 + height)
        kind = _whole(values[7]) if len(values) in (8, 9) and values[7] == values[7] // 1 else 1
        considered = len(values) < 7 or values[6] != 0
        ignored = not considered or kind in _MOT_IGNORED
        if identity < 0:
            _refuse(truth, number, line, "it has no identity: these are detections, not truth")
            continue
        name = _MOT_CLASSES.get(kind, "unknown")
        truth.add(TruthRow(frame, str(identity), name, box), ignored=ignored)
    truth.fill_frames()
    return truth


def read_kitti(text: str) -> TruthFile:
    """Return the truth of a label file of KITTI tracking."""
    truth = TruthFile("kitti", first_frame=0)
    for number, line in enumerate(text.splitlines(), 1):
        fields = line.split()
        if not fields:
            continue
        try:
            frame, identity, kind = int(fields[0]), int(fields[1]), fields[2]
            values = [float(f) for f in fields[3:17]]
            left, top, right, bottom = values[3:7]
        except (ValueError, IndexError):
            _refuse(truth, number, line)
            continue
        box = (left, top, right, bottom)
        if kind == "DontCare":
            truth.add(TruthRow(frame, "", None, box), ignored=True)
            continue
        tall, wide, x, z = (values[i] if len(values) > i else NAN for i in (7, 8, 10, 12))
        measured = z > 0 and x > _KITTI_UNKNOWN
        truth.add(
            TruthRow(
                frame,
                str(identity),
                _KITTI_PERSON.get(kind, kind.lower()),
                box,
                depth_m=z if measured else NAN,
                height_m=tall if tall > 0 else NAN,
                width_m=wide if wide > 0 else NAN,
                x_m=x if measured else NAN,
                y_m=z if measured else NAN,
                range_m=math.hypot(x, z) if measured else NAN,
            )
        )
    truth.fill_frames()
    return truth


def _whole(value: float) -> int:
    if value != math.floor(value):
        raise ValueError(value)
    return int(value)


def _refuse(truth: TruthFile, number: int, line: str, reason: str = "it is no row") -> None:
    if len(truth.refused) < _MOST_REFUSED:
        truth.refused.append(f"line {number}: {reason}: {line[:80]!r}")
    else:
        truth.refused.append("")
