"""Survey of a recording: its content, gaps and damage, without decoding a picture."""

from __future__ import annotations

from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path

from pipeline.core.config import Config
from pipeline.core.diagnostics import Notes
from pipeline.core.exposure import FIELDS, Exposure
from pipeline.core.records import Frame, Intrinsics, Pairing
from pipeline.core.sensors.hints import WAYS_TO_GIVE_A_LENS, gives_lens
from pipeline.images.header import image_size
from pipeline.ingest.frames import FrameAssembler
from pipeline.ingest.pose import CameraPose
from pipeline.mcap_file.reader import McapFile
from pipeline.mcap_file.summary import Statistics, statistics_of
from pipeline.messages.content import Kind
from pipeline.messages.registry import kind_of

# What can be read and checked in about a second; of more, a part is read unless all is asked for.
QUICK_BYTES = 256 * 1024**2


def _picture_of(frame: Frame) -> str:
    layout = frame.layout
    size = image_size(frame.image) if layout is None else (layout.width_px, layout.height_px)
    return frame.image_format + (f" {size[0]}x{size[1]}" if size else "")


@dataclass(slots=True)
class ChannelSurvey:
    """Content of one topic."""

    topic: str
    schema_name: str
    message_encoding: str
    kind: Kind | None
    message_count: int = 0


@dataclass(slots=True)
class CameraSurvey:
    """Content of one camera's frames."""

    camera: str
    topic: str
    frame_count: int = 0
    image_bytes: int = 0
    first_time_ns: int = 0
    last_time_ns: int = 0
    largest_gap_ns: int = 0
    intrinsics: Intrinsics | None = None
    exposure_pairings: dict[Pairing, int] = field(default_factory=dict)
    exposure_ranges: dict[str, tuple[float, float]] = field(default_factory=dict)
    picture: str = ""  # what the first one is: its encoding and, if it states one, its size
    pose: CameraPose | None = None
    truth_count: int = 0
    detection_count: int = 0
    lens_given: bool = False  # by the camera file

    @property
    def frame_rate(self) -> float:
        """Mean frames a second; NaN for a single frame."""
        span_s = (self.last_time_ns - self.first_time_ns) / 1e9
        return (self.frame_count - 1) / span_s if span_s > 0 else float("nan")

    def add(self, frame: Frame) -> None:
        """Count a frame in."""
        if self.frame_count:
            gap_ns = frame.capture_time_ns - self.last_time_ns
            self.largest_gap_ns = max(self.largest_gap_ns, gap_ns)
        else:
            self.first_time_ns = frame.capture_time_ns
            self.picture = _picture_of(frame)
        self.last_time_ns = frame.capture_time_ns
        self.frame_count += 1
        self.image_bytes += len(frame.image)
        self.intrinsics = self.intrinsics or frame.intrinsics
        pairing = frame.exposure_pairing
        self.exposure_pairings[pairing] = self.exposure_pairings.get(pairing, 0) + 1
        self.truth_count += len(frame.truth)
        self.detection_count += len(frame.detections) if frame.detections else 0
        self._widen(frame.exposure)

    def _widen(self, exposure: Exposure) -> None:
        for name in FIELDS:
            value = getattr(exposure, name)
            if value == value:
                low, high = self.exposure_ranges.get(name, (value, value))
                self.exposure_ranges[name] = (min(low, value), max(high, value))

    def missing(self) -> list[str]:
        """Return a sentence for each thing without which some method cannot work."""
        lacks = []
        known = self.exposure_ranges
        if "f_number" not in known:
            lacks.append("no f-number: the methods `aperture` and `defocus` do not apply")
        by_lens = {"focal_length_mm", "pixel_pitch_x_um"} <= set(known)
        by_equivalent = "focal_length_35mm_mm" in known
        if not (self.intrinsics or by_lens or by_equivalent or self.lens_given):
            lacks.append(
                "no lens data (a calibration, or focal length and pixel pitch): distances can be "
                "estimated only if enough people walk here to find the focal length; give "
                f"{WAYS_TO_GIVE_A_LENS} in a camera file"
            )
        return lacks


@dataclass(slots=True)
class Survey:
    """Facts that `stadimeter inspect` tells of a recording.

    Of a large one a part was read, up to `read_bytes`; `span_ns` is then what its summary says.
    """

    path: Path
    size_bytes: int
    read_bytes: int
    content_sha256: str | None
    channels: list[ChannelSurvey]
    cameras: list[CameraSurvey]
    metadata: dict[str, dict[str, str]]
    notes: Notes
    span_ns: int | None = None

    @property
    def is_whole(self) -> bool:
        """Return whether every byte was read, and every CRC checked."""
        return self.content_sha256 is not None


def survey(path: Path, config: Config, *, whole: bool = True) -> Survey:
    """Read a recording with every CRC checked and no picture decoded.

    Args:
        path: the recording.
        config: limits, and cameras that name fields.
        whole: read all of it; else a large one is read up to `QUICK_BYTES`, and its summary.

    Raises:
        NotARecording: the file is empty, or is no MCAP.
    """
    notes = Notes()
    file = McapFile(path, config.limits, notes.add)
    whole = whole or file.size_bytes <= QUICK_BYTES
    assembler = FrameAssembler(file, config.ingest, notes, config.camera, decode_video=False)
    cameras: dict[str, CameraSurvey] = {}
    reached = 0
    with closing(iter(assembler)) as frames:
        for frame in frames:
            seen = cameras.setdefault(frame.camera, CameraSurvey(frame.camera, frame.topic))
            seen.add(frame)
            reached = max(reached, frame.byte_offset)
            if not whole and reached > QUICK_BYTES:
                break
        else:
            whole = True
    for camera in cameras.values():
        camera.pose = assembler.poses.get(camera.camera)
        camera.lens_given = gives_lens(config.camera_named(camera.camera))
    statistics = None if whole or path.is_dir() else statistics_of(path, config.limits)
    return Survey(
        path,
        file.size_bytes,
        file.size_bytes if whole else reached,
        file.content_sha256 if whole else None,
        _channels(file, statistics),
        list(cameras.values()),
        {record.name: dict(record.metadata) for record in file.metadata},
        notes,
        statistics.end_ns - statistics.start_ns if statistics else None,
    )


def _channels(file: McapFile, statistics: Statistics | None) -> list[ChannelSurvey]:
    """Return the channels by topic, with the counts of the summary where there is one."""
    known = dict(file.channels)
    if statistics is not None:
        known |= statistics.channels
    counts = file.message_counts if statistics is None else statistics.message_counts
    found: dict[
        tuple[str, str, str], ChannelSurvey
    ] = {}  # a file of several recordings repeats them
    for channel_id, info in sorted(known.items(), key=lambda item: item[1].topic):
        key = info.topic, info.schema_name, info.message_encoding
        channel = found.setdefault(key, ChannelSurvey(*key, kind_of(info)))
        channel.message_count += counts.get(channel_id, 0)
    return list(found.values())
