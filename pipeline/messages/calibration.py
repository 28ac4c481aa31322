"""The pinhole camera: foxglove.CameraCalibration and sensor_msgs/CameraInfo."""

from __future__ import annotations

import math

from pipeline.core.records import Intrinsics
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
from pipeline.optics.distortion import check_distortion

MAX_SIDE_PX = 1_000_000


def camera_calibration(tree: Tree) -> Decoded:
    """Return the intrinsics; none where K is no camera matrix. ROS 2 writes K in lower case."""
    k, refused = numbers(tree, "K", "k"), list[str]()
    time_ns, frame_id = time_of(tree), frame_id_of(tree)
    if not k or k[0] == 0:  # how ROS and Foxglove say that a camera was not calibrated
        sentence = "the calibration is empty: the camera was not calibrated"
        return Decoded(time_ns, frame_id, None, [sentence], "no_calibration")
    if len(k) != 9 or not all(map(math.isfinite, k)) or k[0] <= 0 or k[4] <= 0:
        sentence = "K is not nine finite numbers with positive focal lengths; it is not used"
        return Decoded(time_ns, frame_id, None, [sentence], "doubtful_lens")
    width_px, height_px = whole(tree, "width"), whole(tree, "height")
    if not (0 <= width_px <= MAX_SIDE_PX and 0 <= height_px <= MAX_SIDE_PX):
        sentence = f"it is for pictures of {width_px} x {height_px} pixels; it is not used"
        return Decoded(time_ns, frame_id, None, [sentence], "doubtful_lens")
    model, distortion = _distortion(tree, refused)
    whole_sensor = Intrinsics(width_px, height_px, k[0], k[4], k[2], k[5], model, distortion)
    return Decoded(time_ns, frame_id, _of_region(whole_sensor, tree), refused, "doubtful_lens")


def _distortion(tree: Tree, refused: list[str]) -> tuple[str, tuple[float, ...]]:
    model, coefficients = text(tree, "distortion_model"), tuple(numbers(tree, "D", "d"))
    if not any(coefficients):
        return "", ()
    try:
        check_distortion(model, coefficients)
    except ValueError as error:
        refused.append(f"{error}; taken as no distortion, which is wrong towards the edges")
        return "", ()
    return model, coefficients


def _of_region(camera: Intrinsics, tree: Tree) -> Intrinsics:
    """Return the intrinsics of the pictures: K is that of the whole sensor.

    Source: the definition of sensor_msgs/CameraInfo (`binning_x`, `roi`).
    """
    bin_x, bin_y = max(whole(tree, "binning_x"), 1), max(whole(tree, "binning_y"), 1)
    region = child(tree, "roi")
    x, y = whole(region, "x_offset"), whole(region, "y_offset")
    width_px = whole(region, "width") or camera.width_px
    height_px = whole(region, "height") or camera.height_px
    if (bin_x, bin_y, x, y, width_px, height_px) == (1, 1, 0, 0, camera.width_px, camera.height_px):
        return camera
    return Intrinsics(
        width_px // bin_x,
        height_px // bin_y,
        camera.fx_px / bin_x,
        camera.fy_px / bin_y,
        # the centre of the first pixel is (0, 0): the corner at -0.5 is what stays in place
        (camera.cx_px - x + 0.5) / bin_x - 0.5,
        (camera.cy_px - y + 0.5) / bin_y - 0.5,
        camera.distortion_model,
        camera.distortion,
    )
