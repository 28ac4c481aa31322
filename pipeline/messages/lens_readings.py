"""Readings of a calibration: for which pictures its camera matrix holds.

`sensor_msgs/CameraInfo` defines K, D and P for the whole sensor; binning and region of interest are
still to be applied. Drivers state K of the picture as it is sent, transposed, in shares of the
picture's size, for pictures of another size, or a dummy. Each reading is examined against what no lens
can be; the definition goes first, any other reading is taken where it is the only possible one, and
told. Where none is possible the calibration is refused.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass, replace

from pipeline.core.lens import ASPECT_TOLERANCE, fit_to_picture
from pipeline.core.records import Intrinsics, LensClaim

# Angle of view, in degrees: a pinhole image of a hemisphere has no size; the narrowest telescope lenses
# of cameras (1200 mm on a sensor of 1/3 inch) see a quarter of a degree, surveillance zooms one or more.
NARROWEST_DEG, WIDEST_DEG = 0.2, 175.0
# The principal point lies near the middle. The commonest mistake is of a factor of two (binning, half
# the size): it puts the point at a half or twice of its place, and half way to that, on a scale of
# factors, is the bound.
CENTRE_FACTOR = math.sqrt(2.0)
# Where nothing but the centre tells which pictures a matrix is for, it must be nearer to the middle than
# half way to that bound, with some room: KITTI's and Waymo's calibrations lie within a tenth.
SURE_FACTOR = 1.15
# Pictures are scaled by these when nobody says so.
_SCALES = (2.0, 4.0, 3.0, 1.5, 0.5, 0.25, 1 / 3, 2 / 3)
# Pixels are square, but for binning or subsampling of one direction (2:1) and old video (1.09, 1.46).
PIXEL_ASPECT = 2.2
SQUARE = 1.1
# A focal length of P that differs by less than this from K's makes no difference that is told apart.
SAME_FOCAL = 0.02
_RECTIFIED = re.compile(r"(^|[/_-])(rect|rectified|undistort|undistorted)($|[/_-])", re.IGNORECASE)
_RAW = re.compile(r"(^|[/_-])(raw|distorted)($|[/_-])", re.IGNORECASE)

_REFUSED = "{} is not used: {}; give fx_px, or focal length and pixel pitch, in a camera file"

Size = tuple[int, int]


@dataclass(frozen=True, slots=True)
class Found:
    """The lens of a picture by a calibration, and what is to be told of it."""

    lens: Intrinsics | None
    rectified: Intrinsics | None = None  # if the picture was rectified; None: that is not open
    code: str = ""
    sentence: str = ""


NO_LENS = Found(None)


class LensReadings:
    """Readings of a recording's calibrations, each found once for a size of pictures and a topic."""

    def __init__(self) -> None:
        self._last: dict[str, tuple[LensClaim, Size | None, Found]] = {}  # by topic

    def lens(self, claim: LensClaim, picture: Size | None, topic: str) -> Found:
        """Return the lens of a picture, as `lens_of_claim` does."""
        last = self._last.get(topic)
        if last is None or last[:2] != (claim, picture):
            last = self._last[topic] = claim, picture, lens_of_claim(claim, picture, topic)
        return last[2]


@dataclass(frozen=True, slots=True)
class _Matrix:
    """Focal lengths and centre in pixels, and the words for how they were read."""

    fx: float
    fy: float
    cx: float
    cy: float
    words: str = ""


@dataclass(frozen=True, slots=True)
class _Frame:
    """The pictures that a matrix is for by one reading, and the lens of the sent picture by it."""

    words: str  # empty for the definition
    size: Size  # of the pictures that the matrix is for
    lens: Intrinsics
    off_centre: float = SURE_FACTOR  # the centre may be so far off the middle
    rival: bool = False


