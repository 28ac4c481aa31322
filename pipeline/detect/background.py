"""The learned background of a fixed camera, and what in a picture differs from it.

Each pixel has a mean and a spread. The start is the median of pictures spread over the first seconds,
so that who walks through is not in it; then the mean follows slowly, and more slowly still where
something stands in front, so that a parked car becomes background in a minute and a person does not.
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
import numpy.typing as npt

from pipeline.picture import Image

FloatImage = npt.NDArray[np.float32]

# Grey levels of difference, at least, that count: JPEG at usual qualities leaves errors of 2-4.
MIN_DIFFERENCE = 16.0
# Standard deviations of a pixel's own flicker that count (foliage, water, sensor noise).
SPREADS = 4.5
# 1.4826 turns a median absolute deviation into a standard deviation (normal distribution).
MAD_TO_STD = 1.4826
FOLLOW_S = 10.0  # time constant where the background shows
ABSORB_S = 90.0  # time constant where something stands before it
UPDATE_S = 0.4  # the background changes slowly; following it more often buys nothing
# A cast shadow scales the background's light by a factor and keeps its colour (Horprasert 1999).
SHADOW_DARKEST, SHADOW_BRIGHTEST = 0.45, 0.95
SHADOW_COLOUR = 0.06  # distance from the line of scaled background, relative to its brightness
SHADOW_TEXTURE = 0.05  # spread of the scale within a small window, on smooth ground in shadow


class Background:
    """Mean and spread of every pixel, (h, w, 3) in grey levels."""

    def __init__(self, pictures: Sequence[Image]) -> None:
        stack = np.stack(pictures)
        mean = np.empty(stack.shape[1:], dtype=np.float32)
        spread = np.empty(stack.shape[1:3], dtype=np.float32)
        for row in range(0, len(mean), 32):  # in strips: the sort must not need the whole stack
            strip = stack[:, row : row + 32]
            middle = np.median(strip, axis=0)
            mean[row : row + 32] = middle
            deviation = np.abs(strip - middle.astype(np.float32)).max(axis=3)
            spread[row : row + 32] = MAD_TO_STD * np.median(deviation, axis=0)
        self._mean = mean
        self._spread = spread
        self._updated_s: float | None = None
        self._freeze()

    def _freeze(self) -> None:
        self.mean_u8: Image = self._mean.round().astype(np.uint8)
        limit = np.maximum(MIN_DIFFERENCE, SPREADS * self._spread)
        self._limit: Image = np.minimum(limit, 254).astype(np.uint8)

    def difference(self, picture: Image) -> Image:
        """Return the largest difference of a pixel's channels, (h, w), brightness changes removed."""
        reference = self._relit(picture)
        blue, green, red = cv2.split(cv2.absdiff(picture, reference))
        return cv2.max(cv2.max(blue, green), red)  # type: ignore[return-value]

    def foreground(self, difference: Image) -> Image:
        """Return 255 where a difference is more than noise, else 0."""
        return cv2.compare(difference, self._limit, cv2.CMP_GT)  # type: ignore[return-value]

    def _relit(self, picture: Image) -> Image:
        """Return the background at the brightness of this picture (clouds, automatic exposure)."""
        step = max(2, picture.shape[1] // 64)
        now = picture[::step, ::step].astype(np.float32).sum(axis=2)
        then = self.mean_u8[::step, ::step].astype(np.float32).sum(axis=2)
        gain = float(np.median((now + 8.0) / (then + 8.0)))
        if abs(gain - 1.0) < 0.01:
            return self.mean_u8
        return cv2.convertScaleAbs(self.mean_u8, alpha=gain)  # type: ignore[return-value]

    def shadow(self, picture: Image, foreground: Image) -> Image:
        """Return 255 where the foreground is ground in shadow: darker, same colour, no texture."""
        rows, columns = np.nonzero(foreground)
        shadow = np.zeros_like(foreground)
        if len(rows) == 0:
            return shadow
        now = picture[rows, columns].astype(np.float32)
        then = self.mean_u8[rows, columns].astype(np.float32) + 1.0
        brightness = np.einsum("ij,ij->i", then, then)
        scale = np.einsum("ij,ij->i", now, then) / brightness
        off_line = np.sqrt(((now - scale[:, None] * then) ** 2).sum(axis=1) / brightness)
        alike = (scale > SHADOW_DARKEST) & (scale < SHADOW_BRIGHTEST) & (off_line < SHADOW_COLOUR)
        scales = np.zeros(foreground.shape, dtype=np.float32)
        scales[rows, columns] = scale
        weight = (foreground > 0).astype(np.float32)
        smooth = _local_std(scales, weight)[rows, columns] < SHADOW_TEXTURE
        shadow[rows[alike & smooth], columns[alike & smooth]] = 255
        return shadow

    def follow(self, picture: Image, occupied: Image, time_s: float) -> None:
        """Let the background follow a picture; `occupied` (h, w) is not 0 where objects are."""
        if self._updated_s is None:
            self._updated_s = time_s
        elapsed_s = time_s - self._updated_s
        if elapsed_s < UPDATE_S:
            return
        self._updated_s = time_s
        rate = 1.0 - np.exp(-elapsed_s / np.where(occupied > 0, ABSORB_S, FOLLOW_S))
        change = picture - self._mean
        self._mean += rate[..., None].astype(np.float32) * change
        calm = (occupied == 0).astype(np.float32)
        flicker = np.abs(change).max(axis=2) * 1.25  # mean absolute deviation to std
        self._spread += (rate * calm).astype(np.float32) * (flicker - self._spread)
        self._freeze()


def _local_std(values: FloatImage, weight: FloatImage) -> FloatImage:
    size = (5, 5)
    count = cv2.blur(weight, size) + 1e-6
    mean = cv2.blur(values * weight, size) / count
    square = cv2.blur(values * values * weight, size) / count
    return np.sqrt(np.maximum(square - mean * mean, 0.0))
