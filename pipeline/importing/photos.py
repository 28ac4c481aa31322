"""Recording made of folders of photos: pictures as they are, their EXIF as exposure messages.

A photo keeps its bytes, unless its EXIF says that it has to be turned: then it is turned, and encoded
anew. Cameras are told apart by make and model, or are one under a given name.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta, timezone
from pathlib import Path

import cv2
import numpy as np

from pipeline.core.config import CameraConfig, Config
from pipeline.core.errors import StadimeterError, UsageError, Where
from pipeline.core.exposure import Exposure
from pipeline.core.lens import intrinsics_of, lens_of
from pipeline.images.exif import Tags, exif_block, exposure_of, read_tags
from pipeline.images.header import image_size
from pipeline.images.raw import KEPT_QUALITY
from pipeline.mcap_file.writer import (
    RecordingWriter,
    calibration_message,
    image_message,
)
from pipeline.messages.exposure import exposure_message

SUFFIXES = frozenset({".jpg", ".jpeg", ".png", ".webp"})
UPRIGHT = 1.0  # EXIF Orientation
# Photos of one camera in the same second, whose EXIF has no fraction, follow each other by this.
_BURST_NS = 1_000_000
_OFFSET = re.compile(r"^([+-])(\d{2}):?(\d{2})$")


@dataclass(frozen=True, slots=True)
class PhotoImport:
    """Options of an import of photos; times without an offset are in `zone`."""

    camera: str | None = None  # None: by make and model
    zone: timezone = UTC


@dataclass(frozen=True, slots=True)
class Photo:
    """One photo, ready to be written."""

    path: Path
    camera: str
    time_ns: int
    time_source: str  # "EXIF", "EXIF, zone assumed" or "file"
    width_px: int
    height_px: int
    orientation: float
    exposure: Exposure
    refused: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Imported:
    """Number of photos by camera, and remarks on some."""

    counts: dict[str, int]
    remarks: list[str]


def photo_files(sources: Sequence[Path]) -> list[Path]:
    """Return the photos among files and in folders, at any depth."""
    found: set[Path] = set()
    for source in sources:
        inside = source.rglob("*") if source.is_dir() else [source]
        found |= {p for p in inside if p.suffix.lower() in SUFFIXES and p.is_file()}
    return sorted(found)


def are_photos(sources: Sequence[Path]) -> bool:
    """Return whether what is to be imported are photos, or a video."""
    return all(s.is_dir() or s.suffix.lower() in SUFFIXES for s in sources)


def import_photos(
    sources: Sequence[Path],
    recording: Path,
    options: PhotoImport,
    config: Config,
    progress: Callable[[int], None] = lambda photos: None,
) -> Imported:
    """Write a recording of photos in the order of their time.

    Raises:
        StadimeterError: there is no photo that can be read.
    """
    remarks: list[str] = []
    photos = list(_surveyed(photo_files(sources), options, config, remarks))
    if not photos:
        raise StadimeterError(
            "there are no photos that can be read",
            where=Where(sources[0]),
            remedy=f"Photos end in {', '.join(sorted(SUFFIXES))}",
        )
    counts: dict[str, int] = {}
    with RecordingWriter(recording) as writer:
        for number, photo in enumerate(_in_order(photos), start=1):
            _write(writer, photo, config.camera_named(photo.camera))
            counts[photo.camera] = counts.get(photo.camera, 0) + 1
            progress(number)
        names = ", ".join(sorted({p.path.parent.name for p in photos}))
        writer.add_metadata("stadimeter.import", {"source": names, "photos": str(len(photos))})
    return Imported(counts, [*remarks, *_remarks(photos)])


def _surveyed(
    paths: Iterable[Path], options: PhotoImport, config: Config, remarks: list[str]
) -> Iterator[Photo]:
    limit = config.limits.image_pixels
    for path in paths:
        image = path.read_bytes()
        size = image_size(image)
        if size is None or size[0] * size[1] > limit:
            what = "no JPEG, PNG or WebP picture" if size is None else f"more than {limit:,} pixels"
            remarks.append(f"{path.name} was left out: {what}")
            continue
        yield _photo(path, image, size, options)


def _photo(path: Path, image: bytes, size: tuple[int, int], options: PhotoImport) -> Photo:
    tags = read_tags(exif_block(image) or b"")
    orientation = tags.get("orientation", UPRIGHT)
    turned = isinstance(orientation, float) and 5 <= orientation <= 8  # by a quarter
    width_px, height_px = size[::-1] if turned else size
    exposure, refused = exposure_of(tags, width_px, height_px)
    time_ns, time_source = _time(path, tags, options.zone)
    return Photo(
        path,
        options.camera or _camera_name(tags),
        time_ns,
        time_source,
        width_px,
        height_px,
        orientation if isinstance(orientation, float) else UPRIGHT,
        exposure,
        tuple(refused),
    )


def _camera_name(tags: Tags) -> str:
    make, model = str(tags.get("make", "")).strip(), str(tags.get("model", "")).strip()
    named = model if model.lower().startswith(make.lower()) else f"{make} {model}"
    return re.sub(r"\W+", "_", named.lower()).strip("_") or "camera"


def _time(path: Path, tags: Tags, zone: timezone) -> tuple[int, str]:
    """Return when a photo was taken: by its EXIF, else when its file was last written."""
    stated = str(tags.get("date_time_original", tags.get("date_time", "")))
    try:
        taken = datetime.strptime(stated, "%Y:%m:%d %H:%M:%S")
    except ValueError:
        return path.stat().st_mtime_ns, "file"
    offset = _OFFSET.match(str(tags.get("offset_time_original", tags.get("offset_time", ""))))
    if offset:
        away = timedelta(hours=int(offset[2]), minutes=int(offset[3]))
        zone = timezone(-away if offset[1] == "-" else away)
    digits = re.sub(r"\D", "", str(tags.get("subsec_time_original", "")))[:9]
    seconds = int(taken.replace(tzinfo=zone).timestamp())
    time_ns = seconds * 1_000_000_000 + (int(digits.ljust(9, "0")) if digits else 0)
    if time_ns <= 0:
        return path.stat().st_mtime_ns, "file"
    return time_ns, "EXIF" if offset else "EXIF, zone assumed"


def _in_order(photos: list[Photo]) -> Iterator[Photo]:
    """Yield photos by time; of one camera no two have the same."""
    newest: dict[str, int] = {}
    for photo in sorted(photos, key=lambda p: (p.time_ns, p.path)):
        time_ns = max(photo.time_ns, newest.get(photo.camera, 0) + _BURST_NS)
        newest[photo.camera] = time_ns
        yield replace(photo, time_ns=time_ns)


def _write(writer: RecordingWriter, photo: Photo, camera: CameraConfig) -> None:
    image, kind = photo.path.read_bytes(), photo.path.suffix.lower().lstrip(".")
    if photo.orientation != UPRIGHT:
        image, kind = _turned(image, photo), "jpeg"
    kind = "jpeg" if kind == "jpg" else kind
    prefix = f"/{photo.camera}"
    message = image_message(image, kind, photo.time_ns, photo.camera)
    writer.write(f"{prefix}/image", message, photo.time_ns)
    size = photo.width_px, photo.height_px
    lens = lens_of(photo.exposure, camera, None, *size)
    intrinsics, source, _ = intrinsics_of(None, camera, lens, *size)
    if intrinsics is not None and source == "camera_file":
        calibration = calibration_message(intrinsics, photo.time_ns, photo.camera)
        writer.write(f"{prefix}/calibration", calibration, photo.time_ns)
    exposure = exposure_message(photo.exposure, photo.time_ns, photo.camera)
    writer.write(f"{prefix}/exposure", exposure, photo.time_ns)


def _turned(image: bytes, photo: Photo) -> bytes:
    """Return a photo upright: OpenCV turns it by its EXIF."""
    pixels = cv2.imdecode(np.frombuffer(image, np.uint8), cv2.IMREAD_COLOR)
    if pixels is None or pixels.shape[1::-1] != (photo.width_px, photo.height_px):
        raise StadimeterError("the photo cannot be decoded", where=Where(photo.path))
    ok, encoded = cv2.imencode(".jpg", pixels, [cv2.IMWRITE_JPEG_QUALITY, KEPT_QUALITY])
    if not ok:
        raise StadimeterError("the photo cannot be encoded", where=Where(photo.path))
    return bytes(encoded.tobytes())


def _remarks(photos: list[Photo]) -> list[str]:
    """Return a sentence for each assumption about photos, and for each refused value."""
    remarks = [f"{p.path.name}: {sentence}" for p in photos for sentence in p.refused]
    assumed = sum(p.time_source == "EXIF, zone assumed" for p in photos)
    if assumed:
        remarks.append(f"{assumed} photos state no time zone: the given one (or UTC) was assumed")
    by_file = sum(p.time_source == "file" for p in photos)
    if by_file:
        remarks.append(f"{by_file} photos state no time: that of the file was taken")
    turned = sum(p.orientation != UPRIGHT for p in photos)
    if turned:
        remarks.append(f"{turned} photos were turned by their EXIF, and encoded anew")
    bare = sum(math.isnan(p.exposure.f_number) for p in photos)
    if bare:
        remarks.append(f"{bare} photos state no f-number")
    return remarks


def zone_of(text: str) -> timezone:
    """Return a time zone given as an offset.

    Raises:
        UsageError: it is none.
    """
    found = _OFFSET.match(text)
    if found is None:
        raise UsageError(f"--utc-offset {text!r} is no offset, such as +02:00")
    away = timedelta(hours=int(found[2]), minutes=int(found[3]))
    if away >= timedelta(hours=24):
        raise UsageError(f"--utc-offset {text!r} is a day or more")
    return timezone(-away if found[1] == "-" else away)
