"""Recording made of a video file: pictures as JPEG, with the known lens data."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
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
    part_of,
)
from pipeline.messages.exposure import exposure_message
from pipeline.parallel.apart import Died, call_apart

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
    provenance: Mapping[str, str] = field(
        default_factory=dict
    )  # for the metadata, beside the others


def import_video(
    video: Path,
    recording: Path,
    options: VideoImport,
    camera: CameraConfig,
    progress: Callable[[int], None] = lambda frames: None,
) -> int:
    """Write a recording of a video; return the number of frames.

    The video is decoded in a process of its own, as some broken files end the process that does it.

    Raises:
        UnreadableVideo: OpenCV cannot read it, or it holds no frame in the asked time.
        UsageError: the frame rate is neither in the file nor given.
    """
    if not video.is_file():
        raise UnreadableVideo("there is no such file", where=Where(video))
    count = 0

    def report(frames: int) -> None:
        nonlocal count
        count = frames
        progress(frames)

    try:
        made: int = call_apart(write_recording, video, recording, options, camera, report=report)
    except Died as error:
        part_of(recording).unlink(missing_ok=True)
        raise UnreadableVideo(
            f"the video library could not go on after {count:,} frames: it {error.problem}",
            where=Where(video),
            remedy="The file is broken there; "
            + ("take the part before with --duration, or convert it" if count else "convert it"),
        ) from None
    return made


def write_recording(
    video: Path,
    recording: Path,
    options: VideoImport,
    camera: CameraConfig,
    report: Callable[[int], None],
) -> int:
    """Write a recording of a video in this process; see `import_video`."""
    with _capture(video) as capture:
        times = FrameTimes(options.frame_rate, capture.get(cv2.CAP_PROP_FPS), video)
        count = 0
        with RecordingWriter(recording) as writer:
            for image in _images(capture):
                time_s = times.next(capture.get(cv2.CAP_PROP_POS_MSEC) / 1e3)
                if round((time_s - options.from_s) * 1e6) < 0:
                    continue
                if time_s - options.from_s >= options.duration_s:
                    break
                time_ns = options.start_time_ns + round(time_s * 1e9)
                _write_frame(writer, image, time_ns, options, camera)
                count += 1
                report(count)
            if count == 0:
                raise UnreadableVideo(
                    "no frame could be read in the requested time",
                    where=Where(video),
                    remedy="Check --from and --duration, or convert the video",
                )
            writer.add_metadata("stadimeter.import", _provenance(video, times, options))
    return count


class FrameTimes:
    """Times of a video's frames since its start: by a rate that was given, else by the container.

    Args:
        given: frames a second; None takes the container's own times, at a varying rate too.
        stated: the frame rate that the container states, for frames without a time.
        video: the file, for errors.

    Raises:
        UsageError: the frame rate is neither in the file nor given.
    """

    def __init__(self, given: float | None, stated: float, video: Path) -> None:
        self.rate = given or stated
        if not FRAME_RATES[0] <= self.rate <= FRAME_RATES[1]:
            raise UsageError(
                f"the video states no usable frame rate ({self.rate:g})",
                where=Where(video),
                remedy="Give it with --fps",
            )
        self.source = "frame rate as given" if given else "container"
        self._given = given is not None
        self._index = -1
        self._last_s = -math.inf

    def next(self, stated_s: float) -> float:
        """Return the time of the next frame; `stated_s` is the container's."""
        self._index += 1
        if self._given:
            return self._index / self.rate
        if not math.isfinite(stated_s) or stated_s <= self._last_s:
            if self._index:
                self.source = "container; frames without a time follow at its frame rate"
            stated_s = self._last_s + 1 / self.rate if self._index else 0.0
        self._last_s = stated_s
        return stated_s


@contextmanager
def _capture(video: Path) -> Iterator[cv2.VideoCapture]:
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
    stored_px = (stored.shape[1], stored.shape[0])
    write_lens(writer, time_ns, name, camera, (width_px, height_px), stored_px)


def write_lens(
    writer: RecordingWriter,
    time_ns: int,
    name: str,
    camera: CameraConfig,
    size_px: tuple[int, int],
    stored_px: tuple[int, int],
) -> None:
    """Write what a camera file says of the lens, as the calibration and exposure of a frame.

    Args:
        writer: the recording.
        time_ns: time of the frame.
        name: name of the camera.
        camera: its entry in the camera file.
        size_px: width and height of the video's pictures.
        stored_px: width and height of the stored ones.
    """
    prefix, (width_px, height_px) = f"/{name}", size_px
    lens = lens_of(UNKNOWN_EXPOSURE, camera, None, width_px, height_px)
    intrinsics, _, _ = intrinsics_of(None, camera, lens, width_px, height_px)
    if intrinsics is not None:
        scaled = fit_to_picture(intrinsics, *stored_px) or intrinsics
        writer.write(f"{prefix}/calibration", calibration_message(scaled, time_ns, name), time_ns)
    stated = Exposure(**{row: getattr(lens, row) for row in FIELDS if hasattr(lens, row)})
    if any(not math.isnan(getattr(stated, row)) for row in FIELDS):
        size = {"sensor_width_px": float(width_px), "sensor_height_px": float(height_px)}
        message = exposure_message(replace(stated, **size), time_ns, name)
        writer.write(f"{prefix}/exposure", message, time_ns)


def _provenance(video: Path, times: FrameTimes, options: VideoImport) -> dict[str, str]:
    return {
        **options.provenance,
        "source": video.name,
        "frame_rate": f"{times.rate:g}",
        "frame_times": times.source,
        "from_s": f"{options.from_s:g}",
        "duration_s": f"{options.duration_s:g}",
        "scale": f"{options.scale:g}",
        "jpeg_quality": str(options.jpeg_quality),
    }
