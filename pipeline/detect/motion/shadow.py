"""Model of cast shadows, learned from the recording itself.

In one scene every shadow of the sun dims the ground by the same factors: what is left is the light of
the sky (Horprasert et al. 1999 keep the colour, but the sky is bluer than the sun, so the factors of
blue, green and red differ). Foreground that is dimmed by factors that many others share, and lies low in
its silhouette, is shadow: in a histogram of the factors it makes a peak. Clothes make none, or one
that is not low. Where there is no peak there is no sun, and nothing is taken for shadow.
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
import numpy.typing as npt
from scipy.ndimage import uniform_filter

from pipeline.detect.motion.background import largest
from pipeline.images.decode import Image

FloatImage = npt.NDArray[np.float32]
Box = tuple[int, int, int, int]

# Factors are kept as bytes, 1.0 being this.
UNIT = 128
BINS = 32  # a channel, of 8 / 256 of the range: 4 / 128 or 3 % each
_SHIFT = 256 // BINS
# A cast shadow leaves between a third of the light (a clear sky and a steep tone curve) and four fifths.
DARKEST, BRIGHTEST = 0.33, 0.92
# The peak: this share of all foreground, within one bin either side, and its middle in the lower part of
# the silhouettes. Without sun, simulated scenes and `street` have up to 0.08, at half of the height.
MIN_SHARE = 0.085
LOW = 0.43
# With the sun ahead of a steep camera, shadows fall upwards and reach as high as heads: a peak that
# so large a share of the foreground is in is no clothing, if it lies no higher than bodies do.
CLEAR_SHARE, CLEAR_LOW = 0.2, 0.55
MIN_PIXELS = 2000
REFIT_EVERY = 12  # lessons
FADE = 0.98  # of the histogram, a lesson: the sun comes and goes
# How far the factors of a shadow are from the peak: the ground's own colour, noise, the tone curve.
# That is measured, within bounds.
SPREADS = 2.2  # standard deviations; 1.18 of them are half of a peak's width at half of its height
TOLERANCE = (0.05, 0.10)
# Near feet less of the sky is seen: such shadows are neutral, and the two add up.
NEUTRAL = (0.75, 0.75, 0.75)
SHARE_UNIT = 64  # shares are kept as bytes, 1.0 being this
DEEPEST = 1.7  # times what a shadow takes away
# In the soft edge of a shadow the factors lie between the peak and 1; where feet touch the ground less
# sky is seen too.
EDGE_DARKEST, EDGE_BRIGHTEST = 0.75, 0.97
MIN_SHADE_PX = 3  # a shadow is an area at least so wide
_CORE = np.ones((MIN_SHADE_PX, MIN_SHADE_PX), np.uint8)
_AROUND = np.ones((5, 5), np.uint8)


class ShadowLight:
    """The factors by which shadows dim the ground, if there are any."""

    def __init__(self) -> None:
        self._count = np.zeros(BINS**3)
        self._height = np.zeros(BINS**3)  # sum of the relative heights of the counted pixels
        self._lessons = 0
        self.factors: npt.NDArray[np.float64] | None = None
        self._shading = _shading(NEUTRAL)
        self._bounds: tuple[tuple[float, ...], ...] = ()

    def learn(self, ratio: Image, mask: Image, boxes: Sequence[Box]) -> None:
        """Take the foreground of a picture into account.

        Args:
            ratio: the picture over its background, (h, w, 3), 1 being `UNIT`.
            mask: 255 where something differs, shadows too.
            boxes: x0, y0, x1, y1 of what is connected.
        """
        self._count *= FADE
        self._height *= FADE
        for x0, y0, x1, y1 in boxes:
            inner = cv2.erode(mask[y0:y1, x0:x1], _CORE)
            rows, columns = np.nonzero(inner)
            if not len(rows):
                continue
            blue, green, red = (ratio[y0 + rows, x0 + columns] // _SHIFT).T.astype(np.intp)
            index = (blue * BINS + green) * BINS + red
            height = 1.0 - (rows + 0.5) / (y1 - y0)
            self._count += np.bincount(index, minlength=BINS**3)
            self._height += np.bincount(index, weights=height, minlength=BINS**3)
        self._lessons += 1

    def fit(self) -> None:
        """Look for the peak."""
        total = self._count.sum()
        self.factors, self._shading = None, _shading(NEUTRAL)
        if total < MIN_PIXELS:
            return
        cube = self._count.reshape(BINS, BINS, BINS)
        near = uniform_filter(cube, 3, mode="constant") * 27
        low, high = int(DARKEST * UNIT) // _SHIFT, int(BRIGHTEST * UNIT) // _SHIFT
        inside = near[low : high + 1, low : high + 1, low : high + 1]
        at = np.array(np.unravel_index(inside.argmax(), inside.shape)) + low
        if near[tuple(slice(a - 2, a + 3) for a in at)].max() > near[tuple(at)]:
            return  # the flank of a peak that is too bright: the soft shadow around feet
        window = tuple(slice(a - 1, a + 2) for a in at)
        members = cube[window]
        share = members.sum() / total
        height = self._height.reshape(cube.shape)[window].sum() / members.sum()
        if share < MIN_SHARE or height > (LOW if share < CLEAR_SHARE else CLEAR_LOW):
            return
        places = np.stack(np.meshgrid(*(np.arange(a - 1, a + 2) for a in at), indexing="ij"))
        middle = (places * members).sum(axis=(1, 2, 3)) / members.sum()
        factors = (middle + 0.5) * _SHIFT / UNIT
        if factors.mean() > BRIGHTEST:
            return
        self.factors, self._shading = factors, _shading(factors)
        tolerance = self._tolerance(cube, at)
        level = self.factors * UNIT
        self._bounds = (
            tuple(level - tolerance * UNIT),
            tuple(level + tolerance * UNIT),
            tuple(level * EDGE_DARKEST),
            (UNIT * EDGE_BRIGHTEST,) * 3,
        )

    def _tolerance(self, cube: npt.NDArray[np.float64], at: npt.NDArray[np.intp]) -> float:
        """Return how far the factors of a shadow are from the peak, by its width at half height."""
        low, high = np.maximum(at - 1, 0), np.minimum(at + 2, BINS)
        widths = []
        for axis in range(3):
            window = [slice(a, b) for a, b in zip(low, high, strict=True)]
            window[axis] = slice(None)
            profile = cube[tuple(window)].sum(axis=tuple(k for k in range(3) if k != axis))
            over = profile >= profile[at[axis]] / 2
            left = right = at[axis]
            while left > 0 and over[left - 1]:
                left -= 1
            while right < BINS - 1 and over[right + 1]:
                right += 1
            widths.append(right - left + 1)
        half = float(np.mean(widths)) / 2 * _SHIFT / UNIT
        return float(np.clip(SPREADS * half / 1.18, *TOLERANCE))

    def maybe_fit(self) -> None:
        """Look for the peak again every so often."""
        if self._lessons % REFIT_EVERY == 0:
            self.fit()

    def find(self, ratio: Image) -> Image | None:
        """Return 255 where a part of a picture is ground in shadow, else 0; None where nothing is."""
        if self.factors is None:
            return None
        darkest, brightest, edge_darkest, edge_brightest = self._bounds
        core = cv2.inRange(ratio, darkest, brightest)
        core = cv2.morphologyEx(core, cv2.MORPH_OPEN, _CORE)
        edge = cv2.inRange(ratio, edge_darkest, edge_brightest)
        around = cv2.dilate(core, _AROUND)
        return np.asarray(cv2.bitwise_or(core, cv2.bitwise_and(edge, around)), np.uint8)

    def unshaded_in(self, picture: Image, background: Image, parts: Sequence[Box]) -> list[Image]:
        """Return what `unshaded` does of each part x0, y0, x1, y1, all of them in one row of pixels."""
        if not parts:
            return []
        now, then = (
            np.concatenate([image[y0:y1, x0:x1].reshape(-1, 3) for x0, y0, x1, y1 in parts])[None]
            for image in (picture, background)
        )
        row, shaped, at = self.unshaded(now, then)[0], [], 0
        for x0, y0, x1, y1 in parts:
            end = at + (y1 - y0) * (x1 - x0)
            shaped.append(row[at:end].reshape(y1 - y0, x1 - x0))
            at = end
        return shaped

    def unshaded(self, picture: Image, background: Image) -> Image:
        """Return the differences of pixels (h, w, 3) from the background in the shade that fits best.

        The shade is a share t of what the shadow takes away: factors 1 - t (1 - f) on each channel, t
        being the least-squares one of each pixel.
        """
        to_share, to_ratio = self._shading
        ratio = cv2.divide(picture, background, scale=UNIT)
        share = cv2.min(cv2.transform(ratio, to_share), DEEPEST * SHARE_UNIT)
        off = cv2.absdiff(ratio, cv2.transform(share, to_ratio))
        return largest(cv2.multiply(off, background, scale=1 / UNIT))


def _shading(factors: Sequence[float]) -> tuple[FloatImage, FloatImage]:
    """Return the matrices from factors to the share of the shadow, in bytes, and back."""
    taken = 1.0 - np.asarray(factors, np.float32)
    onto = taken / (taken @ taken) * SHARE_UNIT
    to_share = np.append(-onto / UNIT, onto.sum())[None]
    to_ratio = np.stack([-taken * UNIT / SHARE_UNIT, np.full(3, UNIT, np.float32)], axis=1)
    return to_share.astype(np.float32), to_ratio.astype(np.float32)
