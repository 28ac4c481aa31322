"""Shares of a window of 1920x1080 that the views take.

Labels keep their size on the screen, so where they collide depends on it; in other windows they only
sit less well.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

WINDOW_PX = (1920.0, 1010.0)  # what the viewer's own bars leave
TITLE_PX = 25.0
PICTURE_SHARE = 0.63  # of the height
# The left column is as wide as the picture needs, within what the plots beside it can spare.
COLUMN_SHARES = (0.40, 0.60)
DEFAULT_ASPECT = 16 / 9
# How many pictures are beside each other where there are several cameras, how many in all, and what
# share of the height they have.
PICTURES_ACROSS, MOST_PICTURES = 3, 9
PICTURES_SHARE = 0.5


def left_share(camera: Mapping[str, Any]) -> float:
    """Return the share of the window's width that the picture's column takes."""
    height_px = WINDOW_PX[1] * PICTURE_SHARE - TITLE_PX
    low, high = COLUMN_SHARES
    return min(max(height_px * _aspect(camera) / WINDOW_PX[0], low), high)


def screen_scale(camera: Mapping[str, Any], cameras: int = 1) -> float:
    """Return how many pixels of the screen a pixel of the picture takes; of several, beside others."""
    width_px, height_px = camera["width_px"], camera["height_px"]
    if not width_px or not height_px:
        return 1.0
    panel_px = (left_share(camera) * WINDOW_PX[0], WINDOW_PX[1] * PICTURE_SHARE - TITLE_PX)
    if cameras > 1:
        across = min(cameras, PICTURES_ACROSS)
        rows = math.ceil(min(cameras, MOST_PICTURES) / across)
        panel_px = (WINDOW_PX[0] / across, WINDOW_PX[1] * PICTURES_SHARE / rows - TITLE_PX)
    return min(panel_px[0] / width_px, panel_px[1] / height_px)


def _aspect(camera: Mapping[str, Any]) -> float:
    width_px, height_px = camera["width_px"], camera["height_px"]
    return width_px / height_px if width_px and height_px else DEFAULT_ASPECT