@dataclass(frozen=True, slots=True)
class _Reading:
    lens: Intrinsics
    words: str
    off_centre: float  # the larger departure of the centre, as a factor of its place
    one_side: bool  # whether the centre is off along one side only: a picture that was cut
    rival: bool  # whether it may replace a definition that is possible: drivers do both


def lens_of_claim(claim: LensClaim, picture: Size | None, topic: str) -> Found:
    """Return the lens of a picture by a calibration.

    Args:
        claim: the calibration.
        picture: width and height of the picture; None if unknown, as its bytes were not decoded.
        topic: of the picture: its name says that it was rectified, or that it is raw.
    """
    by_p = _of_matrix(claim, _projection(claim), picture, "P")
    if _RECTIFIED.search(topic):
        return _rectified(claim, by_p, picture, topic)
    by_k = _of_matrix(claim, _variants(claim, picture), picture, "K")
    if by_k.lens is None:
        if by_p.lens is None or not claim.p:
            return by_k
        text = (
            f"{by_k.sentence}; P is taken, without distortion, which is right if the pictures were"
        )
        return Found(by_p.lens, None, "lens_reading", f"{text} rectified")
    lens = replace(by_k.lens, distortion_model=claim.distortion_model, distortion=claim.distortion)
    other = by_p.lens
    if other is None or _RAW.search(topic) or not _differ(lens, other):
        other = None
    return replace(by_k, lens=lens, rectified=other)


def _rectified(claim: LensClaim, by_p: Found, picture: Size | None, topic: str) -> Found:
    """Return the lens of a picture that was rectified: P, and no distortion."""
    if by_p.lens is not None:
        if by_p.code or not claim.distortion:
            return by_p
        text = f"{topic!r} holds rectified pictures: P is their lens, and there is no distortion"
        return replace(by_p, code="rectified_pictures", sentence=text)
    by_k = _of_matrix(claim, _variants(claim, picture), picture, "K")
    if by_k.lens is None or not any(claim.distortion):
        return by_k
    text = (
        f"{topic!r} holds rectified pictures, but the calibration has no P for them: K is taken "
        "without distortion; give fx_px in a camera file"
    )
    return replace(by_k, code="lens_reading", sentence=text)


def _of_matrix(
    claim: LensClaim, matrices: Iterator[_Matrix], picture: Size | None, name: str
) -> Found:
    """Return the lens by the first possible reading of a matrix; the first is the definition."""
    readings, problems, definition = list[_Reading](), list[str](), True
    for matrix in matrices:
        for frame in _frames(claim, matrix, picture):
            found = _examined(matrix, frame, picture)
            if isinstance(found, _Reading):
                readings.append(found)
            elif definition:
                problems.append(found)
            definition = False
    sure = [r for r in readings if not r.one_side]
    best = _best(sure) if sure else next(iter(r for r in readings if not r.words), None)
    if best is None:
        reason = problems[0] if problems else "it is no camera matrix"
        return Found(None, None, "impossible_lens", _REFUSED.format(name, reason))
    if best.words:
        reason = problems[0] if problems else "its centre fits that better"
        text = f"{name} is read as {best.words} (by the definition {reason}); give fx_px, fy_px, "
        text += "cx_px and cy_px in a camera file if that is wrong"
        return Found(best.lens, None, "lens_reading", text)
    return Found(best.lens, None, *_doubt(best, name))


def _best(readings: list[_Reading]) -> _Reading:
    """Return the first reading, unless the centre speaks clearly for a rival."""
    first = readings[0]
    best = min((r for r in readings if r.rival), key=lambda r: r.off_centre, default=first)
    return best if first.off_centre > SURE_FACTOR * best.off_centre else first


