"""The learned background of a fixed camera, and what in a picture differs from it.

Each pixel has a mean and a spread. The start is the median of pictures spread over the first seconds,
so that who walks through is not in it; then the mean follows slowly, and more slowly still where
something stands in front, so that a parked car becomes background in minutes, and most slowly where
somebody stands who came walking.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

import cv2
import numpy as np
import numpy.typing as npt

from pipeline.core.robust import MAD_TO_STD
from pipeline.images.decode import Image

FloatImage = npt.NDArray[np.float32]

# Grey levels of difference, at least, that count: JPEG at usual qualities leaves errors of 2-4 a pixel,
# the mean of nine has half of that.
MIN_DIFFERENCE = 10.0
# Standard deviations of a pixel's own flicker that count (foliage, water, sensor noise).
SPREADS = 4.5
# What changes slowly (reflections, the sky's light, what a codec renews now and then) does so by no more:
# clothes differ more from the ground.
SLOW_DIFFERENCE = 30.0
FOLLOW_S = 10.0  # time constant where the background shows
ABSORB_S = 90.0  # time constant where something stands before it
_AROUND = np.ones((5, 5), np.uint8)
HOLD_S = 900.0  # where that is somebody who came walking: people stand and talk for minutes
UPDATE_S = 0.8  # the background changes slowly; following it more often buys nothing


class Background:
    """Mean and spread of every pixel, (h, w, 3) in grey levels."""

    def __init__(self, pictures: Sequence[Image]) -> None:
        middle = _remedian(list(pictures))
        self._mean = middle.astype(np.float32)
        self._spread = _spread(pictures, middle)
        self._updated_s: float | None = None
        # Kept from frame to frame: fresh memory costs more than what is written into it.
        self._difference = np.empty_like(middle)
        self._planes: list[Image] = [np.empty(middle.shape[:2], np.uint8) for _ in range(3)]
        self._freeze()

    def _freeze(self) -> None:
        self.mean_u8: Image = cv2.convertScaleAbs(self._mean)
        limit = cv2.convertScaleAbs(self._spread, alpha=SPREADS)
        self._limit: Image = cv2.max(limit, MIN_DIFFERENCE)
        self._sample = _sampled(self.mean_u8)

    def difference(self, picture: Image, reference: Image) -> Image:
        """Return how much a picture differs from the background as it is now lit, (h, w)."""
        cv2.absdiff(picture, reference, dst=self._difference)
        return largest(self._difference, self._planes)

    def foreground(self, difference: Image) -> Image:
        """Return 255 where a difference is more than noise, else 0."""
        return cv2.compare(difference, self._limit, cv2.CMP_GT)

    def relit(self, picture: Image) -> Image:
        """Return the background at the brightness of this picture (clouds, automatic exposure)."""
        ratio = (_sampled(picture) / self._sample).ravel()
        middle = len(ratio) // 2
        gain = float(np.partition(ratio, middle)[middle])
        if abs(gain - 1.0) < 0.01:
            return self.mean_u8
        return cv2.convertScaleAbs(self.mean_u8, alpha=gain)

    def follow(
        self,
        picture: Image,
        occupied: Image,
        time_s: float,
        people: Sequence[tuple[int, int, int, int]] = (),
    ) -> bool:
        """Let the background follow a picture, and return whether it was time to.

        Args:
            picture: (h, w, 3).
            occupied: 255 where objects are, else 0, (h, w).
            time_s: of the picture.
            people: x0, y0, x1, y1 of those who have come walking, and may stand now.
        """
        if self._updated_s is None:
            self._updated_s = time_s
        elapsed_s = time_s - self._updated_s
        if elapsed_s < UPDATE_S:
            return False
        self._updated_s = time_s
        free = cv2.bitwise_not(occupied)
        # 1.25 turns a mean absolute deviation into a standard deviation (normal distribution)
        flicker = cv2.convertScaleAbs(largest(cv2.absdiff(picture, self.mean_u8)), alpha=1.25)
        calm_rate = 1.0 - np.exp(-elapsed_s / FOLLOW_S)
        cv2.accumulateWeighted(flicker, self._spread, calm_rate, mask=free)
        cv2.accumulateWeighted(picture, self._mean, calm_rate, mask=free)
        held = np.zeros_like(occupied)
        for x0, y0, x1, y1 in people:
            cv2.rectangle(held, (x0, y0), (x1 - 1, y1 - 1), (255,), cv2.FILLED)
        for part, time_constant_s in ((held, HOLD_S), (cv2.bitwise_not(held), ABSORB_S)):
            rate = 1.0 - np.exp(-elapsed_s / time_constant_s)
            cv2.accumulateWeighted(picture, self._mean, rate, mask=cv2.bitwise_and(part, occupied))
        self._freeze()
        return True

    def take(
        self, picture: Image, box: tuple[int, int, int, int], mask: Image | None = None
    ) -> None:
        """Take a part of a picture, x0, y0, x1, y1, for the background; around a mask, if given."""
        x0, y0, x1, y1 = box
        part = slice(y0, y1), slice(x0, x1)
        if mask is None:
            self._mean[part] = picture[part]
        else:
            near = cv2.dilate(mask[part], _AROUND) > 0
            self._mean[part][near] = picture[part][near]
        self.mean_u8[part] = cv2.convertScaleAbs(self._mean[part])
        self._sample = _sampled(self.mean_u8)


def largest(image: Image | cv2.typing.MatLike, planes: list[Image] | None = None) -> Image:
    """Return the largest of the three channels, (h, w).

    `planes`, three of that size, take the channels: splitting a picture into fresh memory costs three
    times as much.
    """
    blue, green, red = cv2.split(image, planes)
    return np.asarray(cv2.max(cv2.max(blue, green), red), np.uint8)


def _sampled(picture: Image) -> FloatImage:
    """Return some of the green pixels, which stand for the brightness; dark ones tell little of it."""
    step = max(2, picture.shape[1] // 32)
    return picture[::step, ::step, 1].astype(np.float32) + 8


def _spread(pictures: Sequence[Image], middle: Image) -> FloatImage:
    """Return the standard deviation of each pixel about the middle, (h, w).

    Where somebody stands for half of the time that is large, and nobody would ever be seen there: what
    is more than things of the background change in a while must change from picture to picture.
    """
    deviation = _remedian([largest(cv2.absdiff(picture, middle)) for picture in pictures])
    spread = deviation.astype(np.float32) * np.float32(MAD_TO_STD)
    changes = [largest(cv2.absdiff(a, b)) for a, b in pairwise(pictures)]
    if not changes:
        return spread
    # the difference of two pictures has twice the variance of one
    flicker = _remedian(changes).astype(np.float32) * np.float32(MAD_TO_STD / math.sqrt(2))
    return np.minimum(spread, np.maximum(flicker, SLOW_DIFFERENCE / SPREADS))


def medians_of_5(images: Sequence[Image]) -> list[Image]:
    """Return the median of each five images in order; what is left over is left out."""
    return [_median_of_5(list(images[i : i + 5])) for i in range(0, len(images) - 4, 5)]


def _remedian(images: list[Image]) -> Image:
    """Return the median of the medians of groups of five, over again until one is left.

    The remedian (Rousseeuw and Bassett 1990) needs minima and maxima alone, which OpenCV finds in a
    hundredth of the time of a sort; of 25 pictures it bears 8 that are all wrong.
    """
    while len(images) >= 5:
        images = medians_of_5(images)
    if len(images) == 1:
        return images[0]
    return np.median(np.stack(images), axis=0).astype(np.uint8)


def _median_of_5(images: list[Image]) -> Image:
    a, b, c, d, e = images
    low = cv2.max(cv2.min(a, b), cv2.min(c, d))
    high = cv2.min(cv2.max(a, b), cv2.max(c, d))
    return cv2.max(cv2.min(e, low), cv2.min(cv2.max(e, low), high))
