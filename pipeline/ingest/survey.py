"""What is in a recording, what is missing and what is damaged, without decoding a picture."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from pipeline.config import Config
from pipeline.diagnostics import Notes
from pipeline.ingest.decode.content import Kind
from pipeline.ingest.decode.registry import kind_of
from pipeline.ingest.frames import FrameAssembler
from pipeline.ingest.mcap_records import McapFile
from pipeline.records import EXPOSURE_FIELDS, Exposure, Frame, Intrinsics, Pairing


@dataclass(slots=True)
class ChannelSurvey:
    """How much one topic holds."""

    topic: str
    schema_name: str
    message_encoding: str
    kind: Kind | None
    message_count: int = 0


@dataclass(slots=True)
class CameraSurvey:
    """What one camera's frames come with."""

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
    truth_count: int = 0
    detection_count: int = 0

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
        for name in EXPOSURE_FIELDS:
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
        if self.intrinsics is None and not {"focal_length_mm", "pixel_pitch_x_um"} <= set(known):
            lacks.append(
                "no lens data (a calibration, or focal length and pixel pitch): no distance can be "
                "told; give them in a camera file"
            )
        return lacks


@dataclass(slots=True)
class Survey:
    """What `stadimeter inspect` tells of a recording."""

    path: Path
    size_bytes: int
    content_sha256: str
    channels: list[ChannelSurvey]
    cameras: list[CameraSurvey]
    metadata: dict[str, dict[str, str]]
    notes: Notes


def survey(path: Path, config: Config) -> Survey:
    """Read a whole recording, every CRC checked, no picture decoded.

    Raises:
        NotARecording: the file is empty, or is no MCAP.
    """
    notes = Notes()
    file = McapFile(path, config.limits, notes.add)
    assembler = FrameAssembler(file, config.ingest, notes, config.camera, decode_video=False)
    cameras: dict[str, CameraSurvey] = {}
    for frame in assembler:
        seen = cameras.setdefault(frame.camera, CameraSurvey(frame.camera, frame.topic))
        seen.add(frame)
    channels = [
        ChannelSurvey(
            info.topic,
            info.schema_name,
            info.message_encoding,
            kind_of(info),
            file.message_counts.get(channel_id, 0),
        )
        for channel_id, info in sorted(file.channels.items(), key=lambda item: item[1].topic)
    ]
    metadata = {record.name: dict(record.metadata) for record in file.metadata}
    return Survey(
        path,
        file.size_bytes,
        file.content_sha256,
        channels,
        list(cameras.values()),
        metadata,
        notes,
    )