def _doubt(reading: _Reading, name: str) -> tuple[str, str]:
    lens = reading.lens
    if reading.one_side:
        text = (
            f"the centre ({lens.cx_px:.0f}, {lens.cy_px:.0f}) of {name} is far from the middle of the "
            f"picture of {lens.width_px} x {lens.height_px}: right if the picture was cut on one side"
        )
        return "doubtful_lens", text
    ratio = lens.fx_px / lens.fy_px
    if not 1 / SQUARE < ratio < SQUARE:
        text = (
            f"the focal lengths {lens.fx_px:.0f} and {lens.fy_px:.0f} px of {name} are those of pixels "
            f"{1 / ratio:.2f} times as wide as high: right if the picture was squeezed"
        )
        return "doubtful_lens", text
    return "", ""


def _variants(claim: LensClaim, picture: Size | None) -> Iterator[_Matrix]:
    """Yield what K can mean, the definition first."""
    if not claim.k:
        return
    k = claim.k
    yield _Matrix(k[0], k[4], k[2], k[5])
    if k[2] == 0 == k[5] and k[6] > 0 < k[7]:
        yield _Matrix(k[0], k[4], k[6], k[7], "transposed (columns and rows exchanged)")
    width, height = (claim.width_px, claim.height_px) if claim.width_px else picture or (0, 0)
    if 0 < k[2] < 1 and 0 < k[5] < 1 and width > 0 < height:
        for unit, words in ((height, "width and height"), (width, "width")):
            words = f"shares of the picture's {words}"
            yield _Matrix(k[0] * width, k[4] * unit, k[2] * width - 0.5, k[5] * unit - 0.5, words)
    if width != height:
        words = "with x and y exchanged (of the picture before it was turned)"
        yield _Matrix(k[4], k[0], k[5], k[2], words)


def _projection(claim: LensClaim) -> Iterator[_Matrix]:
    if claim.p:
        p = claim.p
        yield _Matrix(p[0], p[5], p[2], p[6])


