"""The pinhole camera: foxglove.CameraCalibration and sensor_msgs/CameraInfo.

A message is taken as it is; for which pictures it holds is decided beside a picture
(`pipeline.messages.lens_readings`).
"""

from __future__ import annotations

import math

from pipeline.core.records import LensClaim
from pipeline.messages.content import Decoded
from pipeline.messages.tree import (
    Tree,
    child,
    frame_id_of,
    numbers,
    text,
    time_of,
    whole,
)
from pipeline.optics.distortion import BROWN_MODELS, check_distortion

MAX_SIDE_PX = 1_000_000
# Coefficients of a message without a model: so many are of one model only.
_MODEL_BY_COUNT = {5: BROWN_MODELS[0], 8: BROWN_MODELS[1]}


def camera_calibration(tree: Tree) -> Decoded:
    """Return what a message states of the lens; None where it states nothing of use.

    ROS 2 writes K, D and P in lower case.
    """
    k, p, refused = numbers(tree, "K", "k"), numbers(tree, "P", "p"), list[str]()
    time_ns, frame_id = time_of(tree), frame_id_of(tree)
    if not any(k) and not any(p):  # how ROS and Foxglove say that a camera was not calibrated
        sentence = (
            "the calibration is empty: the camera was not calibrated; give focal length and pixel "
            "pitch, or fx_px, in a camera file"
        )
        return Decoded(time_ns, frame_id, None, [sentence], "no_calibration")
    k = _matrix("K", k, 9, refused)
    p = _matrix("P", p, 12, refused) if any(p) else []
    if not k and not p:
        return Decoded(time_ns, frame_id, None, refused, "doubtful_lens")
    region = child(tree, "roi")
    left, top = whole(region, "x_offset"), whole(region, "y_offset")
    roi = (left, top, whole(region, "width"), whole(region, "height"))
    size = whole(tree, "width"), whole(tree, "height")
    if not all(0 <= side <= MAX_SIDE_PX for side in (*size, *roi)):
        sentence = (
            f"it is for pictures of {size[0]} x {size[1]} pixels, region {roi}; it is not used"
        )
        return Decoded(time_ns, frame_id, None, [sentence], "doubtful_lens")
    model, distortion = _distortion(tree, refused)
    binning = _binning(tree, "binning_x"), _binning(tree, "binning_y")
    claim = LensClaim(*size, tuple(k), tuple(p), model, distortion, binning, roi)
    return Decoded(time_ns, frame_id, claim, refused, "doubtful_lens")


def _matrix(name: str, values: list[float], count: int, refused: list[str]) -> list[float]:
    """Return a matrix; an empty one, and a sentence, where it is none."""
    if len(values) == count and all(map(math.isfinite, values)):
        return values
    if any(values):
        refused.append(f"{name} is not {count} finite numbers; it is not used")
    return []


def _binning(tree: Tree, name: str) -> int:
    return min(max(whole(tree, name), 1), MAX_SIDE_PX)  # 0 is 1 by definition


def _distortion(tree: Tree, refused: list[str]) -> tuple[str, tuple[float, ...]]:
    model, coefficients = text(tree, "distortion_model"), tuple(numbers(tree, "D", "d"))
    if not any(coefficients):
        return "", ()
    if not model and len(coefficients) in _MODEL_BY_COUNT:
        model = _MODEL_BY_COUNT[len(coefficients)]
        refused.append(
            f"no distortion model is named; {len(coefficients)} coefficients are taken as {model!r}"
        )
    try:
        if not model:
            raise ValueError(f"{len(coefficients)} distortion coefficients come without a model")
        check_distortion(model, coefficients)
    except ValueError as error:
        refused.append(f"{error}; taken as no distortion, which is wrong towards the edges")
        return "", ()
    return model, coefficients
