"""Sizes of things that may be turned: the box is not the thing.

The height of a box is that of an upright thing across the axis. A card that hangs askew has a higher box
by its width times the sine of the turn; one that leans towards the camera has a lower box. Neither can be
told from a box, and both are the same in all frames of a track, so they are considered: a mean and a
deviation that does not average out (`estimate.boxes.turned_box`). So with widths, and the depths that
they give.

People stand upright, and so does what the camera file names (`[estimate] upright`). With the pose known
the camera's roll is known too, and height is measured as of a vertical thing that stands on the ground.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from pipeline.core.calibration import Dimension
from pipeline.core.config import EstimateConfig
from pipeline.core.records import Diagnostic, Severity
from pipeline.estimate.boxes.turned_box import Share, height_share
from pipeline.estimate.types import BoolArray, Estimated, Measured


def may_be_turned(measured: Measured, config: EstimateConfig) -> BoolArray:
    """Return which observations, (n,), are of things that nothing keeps upright."""
    if measured.ground_plane is not None:
        return np.zeros(len(measured), dtype=np.bool_)
    return np.asarray(~np.isin(measured.class_name.astype(str), config.upright))


def shares_of(
    measured: Measured, config: EstimateConfig, dimension: Dimension = Dimension.HEIGHT
) -> Share | None:
    """Return true sizes as shares of the boxes', (n,) each; None where nothing may be turned."""
    rows = may_be_turned(measured, config)
    if not rows.any() or not (config.turn_std_deg > 0 or config.slant_std_deg > 0):
        return None
    box = measured.bbox_xyxy_px[rows]
    # A side that is cut off leaves at least what is seen.
    with np.errstate(invalid="ignore", divide="ignore"):
        ratio = (box[:, 2] - box[:, 0]) / (box[:, 3] - box[:, 1])
        ratio = 1 / ratio if dimension is Dimension.WIDTH else ratio
    ratio = np.where(np.isfinite(ratio) & (ratio > 0), ratio, np.nan)
    some = height_share(ratio, np.radians(config.turn_std_deg), np.radians(config.slant_std_deg))
    mean, std = np.ones(len(rows)), np.zeros(len(rows))
    mean[rows], std[rows] = some
    return Share(mean, std)


def as_turned(estimated: Estimated, share: Share | None) -> Estimated:
    """Return estimates whose heights count with the unknown turn; what was put in stays."""
    if share is None:
        return estimated
    put_in = estimated.height_assumed
    mean, std = np.where(put_in, 1.0, share.mean), np.where(put_in, 0.0, share.std)
    turn_m = np.nan_to_num(estimated.height_m * std)
    return replace(
        estimated,
        height_m=estimated.height_m * mean,
        height_std_m=np.hypot(estimated.height_std_m * mean, turn_m),
        height_common_std_m=np.hypot(estimated.height_common_std_m * mean, turn_m),
    )


def turn_notes(
    measured: Measured, made: Iterable[Estimated], config: EstimateConfig
) -> list[Diagnostic]:
    """Tell, once a class, that its heights count with a turn that is unknown."""
    rows = may_be_turned(measured, config)
    told = np.zeros(len(measured), dtype=np.bool_)
    for estimated in made:
        told |= rows & np.isfinite(estimated.height_m) & ~estimated.height_assumed
    return [
        Diagnostic(
            Severity.INFO,
            "height_may_be_turned",
            f"nothing says that {name!r} stands upright: its heights count with an unknown turn of "
            f"{config.turn_std_deg:g} degrees in the picture and {config.slant_std_deg:g} out of it "
            f"(one standard deviation). `upright` in [estimate] of the camera file names what stands "
            "upright; a surveyed pose helps what stands on the ground",
            camera=measured.camera,
            count=int((told & (measured.class_name == name)).sum()),
        )
        for name in sorted(set(measured.class_name[told]))
    ]