def _frames(claim: LensClaim, k: _Matrix, picture: Size | None) -> Iterator[_Frame]:
    """Yield readings of the pictures that a matrix is for, the definition first."""
    full, binning = (claim.width_px, claim.height_px), claim.binning
    if min(full) <= 0:  # no size is stated: it is for the picture as it is
        size = picture or (0, 0)
        yield _Frame("", size, _lens(k, size), CENTRE_FACTOR)
        yield from _scaled(k, size)
        return
    left, top, wide, high = claim.region
    region = wide or full[0], high or full[1]
    has_region = (left, top, *region) != (0, 0, *full)
    sent = max(region[0] // binning[0], 1), max(region[1] // binning[1], 1)
    yield _Frame("", full, _cut(k, (left, top), binning, sent), CENTRE_FACTOR)
    if binning != (1, 1):
        size = full[0] // binning[0], full[1] // binning[1]
        lens = _cut(k, (left / binning[0], top / binning[1]), (1, 1), sent)
        yield _Frame("that of the binned pictures already", size, lens, rival=True)
    if has_region:
        lens = _cut(k, (0, 0), binning, sent)
        yield _Frame("that of the region of interest already", region, lens, rival=True)
    if has_region and binning != (1, 1):
        yield _Frame("that of the pictures as they are sent", sent, _lens(k, sent), rival=True)
    if picture is not None and picture not in (full, sent):
        words = "that of the pictures as they are, not of the size that is stated"
        yield _Frame(words, picture, _lens(k, picture))
    yield from _scaled(k, picture or sent)


def _scaled(k: _Matrix, size: Size) -> Iterator[_Frame]:
    """Yield readings for pictures of another size, where the centre is surely in their middle."""
    for scale in _SCALES:
        other = round(size[0] * scale), round(size[1] * scale)
        lens = fit_to_picture(_lens(k, other), *size) if min(other) > 0 else None
        if lens is not None:
            yield _Frame(f"that of pictures of {other[0]} x {other[1]}", other, lens)


def _lens(k: _Matrix, size: Size) -> Intrinsics:
    return Intrinsics(*size, k.fx, k.fy, k.cx, k.cy)


def _cut(k: _Matrix, offset: tuple[float, float], binning: Size, size: Size) -> Intrinsics:
    """Return the lens of a region of the pictures that a matrix is for, binned."""
    return Intrinsics(
        *size,
        k.fx / binning[0],
        k.fy / binning[1],
        # the centre of the first pixel is (0, 0): the corner at -0.5 is what stays in place
        (k.cx - offset[0] + 0.5) / binning[0] - 0.5,
        (k.cy - offset[1] + 0.5) / binning[1] - 0.5,
    )


def _factor(centre_px: float, side_px: int) -> float:
    """Return how far a centre is from the middle of a side, as a factor of at least 1."""
    share = (centre_px + 0.5) / (side_px / 2)
    return max(share, 1 / share) if share > 0 else math.inf


def _examined(k: _Matrix, frame: _Frame, picture: Size | None) -> _Reading | str:
    """Return a reading that a lens can have, or why it can have none.

    Args:
        k: the matrix.
        frame: the pictures that it is for.
        picture: size of the picture, None if unknown.
    """
    lens = frame.lens
    size = lens.width_px, lens.height_px
    words = ", ".join(w for w in (k.words, frame.words) if w)
    if not (lens.fx_px > 0 < lens.fy_px):
        return f"focal lengths of {lens.fx_px:g} and {lens.fy_px:g} px are impossible"
    if min(size) <= 0:
        return _Reading(lens, words, 1.0, one_side=False, rival=False)
    problem = _wrong_shape(size, picture) or _wrong_angle(lens) or _wrong_aspect(lens)
    if problem:
        return problem
    off = [_factor(c, side) for c, side in zip((k.cx, k.cy), frame.size, strict=True)]
    outside = [factor > frame.off_centre for factor in off]
    inside_picture = 0 <= k.cx < frame.size[0] and 0 <= k.cy < frame.size[1]
    cut = any(outside) and not words and inside_picture
    if all(outside) or (any(outside) and not cut):
        return (
            f"a centre at ({k.cx:.0f}, {k.cy:.0f}) in a picture of {frame.size[0]} x "
            f"{frame.size[1]} is far from its middle"
        )
    return _Reading(lens, words, max(off), one_side=cut, rival=frame.rival)


def _wrong_shape(size: Size, picture: Size | None) -> str:
    """Return a sentence if a picture is not of a size, nor that size scaled up to rounding."""
    if (
        picture is None
        or abs((size[0] / picture[0]) / (size[1] / picture[1]) - 1) <= ASPECT_TOLERANCE
    ):
        return ""
    return (
        f"the calibration is for {size[0]}x{size[1]}, the pictures are {picture[0]}x{picture[1]}, "
        "another shape"
    )


def _wrong_angle(lens: Intrinsics) -> str:
    for focal_px, side_px in ((lens.fx_px, lens.width_px), (lens.fy_px, lens.height_px)):
        angle_deg = 2 * math.degrees(math.atan(side_px / (2 * focal_px)))
        if not NARROWEST_DEG <= angle_deg <= WIDEST_DEG:
            return (
                f"a focal length of {focal_px:g} px in a picture of {lens.width_px} x "
                f"{lens.height_px} is an angle of view of {angle_deg:.2f} degrees"
            )
    return ""


def _wrong_aspect(lens: Intrinsics) -> str:
    ratio, shape = lens.fx_px / lens.fy_px, lens.width_px / lens.height_px
    square_field = abs(ratio / shape - 1) < ASPECT_TOLERANCE and not 1 / SQUARE < shape < SQUARE
    if 1 / PIXEL_ASPECT < ratio < PIXEL_ASPECT and not square_field:
        return ""
    return (
        f"focal lengths of {lens.fx_px:g} and {lens.fy_px:g} px are no lens of a picture of "
        f"{lens.width_px} x {lens.height_px}"
    )


def _differ(lens: Intrinsics, other: Intrinsics) -> bool:
    """Return whether it matters which of two lenses holds."""
    return bool(lens.distortion) or abs(other.fx_px / lens.fx_px - 1) > SAME_FOCAL
