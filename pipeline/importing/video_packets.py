"""Recording made of a video file without decoding it: its packets as they are, as CompressedVideo.

Packets of MP4 and MOV have lengths before their units, and parameter sets apart (ISO/IEC 14496-15); in a
recording they have start codes and the parameter sets before each key frame (ITU-T H.264 and H.265, annex
B), which FFmpeg's filters make of them. The pictures are those of the video, bit for bit.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from foxglove_schemas_protobuf.CompressedVideo_pb2 import CompressedVideo

from pipeline.core.config import CameraConfig
from pipeline.core.errors import StadimeterError, Where
from pipeline.core.extras import how_to_install
from pipeline.importing.video_file import (
    FRAME_RATES,
    UnreadableVideo,
    VideoImport,
    write_lens,
)
from pipeline.ingest.video.video_stream import is_key_frame
from pipeline.mcap_file.writer import RecordingWriter, part_of, timestamp
from pipeline.parallel.apart import Died, call_apart

# Foxglove's names of the codecs that a recording holds as packets, by FFmpeg's.
FORMATS = {"h264": "h264", "hevc": "h265", "av1": "av1", "vp9": "vp9"}
_FILTERS = {"h264": "h264_mp4toannexb,dump_extra=freq=k", "hevc": "hevc_mp4toannexb"}
# Containers write these where nothing was set: the start of the clock of Unix, and of QuickTime.
_FIRST_YEAR = 1990
_AV1_CONFIGURATION_BYTES = 4  # before the units in the box av1C (AV1 in ISO base media, 2.3.3)
# Pictures until the first one comes out of a decoder: the standards let 16 wait.
_MOST_HELD_BACK = 64
# Sound may go on a little after the last picture.
_END_TOLERANCE_S = 1.0


class MustBeReencoded(StadimeterError):
    """The packets of a video cannot stand in a recording as they are; `problem` says why."""


@dataclass(slots=True)
class PacketImport:
    """A recording that was made: its number of frames, and remarks on what is doubtful of it."""

    frame_count: int = 0
    remarks: list[str] = field(default_factory=list)


def start_time_ns(video: Path) -> int | None:
    """Return the time of creation that a container states; None if it states none, or a dummy."""
    try:
        import av

        with av.open(str(video), metadata_errors="ignore") as container:
            stream = container.streams.best("video")
            texts = [container.metadata, stream.metadata if stream is not None else {}]
    except (ImportError, OSError, ValueError):
        return None
    for metadata in texts:
        try:
            made = datetime.fromisoformat(metadata["creation_time"])
        except (KeyError, ValueError):
            continue
        made = made if made.tzinfo else made.replace(tzinfo=UTC)
        if made.year >= _FIRST_YEAR:
            return round(made.timestamp() * 1e6) * 1000
    return None


def import_packets(
    video: Path,
    recording: Path,
    options: VideoImport,
    camera: CameraConfig,
    progress: Callable[[int], None] = lambda frames: None,
) -> PacketImport:
    """Write a recording of a video with its packets as they are, in a process of its own.

    An excerpt begins with the last key frame before it, as what follows cannot be decoded otherwise.

    Raises:
        MustBeReencoded: the codec is another one, the pictures are to be turned or made smaller, or
            the library for it is not installed.
        UnreadableVideo: it holds no frame in the asked time, or ends the process that reads it.
    """
    try:
        made: PacketImport = call_apart(
            write_packets, video, recording, options, camera, report=progress
        )
    except Died as error:
        part_of(recording).unlink(missing_ok=True)
        raise UnreadableVideo(
            f"the video library could not read it: it {error.problem}", where=Where(video)
        ) from None
    return made


def write_packets(
    video: Path,
    recording: Path,
    options: VideoImport,
    camera: CameraConfig,
    report: Callable[[int], None],
) -> PacketImport:
    """Write a recording of a video in this process; see `import_packets`."""
    try:
        import av
    except ImportError:
        raise MustBeReencoded(
            "the library av is not installed", remedy=how_to_install("video")
        ) from None
    av.logging.set_level(av.logging.PANIC)
    if options.scale != 1.0:
        raise MustBeReencoded("the pictures are made smaller")
    try:
        codec, turned_deg = _examined(video)
        if codec not in FORMATS:
            raise MustBeReencoded(
                f"its pictures are in {codec}, which has no packets in recordings"
            )
        if turned_deg:
            raise MustBeReencoded(f"its pictures are to be shown turned by {turned_deg} degrees")
        return _Packets(video, codec, options).write(recording, camera, report)
    except (av.error.FFmpegError, ValueError) as error:
        raise MustBeReencoded(f"its packets cannot be read ({error})") from error


def _examined(video: Path) -> tuple[str, int]:
    """Return the codec of a video, and by how much its pictures are to be turned."""
    import av

    with av.open(str(video), metadata_errors="ignore") as container:
        stream = container.streams.best("video")
        if stream is None:
            raise UnreadableVideo("the file holds no video", where=Where(video))
        codec = stream.codec_context.codec.canonical_name
        for number, packet in enumerate(container.demux(stream)):
            for picture in packet.decode():
                return codec, int(picture.rotation)
            if number > _MOST_HELD_BACK:
                break
        raise MustBeReencoded("no picture comes out of its first packets")


class _Packets:
    """Packets of one video, as they go into a recording."""

    def __init__(self, video: Path, codec: str, options: VideoImport) -> None:
        self._video, self._codec, self._options = video, codec, options
        self._made = PacketImport()
        self._rate = math.nan
        self._times_source = "container"
        self._last_log_ns = -1
        self._refused = 0  # packets

    def write(
        self, recording: Path, camera: CameraConfig, report: Callable[[int], None]
    ) -> PacketImport:
        """Write the recording; what comes before an error of the file is kept."""
        import av

        options, made, last_s = self._options, self._made, -math.inf
        with RecordingWriter(recording) as writer:
            begin_s = self._last_key_s() if options.from_s > 0 else -math.inf
            with av.open(str(self._video), metadata_errors="ignore") as container:
                stream = container.streams.best("video")
                size_px = (stream.codec_context.width, stream.codec_context.height)
                self._rate = float(options.frame_rate or stream.average_rate or math.nan)
                if options.frame_rate and not FRAME_RATES[0] <= self._rate <= FRAME_RATES[1]:
                    raise MustBeReencoded("the frame rate that is given is none")
                if stream.sample_aspect_ratio not in (None, 0, 1):
                    made.remarks.append(
                        f"the pixels are not square ({stream.sample_aspect_ratio}): give fx_px and fy_px"
                    )
                for shown_s, log_s, data in self._taken(container, stream, begin_s):
                    self._write_frame(writer, shown_s, log_s, data, camera, size_px)
                    made.frame_count += 1
                    last_s = max(last_s, shown_s)
                    report(made.frame_count)
                self._note_end(container, stream, last_s)
            if last_s < options.from_s:
                raise UnreadableVideo(
                    "no frame could be read in the requested time",
                    where=Where(self._video),
                    remedy="Check --from and --duration",
                )
            if options.from_s > 0 and begin_s < options.from_s:
                made.remarks.append(
                    f"it begins at the key frame before, {options.from_s - begin_s:.2f} s earlier"
                )
            writer.add_metadata("stadimeter.import", self._provenance())
        return made

    def _note_end(self, container: Any, stream: Any, last_s: float) -> None:
        """Say that a video ends before it should, by its own word, unless only a part was asked for."""
        made, options = self._made, self._options
        if made.remarks or options.from_s > 0 or math.isfinite(options.duration_s):
            return
        lasts_s = (container.duration or 0) / 1e6
        if stream.frames > made.frame_count:
            made.remarks.append(
                f"the video states {stream.frames:,} frames, and {made.frame_count:,} are there"
            )
        elif not options.frame_rate and last_s + _END_TOLERANCE_S < lasts_s:
            made.remarks.append(
                f"the file states that it lasts {lasts_s:.1f} s, and its pictures end at {last_s:.1f} s"
            )

    def _taken(
        self, container: Any, stream: Any, begin_s: float
    ) -> Iterator[tuple[float, float, bytes]]:
        """Yield when each picture is shown, when its packet comes, both in seconds, and its bytes."""
        import av

        end_s = self._options.from_s + self._options.duration_s
        names = _FILTERS.get(self._codec)
        filtered = av.BitStreamFilterContext(names, stream) if names else None
        extra = bytes(stream.codec_context.extradata or b"")
        clock = _Clock(stream, self._options.frame_rate, self._rate)
        try:
            for packet, shown_s, log_s in clock.timed(container.demux(stream)):
                if shown_s < begin_s or log_s < begin_s:
                    continue
                if log_s >= end_s:
                    break
                is_key = bool(packet.is_keyframe)
                try:
                    wholes = filtered.filter(packet) if filtered else [packet]
                except av.error.FFmpegError:
                    if filtered:
                        filtered.flush()
                    self._refused += 1
                    continue
                for whole in wholes:
                    yield shown_s, log_s, self._whole(bytes(whole), extra, is_key)
        except av.error.FFmpegError as error:
            if not self._made.frame_count:
                raise
            self._made.remarks.append(
                f"the video breaks off after {self._made.frame_count:,} frames ({error}): the part "
                "before was taken"
            )
        self._times_source = clock.source
        if self._refused:
            self._made.remarks.append(
                f"{self._refused:,} packets hold no whole picture and were left out"
            )

    def _whole(self, data: bytes, extra: bytes, is_key: bool) -> bytes:
        """Return a packet with the sequence header that AV1 may keep apart."""
        if self._codec == "av1" and is_key and not is_key_frame("av1", data):
            return extra[_AV1_CONFIGURATION_BYTES:] + data
        return data

    def _last_key_s(self) -> float:
        """Return the time of the last key frame at or before the excerpt, without decoding."""
        import av

        found_s = -math.inf
        with av.open(str(self._video), metadata_errors="ignore") as container:
            stream = container.streams.best("video")
            clock = _Clock(stream, self._options.frame_rate, float(stream.average_rate or math.nan))
            for packet, shown_s, log_s in clock.timed(container.demux(stream)):
                if log_s > self._options.from_s:
                    break
                if packet.is_keyframe and shown_s <= self._options.from_s:
                    found_s = shown_s
        return found_s

    def _write_frame(
        self,
        writer: RecordingWriter,
        shown_s: float,
        log_s: float,
        data: bytes,
        camera: CameraConfig,
        size_px: tuple[int, int],
    ) -> None:
        name, start_ns = self._options.camera, self._options.start_time_ns
        time_ns = start_ns + round(shown_s * 1e9)
        # A reader takes messages in the order of their log times: that of the packets.
        log_ns = max(start_ns + round(log_s * 1e9), self._last_log_ns + 1)
        self._last_log_ns = log_ns
        message = CompressedVideo(
            timestamp=timestamp(time_ns), frame_id=name, data=data, format=FORMATS[self._codec]
        )
        writer.write(f"/{name}/image", message, log_ns)
        write_lens(writer, time_ns, name, camera, size_px, size_px)

    def _provenance(self) -> dict[str, str]:
        return {
            **self._options.provenance,
            "frames": str(self._made.frame_count),
            "source": self._video.name,
            "pictures": f"{FORMATS[self._codec]} as in the video, not encoded anew",
            "frame_rate": f"{self._rate:g}",
            "frame_times": self._times_source,
            "from_s": f"{self._options.from_s:g}",
            "duration_s": f"{self._options.duration_s:g}",
            "remarks": "; ".join(self._made.remarks),
        }


class _Clock:
    """Times of packets since the first picture, in seconds.

    By a rate that is given, else by the container; a packet without times follows at the frame rate.
    """

    def __init__(self, stream: Any, given: float | None, rate: float) -> None:
        self._given, self._rate = given, rate if rate > 0 else 25.0
        self._base_s = float(stream.time_base)
        self.source = "frame rate as given" if given else "container"

    def timed(self, packets: Iterable[Any]) -> Iterator[tuple[Any, float, float]]:
        """Yield each packet with the times when its picture is shown and when the packet comes."""
        waiting: list[tuple[Any, float]] = []  # the first ones, until it is known when one comes
        zero: int | None = None
        first_dts: int | None = None
        last_s, step_s = 0.0, 1 / self._rate
        for index, packet in enumerate(p for p in packets if p.size):
            pts = packet.pts if packet.pts is not None else packet.dts
            if self._given or pts is None:
                # In the order of packets; a reader gives the earliest time to what is shown first.
                if not self._given:
                    self.source = "container; frames without a time follow at its frame rate"
                last_s = index / (self._given or self._rate)
                yield packet, last_s, last_s
                continue
            zero = pts if zero is None else zero
            shown_s = (pts - zero) * self._base_s
            if packet.dts is None and first_dts is None and len(waiting) < _MOST_HELD_BACK:
                waiting.append((packet, shown_s))
                continue
            if first_dts is None:
                first_dts = packet.dts if packet.dts is not None else pts
                last_s = (len(waiting) - 1) * step_s
            for number, (early, early_s) in enumerate(waiting):
                yield early, early_s, number * step_s
            comes_s = (packet.dts - first_dts) * self._base_s if packet.dts is not None else None
            held_s, waiting = len(waiting) * step_s if waiting else None, []
            if held_s is not None:
                first_dts -= round(held_s / self._base_s)
                comes_s = held_s
            last_s = last_s + step_s if comes_s is None else comes_s
            yield packet, shown_s, last_s
        for number, (early, early_s) in enumerate(waiting):
            yield early, early_s, number * step_s
