"""Header of a JPEG, PNG or WebP: its size, and the cost of decoding it.

The size is read before any memory is taken for the picture.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator

_PNG = b"\x89PNG\r\n\x1a\n"
_SCAN = 0xDA


def image_size(image: bytes) -> tuple[int, int] | None:
    """Return width and height as the header states them, without decoding.

    None for no picture, and for one without any pixels: a JPEG may leave its height to a segment behind
    the scan (ITU-T T.81, B.2.5), which OpenCV does not read.
    """
    size = None
    if image[:8] == _PNG and len(image) >= 24:
        size = struct.unpack(">II", image[16:24])
    elif image[:2] == b"\xff\xd8":
        size = _jpeg_size(image)
    elif image[:4] == b"RIFF" and image[8:12] == b"WEBP":
        size = _webp_size(image)
    return size if size and min(size) > 0 else None


def hidden_cost(image: bytes, max_scans: int) -> str | None:
    """Return why a picture would cost far more to decode than its size says; None if it does not.

    A JPEG may be sent in any number of scans of a few bytes, each a pass over the whole picture; an
    animation needs the memory of several pictures.
    """
    if image[:2] == b"\xff\xd8":
        scans = _jpeg_scans(image)
        return f"{scans:,} scans, the limit is {max_scans:,}" if scans > max_scans else None
    if image[:8] == _PNG:
        return _png_cost(image)
    if image[12:16] == b"VP8X" and len(image) > 20 and image[20] & 0x02:
        return "an animated WebP is no picture of a camera"
    return None


def _png_cost(image: bytes) -> str | None:
    """Walk the chunks; OpenCV takes memory for what one claims, be it there or not."""
    at = len(_PNG)
    while at + 8 <= len(image):
        length, kind = struct.unpack_from(">I4s", image, at)
        left = len(image) - at - 8
        if length > left:
            return f"a chunk claims {length:,} bytes, {left:,} are left"
        if kind == b"acTL":
            return "an animated PNG is no picture of a camera"
        at += 12 + length
    return None


def _jpeg_scans(image: bytes) -> int:
    """Return how many scans follow; an upper bound where there are several."""
    components, sequential = 0, False
    for marker, at in _jpeg_segments(image):
        if _is_frame(marker):
            components, sequential = image[at + 9] if at + 9 < len(image) else 0, marker <= 0xC1
        elif marker == _SCAN:
            if sequential and image[at + 4] == components:
                return 1  # all is in it; what follows is not decoded
            break
    # In the data of a scan 0xFF is followed by 0; a thumbnail in the EXIF may add a few.
    return image.count(b"\xff\xda")


def _jpeg_size(image: bytes) -> tuple[int, int] | None:
    for marker, at in _jpeg_segments(image):
        if _is_frame(marker):
            height_px, width_px = struct.unpack(">HH", image[at + 5 : at + 9])
            return width_px, height_px
    return None


def _is_frame(marker: int) -> bool:
    return 0xC0 <= marker <= 0xCF and marker not in (0xC4, 0xC8, 0xCC)


def _jpeg_segments(image: bytes) -> Iterator[tuple[int, int]]:
    """Yield marker and place of the segments up to the first scan (ITU-T T.81, B.2)."""
    at = 2
    while at + 9 <= len(image):
        if (
            image[at] != 0xFF or image[at + 1] == 0
        ):  # stray bytes: decoders go on at the next marker
            at = image.find(b"\xff", at + 1)
            if at < 0:
                return
            continue
        marker = image[at + 1]
        if marker == 0xFF:  # fill byte
            at += 1
        elif 0xD0 <= marker <= 0xD8 or marker == 0x01:  # no length
            at += 2
        else:
            yield marker, at
            if marker == _SCAN:
                return
            at += 2 + int.from_bytes(image[at + 2 : at + 4], "big")


def _webp_size(image: bytes) -> tuple[int, int] | None:
    """Read the first chunk's header (RFC 9649)."""
    kind = image[12:16]
    if kind == b"VP8X" and len(image) >= 30:
        width = int.from_bytes(image[24:27], "little") + 1
        return width, int.from_bytes(image[27:30], "little") + 1
    if kind == b"VP8 " and len(image) >= 30:
        width, height = struct.unpack("<HH", image[26:30])
        return width & 0x3FFF, height & 0x3FFF
    if kind == b"VP8L" and len(image) >= 25:
        bits = int.from_bytes(image[21:25], "little")
        return (bits & 0x3FFF) + 1, (bits >> 14 & 0x3FFF) + 1
    return None
