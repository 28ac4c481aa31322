"""Recording made of a video file: pictures as JPEG, with the known lens data."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt

from pipeline.core.config import CameraConfig
from pipeline.core.errors import StadimeterError, UsageError, Where
from pipeline.core.exposure import FIELDS, UNKNOWN_EXPOSURE, Exposure
from pipeline.core.lens import fit_to_picture, intrinsics_of, lens_of
from pipeline.mcap_file.writer import (
    RecordingWriter,
    calibration_message,
    image_message,
)
from pipeline.messages.exposure import exposure_message

Image = npt.NDArray[np.uint8]
# Where a container states no sensible frame rate, time cannot be known; the user must say.
FRAME_RATES = (0.01, 1000.0)


class UnreadableVideo(StadimeterError):
    """OpenCV cannot open the file, or finds no picture in it."""


@dataclass(frozen=True, slots=True)
class VideoImport:
    """Part of a video to take, and how to store it.

    `start_time_ns` is when its first frame was taken. `scale` shrinks the pictures. `from_s` and
    `duration_s` cut an excerpt; the times of its frames stay those of the whole video.
    """

    start_time_ns: int
    camera: str
    frame_rate: float | None = None
    from_s: float = 0.0
    duration_s: float = math.inf
    scale: float = 1.0
    jpeg_quality: int = 90


def import_video(
    video: Path,
    recording: Path,
    options: VideoImport,
    camera: CameraConfig,
    progress: Callable[[int], None] = lambda frames: None,
) -> int:
    """Write a recording of a video; return the number of frames.

    Raises:
        UnreadableVideo: OpenCV cannot read it, or it holds no frame in the asked time.
        UsageError: the frame rate is neither in the file nor given.
    """
    with _capture(video) as capture:
        rate = options.frame_rate or capture.get(cv2.CAP_PROP_FPS)
        if not FRAME_RATES[0] <= rate <= FRAME_RATES[1]:
            raise UsageError(
                f"the video states no usable frame rate ({rate:g})",
                where=Where(video),
                remedy="Give it with --frame-rate",
            )
        first, count = round(options.from_s * rate), 0
        with RecordingWriter(recording) as writer:
            for index, image in enumerate(_images(capture)):
                if index < first:
                    continue
                if (index - first) / rate >= options.duration_s:
                    break
                time_ns = options.start_time_ns + round(index / rate * 1e9)
                _write_frame(writer, image, time_ns, options, camera)
                count += 1
                progress(count)
            if count == 0:
                raise UnreadableVideo(
                    "no frame could be read in the requested time",
                    where=Where(video),
                    remedy="Check --from and --duration, or convert the video",
                )
            writer.add_metadata("stadimeter.import", _provenance(video, rate, options))
    return count


@contextmanager
def _capture(video: Path) -> Iterator[cv2.VideoCapture]:
    if not video.is_file():
        raise UnreadableVideo("there is no such file", where=Where(video))
    capture = cv2.VideoCapture(str(video), cv2.CAP_FFMPEG)
    try:
        if not capture.isOpened():
            raise UnreadableVideo(
                "not a video that OpenCV can read", where=Where(video), remedy="Convert it first"
            )
        yield capture
    finally:
        capture.release()


def _images(capture: cv2.VideoCapture) -> Iterator[Image]:
    while True:
        ok, image = capture.read()
        if not ok:
            return
        yield image


def _scaled(image: Image, scale: float) -> Image:
    if scale == 1.0:
        return image
    return cv2.resize(image, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)


def _write_frame(
    writer: RecordingWriter, image: Image, time_ns: int, options: VideoImport, camera: CameraConfig
) -> None:
    name, prefix = options.camera, f"/{options.camera}"
    height_px, width_px = image.shape[:2]
    stored = _scaled(image, options.scale)
    ok, encoded = cv2.imencode(".jpg", stored, [cv2.IMWRITE_JPEG_QUALITY, options.jpeg_quality])
    if not ok:
        raise UnreadableVideo("a frame could not be encoded as JPEG")
    writer.write(
        f"{prefix}/image", image_message(encoded.tobytes(), "jpeg", time_ns, name), time_ns
    )
    lens = lens_of(UNKNOWN_EXPOSURE, camera, None, width_px, height_px)
    intrinsics, _, _ = intrinsics_of(None, camera, lens, width_px, height_px)
    if intrinsics is not None:
        scaled = fit_to_picture(intrinsics, stored.shape[1], stored.shape[0]) or intrinsics
        writer.write(f"{prefix}/calibration", calibration_message(scaled, time_ns, name), time_ns)
    stated = Exposure(**{row: getattr(lens, row) for row in FIELDS if hasattr(lens, row)})
    if any(not math.isnan(getattr(stated, row)) for row in FIELDS):
        size = {"sensor_width_px": float(width_px), "sensor_height_px": float(height_px)}
        message = exposure_message(replace(stated, **size), time_ns, name)
        writer.write(f"{prefix}/exposure", message, time_ns)


def _provenance(video: Path, rate: float, options: VideoImport) -> dict[str, str]:
    return {
        "source": video.name,
        "frame_rate": f"{rate:g}",
        "from_s": f"{options.from_s:g}",
        "duration_s": f"{options.duration_s:g}",
        "scale": f"{options.scale:g}",
        "jpeg_quality": str(options.jpeg_quality),
    }
