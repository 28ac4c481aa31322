"""Input of a network from a picture, and boxes brought back into the picture.

Networks count positions in pixels from the outer edge of the first one; stored pixels have the
centre of the first one at 0. Scaling keeps edges on edges, so

    network = (stored + 0.5) * scale + pad
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import cv2
import numpy as np
import numpy.typing as npt

from pipeline.core.arrays import FloatArray
from pipeline.images.decode import Image

PAD_LEVEL = 114  # the grey with which YOLO networks are trained to see nothing


class Fit(StrEnum):
    """Ways to put a picture of any shape into a network's input."""

    LETTERBOX = "letterbox"  # shape kept, in the middle, grey around (Ultralytics, YOLOv5-v7)
    CORNER = "corner"  # shape kept, in the upper left corner, grey below or to the right (YOLOX)
    STRETCH = "stretch"  # shape not kept (RT-DETR)


@dataclass(frozen=True, slots=True)
class Normalisation:
    """Scale of a network's input from levels 0..255: (level / divisor - mean) / std, R G B or B G R."""

    rgb: bool = True
    divisor: float = 255.0
    mean: tuple[float, float, float] = (0.0, 0.0, 0.0)
    std: tuple[float, float, float] = (1.0, 1.0, 1.0)


@dataclass(frozen=True, slots=True)
class Placement:
    """Place of a picture in a network's input: scale and pad along x and y."""

    scale: tuple[float, float]
    pad: tuple[float, float]

    def to_network(self, bbox: FloatArray) -> FloatArray:
        """Return boxes (n, 4) of stored pixels in the network's."""
        return np.asarray((bbox + 0.5) * np.tile(self.scale, 2) + np.tile(self.pad, 2))

    def to_stored(self, bbox: FloatArray) -> FloatArray:
        """Return boxes (n, 4) of the network's pixels in stored ones."""
        return np.asarray((bbox - np.tile(self.pad, 2)) / np.tile(self.scale, 2) - 0.5)


def place(width_px: int, height_px: int, size: tuple[int, int], fit: Fit) -> Placement:
    """Return where a picture comes to lie in an input of `size` (width, height)."""
    wide, tall = size
    if fit is Fit.STRETCH:
        return Placement((wide / width_px, tall / height_px), (0.0, 0.0))
    ratio = min(wide / width_px, tall / height_px)
    # The picture is shrunk to whole pixels: its two scales differ by the rounding.
    inner = max(round(width_px * ratio), 1), max(round(height_px * ratio), 1)
    pad = (0.0, 0.0)
    if fit is Fit.LETTERBOX:
        pad = float((wide - inner[0]) // 2), float((tall - inner[1]) // 2)
    return Placement((inner[0] / width_px, inner[1] / height_px), pad)


def fill(bgr: Image, size: tuple[int, int], placement: Placement) -> Image:
    """Return the network's input picture (h, w, 3) for a picture."""
    height_px, width_px = bgr.shape[:2]
    inner = round(width_px * placement.scale[0]), round(height_px * placement.scale[1])
    small = bgr if inner == (width_px, height_px) else cv2.resize(bgr, inner)
    if inner == size:
        return np.asarray(small, dtype=np.uint8)
    filled = np.full((size[1], size[0], 3), PAD_LEVEL, dtype=np.uint8)
    left, top = (int(p) for p in placement.pad)
    filled[top : top + inner[1], left : left + inner[0]] = small
    return filled


def normalised(bgr: Image, how: Normalisation, dtype: npt.DTypeLike) -> npt.NDArray[np.generic]:
    """Return a picture (h, w, 3) as a network's input (1, 3, h, w).

    A network that takes whole numbers does its own scaling: it gets the levels as they are.
    """
    image = bgr[..., ::-1] if how.rgb else bgr
    planes = np.ascontiguousarray(image.transpose(2, 0, 1))[None]
    if np.dtype(dtype) == np.uint8:
        return planes
    scale = 1.0 / (how.divisor * np.array(how.std))
    shift = np.array(how.mean) / np.array(how.std)
    values = planes * scale.astype(np.float32)[:, None, None]
    values -= shift.astype(np.float32)[:, None, None]
    return np.asarray(values.astype(dtype, copy=False))
