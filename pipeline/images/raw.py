"""Pictures that were stored as bare pixels become BGR, reduced on the way where that is asked.

The encodings are those of ROS' `sensor_msgs/image_encodings` and of foxglove.RawImage. A recording
states width, height and the length of a row; all are held against the bytes that are there before
a pixel is touched.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import cv2
import numpy as np
import numpy.typing as npt

from pipeline.core.errors import UndecodableImage
from pipeline.core.records import Frame, RawLayout

Image = npt.NDArray[np.uint8]

# A picture that is kept as a JPEG for a while (frames that wait, a timeline): at this quality what is
# lost lies below the noise of the sensor.
KEPT_QUALITY = 95


@dataclass(frozen=True, slots=True)
class _Packed:
    """Interleaved samples: one row is `width * channels` of them."""

    channels: int
    to_bgr: int | None  # OpenCV's conversion; None: it is BGR
    sample_bytes: int = 1


@dataclass(frozen=True, slots=True)
class _Bayer:
    """One sample a pixel behind a mosaic of filters, named by its first two rows."""

    pattern: str
    sample_bytes: int = 1


@dataclass(frozen=True, slots=True)
class _Yuv:
    """Luminance and colour apart, 8 bits, BT.601; `rows` of `row_bytes` bytes."""

    to_bgr: int
    rows: Callable[[int], int]
    row_bytes: Callable[[int], int]


def _same(length: int) -> int:
    return length


def _three_halves(length: int) -> int:
    return length * 3 // 2


def _double(length: int) -> int:
    return length * 2


_GENICAM = {"rg": "rggb", "bg": "bggr", "gb": "gbrg", "gr": "grbg"}
_BGR = _Packed(3, None)
_GREY = _Packed(1, cv2.COLOR_GRAY2BGR)
_GREY_16 = _Packed(1, cv2.COLOR_GRAY2BGR, 2)
_UYVY = _Yuv(cv2.COLOR_YUV2BGR_UYVY, _same, _double)
_YUYV = _Yuv(cv2.COLOR_YUV2BGR_YUY2, _same, _double)
_FORMATS: dict[str, _Packed | _Bayer | _Yuv] = {
    "mono8": _GREY,
    "8uc1": _GREY,
    "mono16": _GREY_16,
    "bgr8": _BGR,
    "8uc3": _BGR,
    "rgb8": _Packed(3, cv2.COLOR_RGB2BGR),
    "bgra8": _Packed(4, cv2.COLOR_BGRA2BGR),
    "8uc4": _Packed(4, cv2.COLOR_BGRA2BGR),
    "rgba8": _Packed(4, cv2.COLOR_RGBA2BGR),
    "bgr16": _Packed(3, None, 2),
    "rgb16": _Packed(3, cv2.COLOR_RGB2BGR, 2),
    "bgra16": _Packed(4, cv2.COLOR_BGRA2BGR, 2),
    "rgba16": _Packed(4, cv2.COLOR_RGBA2BGR, 2),
    **{f"bayer_{p}8": _Bayer(p) for p in ("rggb", "bggr", "gbrg", "grbg")},
    **{f"bayer_{p}16": _Bayer(p, 2) for p in ("rggb", "bggr", "gbrg", "grbg")},
    # GenICam's names (Pixel Format Naming Convention 2.4): two filters of the first row; a sample of 10,
    # 12 or 14 bits lies in 16, unless the name ends in p or Packed.
    **{f"bayer{two}8": _Bayer(p) for two, p in _GENICAM.items()},
    **{f"bayer{two}{n}": _Bayer(p, 2) for two, p in _GENICAM.items() for n in (10, 12, 14, 16)},
    "rgb8packed": _Packed(3, cv2.COLOR_RGB2BGR),
    "bgr8packed": _BGR,
    "yuv422packed": _UYVY,
    "yuv422_8_uyvy": _UYVY,
    "yuv422_8": _YUYV,
    "yuv422": _UYVY,  # ROS' name for UYVY
    "uyvy": _UYVY,
    "yuv422_yuy2": _YUYV,
    "yuyv": _YUYV,
    "nv12": _Yuv(cv2.COLOR_YUV2BGR_NV12, _three_halves, _same),
    "nv21": _Yuv(cv2.COLOR_YUV2BGR_NV21, _three_halves, _same),
    "i420": _Yuv(cv2.COLOR_YUV2BGR_I420, _three_halves, _same),
}
_READ = (
    "mono8, mono16, rgb8, bgr8, rgba8, bgra8, rgb16, bgr16, rgba16, bgra16, bayer_rggb8 and so on, "
    "BayerRG8 and so on, uyvy, yuyv, nv12, nv21, i420"
)
# What such a stream holds is distances, not light.
DEPTH_ENCODINGS = frozenset({"16uc1", "32fc1", "64fc1"})
_DEMOSAIC = {
    "rggb": cv2.COLOR_BayerRGGB2BGR,
    "bggr": cv2.COLOR_BayerBGGR2BGR,
    "gbrg": cv2.COLOR_BayerGBRG2BGR,
    "grbg": cv2.COLOR_BayerGRBG2BGR,
}


def has_wide_samples(encoding: str) -> bool:
    """Return whether a sample is 16 bits, of which a camera may use fewer."""
    found = _FORMATS.get(encoding.lower())
    return isinstance(found, _Packed | _Bayer) and found.sample_bytes == 2


def samples(image: bytes, layout: RawLayout) -> npt.NDArray[np.uint16]:
    """Return the samples of a picture with 16 bits each, as they are stored, without padding.

    Raises:
        UndecodableImage: the layout does not fit the bytes.
    """
    found = _format_of(layout)
    if isinstance(found, _Yuv) or found.sample_bytes != 2:
        raise UndecodableImage(f"encoding {layout.encoding!r} has samples of 8 bits")
    channels = found.channels if isinstance(found, _Packed) else 1
    return _view(image, layout, channels, 2).astype(np.uint16, copy=False)


def check_encoding(layout: RawLayout) -> None:
    """Raise UndecodableImage for an encoding that is not read, and name those that are."""
    _format_of(layout)


def decode_raw(image: bytes, layout: RawLayout, reduction: int = 1) -> Image:
    """Return a picture as BGR, (height // reduction, width // reduction, 3).

    Raises:
        UndecodableImage: the encoding is unknown, or the layout does not fit the bytes.
    """
    found = _format_of(layout)
    if isinstance(found, _Packed):
        return _packed(image, layout, found, reduction)
    if isinstance(found, _Bayer):
        return _bayer(image, layout, found, reduction)
    return _yuv(image, layout, found, reduction)


def as_jpeg(image: bytes, layout: RawLayout) -> bytes:
    """Return a picture of bare pixels as a JPEG.

    Raises:
        UndecodableImage: as `decode_raw`.
    """
    options = [cv2.IMWRITE_JPEG_QUALITY, KEPT_QUALITY]
    ok, encoded = cv2.imencode(".jpg", decode_raw(image, layout), options)
    if not ok:
        raise UndecodableImage("the picture cannot be encoded as JPEG")
    return bytes(encoded.tobytes())


def compressed(frame: Frame) -> Frame:
    """Return a frame whose picture takes little room: bare pixels become a JPEG.

    Bare pixels that do not fit their layout stay as they are: they are reported when they are decoded.
    """
    if frame.layout is None:
        return frame
    try:
        image = as_jpeg(frame.image, frame.layout)
    except UndecodableImage:
        return frame
    return replace(frame, image=image, layout=None)


def _format_of(layout: RawLayout) -> _Packed | _Bayer | _Yuv:
    found = _FORMATS.get(layout.encoding.lower())
    if found is None:
        raise UndecodableImage(
            f"encoding {layout.encoding!r} is not read (read are {_READ}); record "
            "the camera in one of these, or as JPEG or PNG"
        )
    if layout.width_px < 1 or layout.height_px < 1:
        raise UndecodableImage(f"{layout.width_px} x {layout.height_px} pixels")
    return found


def _packed(image: bytes, layout: RawLayout, form: _Packed, reduction: int) -> Image:
    pixels = _eight_bits(_view(image, layout, form.channels, form.sample_bytes), layout)
    small = _reduced(pixels, reduction)
    if form.to_bgr is None:
        return np.ascontiguousarray(small)
    return np.asarray(cv2.cvtColor(small, form.to_bgr), dtype=np.uint8)


def _bayer(image: bytes, layout: RawLayout, form: _Bayer, reduction: int) -> Image:
    mosaic = _eight_bits(_view(image, layout, 1, form.sample_bytes), layout)[..., 0]
    if reduction % 2 or min(mosaic.shape) < 2:
        whole = cv2.cvtColor(np.ascontiguousarray(mosaic), _DEMOSAIC[form.pattern])
        return _reduced(np.asarray(whole, dtype=np.uint8), reduction)
    # Four neighbours make one pixel of the picture at half its size: nothing to interpolate.
    height, width = mosaic.shape[0] // 2 * 2, mosaic.shape[1] // 2 * 2
    cells = {
        (row, column): mosaic[row:height:2, column:width:2] for row in (0, 1) for column in (0, 1)
    }
    planes: dict[str, list[Image]] = {"r": [], "g": [], "b": []}
    for (row, column), plane in cells.items():
        planes[form.pattern[2 * row + column]].append(plane)
    green = cv2.addWeighted(planes["g"][0], 0.5, planes["g"][1], 0.5, 0)
    half = cv2.merge([planes["b"][0], green, planes["r"][0]])
    return _reduced(np.asarray(half, dtype=np.uint8), reduction // 2)


def _yuv(image: bytes, layout: RawLayout, form: _Yuv, reduction: int) -> Image:
    width, height = layout.width_px, layout.height_px
    if width % 2 or (form.rows is _three_halves and height % 2):
        raise UndecodableImage(f"{layout.encoding} of an odd size, {width} x {height}")
    row_bytes = form.row_bytes(width)
    step = layout.step_bytes or row_bytes
    plane = _rows(image, form.rows(height), row_bytes, step)
    if form.row_bytes is _double:
        plane = plane.reshape(height, width, 2)
    whole = cv2.cvtColor(np.ascontiguousarray(plane), form.to_bgr)
    return _reduced(np.asarray(whole, dtype=np.uint8), reduction)


def _view(
    image: bytes, layout: RawLayout, channels: int, sample_bytes: int
) -> npt.NDArray[np.uint8 | np.uint16]:
    """Return the samples, (height, width, channels), as a view of the bytes."""
    row_bytes = layout.width_px * channels * sample_bytes
    rows = _rows(image, layout.height_px, row_bytes, layout.step_bytes or row_bytes)
    if sample_bytes == 1:
        return rows.reshape(layout.height_px, layout.width_px, channels)
    wide = np.ascontiguousarray(rows).view(">u2" if layout.big_endian else "<u2")
    return wide.reshape(layout.height_px, layout.width_px, channels)


def _rows(image: bytes, count: int, row_bytes: int, step: int) -> Image:
    """Return `count` rows without the padding at their ends."""
    if step < row_bytes or step * (count - 1) + row_bytes > len(image):
        raise UndecodableImage(
            f"{len(image):,} bytes cannot hold {count} rows of {row_bytes:,} bytes, {step:,} apart"
        )
    return np.ndarray((count, row_bytes), np.uint8, buffer=image, strides=(step, 1))


def _eight_bits(pixels: npt.NDArray[np.uint8 | np.uint16], layout: RawLayout) -> Image:
    if pixels.dtype == np.uint8:
        return pixels.astype(np.uint8, copy=False)
    shift = max(layout.bits - 8, 0)
    return np.minimum(pixels >> np.uint16(shift), 255).astype(np.uint8)


def _reduced(pixels: Image, reduction: int) -> Image:
    """Average blocks of `reduction` pixels; what does not fill a block at the far edges is cut."""
    if reduction == 1:
        return pixels
    height, width = pixels.shape[0] // reduction, pixels.shape[1] // reduction
    if min(height, width) < 1:
        raise UndecodableImage(f"{pixels.shape[1]} x {pixels.shape[0]} pixels cannot be reduced")
    whole = pixels[: height * reduction, : width * reduction]
    small = cv2.resize(whole, (width, height), interpolation=cv2.INTER_AREA)
    return np.asarray(small, dtype=np.uint8).reshape(height, width, *pixels.shape[2:])
