"""One camera's video stream: packets in the order of the file go in, bare pictures come out.

A packet builds on those before it, so a stream is decoded in order. Where something was lost, the
frames up to the next key frame would show smears of what moved: they are told as lost, and the
stream resumes at the key frame.

The decoders are FFmpeg's, through `av` (the extra `video`), asked for only when a stream is met.
Sources of the key frames' marks: ITU-T H.264, table 7-1; ITU-T H.265, table 7-1; the VP9 bitstream
specification 0.6, section 6.2; the AV1 bitstream specification, section 5.3.
"""

from __future__ import annotations

from bisect import insort
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any, Generic, NamedTuple, TypeVar

from pipeline.core.errors import MissingLibrary
from pipeline.core.extras import how_to_install
from pipeline.core.records import RawLayout
from pipeline.ingest.video.access_units import FRAMED, AccessUnit, AccessUnits, Times
from pipeline.ingest.video.nal_units import units_of
from pipeline.messages.content import EncodedImage

if TYPE_CHECKING:
    from av.video.frame import VideoFrame

Item = TypeVar("Item")

# A frame shown later than this many packets behind its own does not come any more; the standards
# allow a decoder to hold back 16.
MAX_DELAY = 32
READ_CODECS = ("h264", "hevc", "av1", "vp9")
_DECODERS = {"av1": "libdav1d"}  # FFmpeg's own needs a graphics card
_NOTHING = "the decoder gave no picture for it"
_FULL_RANGE = 2  # AVCOL_RANGE_JPEG
_AV1_SEQUENCE_HEADER = 1
_HEVC_IRAP = range(16, 24)
_H264_IDR = 5
_LOST = "a part of the stream before it was lost"
_UNCLEAN = "it builds on pictures that are missing, until the stream is clean again"
# What FFmpeg's decoder says of a stream that is whole, too.
_HARMLESS = ("mmco",)


class Out(NamedTuple, Generic[Item]):
    """A packet's item with its picture; no picture where it was lost, and why."""

    item: Item
    times: Times
    image: EncodedImage
    problem: str = ""


class VideoStream(Generic[Item]):
    """Decodes one stream. An `Item` is any value that belongs to a packet.

    Raises:
        MissingLibrary: `av` is not installed.
    """

    def __init__(self, codec: str, max_pixels: int) -> None:
        self.codec = codec
        self._max_pixels = max_pixels
        self._error: type[Exception] = ValueError
        self._logged: Callable[[], tuple[int, str]] = lambda: (0, "")
        self._context = self._open()
        self._reason = _LOST
        self._waiting_for_key = True
        self._started = False
        self._number = 0
        self._clean_from = 0  # number of the first picture that is clean
        self._units: AccessUnits[Item] | None = AccessUnits(codec) if codec in FRAMED else None
        self._gap = ""  # lost before the next picture
        self._sent: dict[int, tuple[Item, bool]] = {}  # by number; whether it states its time
        self._log_times: list[int] = []  # of what was sent, sorted
        self._capture_times: list[int] = []

    def lose(self) -> Iterator[Out[Item]]:
        """Say that packets before the next one were lost; yield what was complete before them."""
        if self._units is None:
            self._gap = _LOST
            return
        for unit in self._units.lose(_LOST):
            yield from self._decode(unit)

    def decode(self, data: bytes, item: Item, times: Times) -> Iterator[Out[Item]]:
        """Take a message; yield the frames that are complete with it, in the order of time."""
        if self._units is None:
            key = 0 if is_key_frame(self.codec, data) else None
            gap, self._gap = self._gap, ""
            yield from self._decode(AccessUnit(item, times, data, key, gap))
            return
        for unit in self._units.take(data, item, times):
            yield from self._decode(unit)

    def _decode(self, unit: AccessUnit[Item]) -> Iterator[Out[Item]]:
        if not unit.data:
            yield self._without(unit.item, unit.times, "the message holds nothing of a stream")
            return
        if unit.gap:
            self._reason = unit.gap
            self._waiting_for_key = True
        if self._waiting_for_key:
            if unit.recovers_after is None:
                reason = self._reason if self._started else "no key frame came before it"
                yield self._without(unit.item, unit.times, f"it cannot be decoded: {reason}")
                return
            if self._started:
                yield from self._end()
            self._waiting_for_key = False
            self._clean_from = self._number + unit.recovers_after
        self._started = True
        self._keep(unit.item, unit.times)
        self._number += 1
        try:
            pictures = self._pictures(unit.data, self._number - 1)
        except (self._error, ValueError) as error:
            yield from self._fail(f"the decoder refuses it: {error}")
            return
        for picture in pictures:
            yield from self._shown(picture)
        for number in [n for n in self._sent if n < self._number - MAX_DELAY]:
            yield self._lost(number, _NOTHING)

    def flush(self) -> Iterator[Out[Item]]:
        """Yield what is held back, and tell what the decoder never gave; then start afresh."""
        for unit in self._units.flush() if self._units is not None else ():
            yield from self._decode(unit)
        yield from self._end()

    def _end(self) -> Iterator[Out[Item]]:
        try:
            rest = self._context.decode(None) if self._started else []
        except (self._error, ValueError):
            rest = []
        for picture in rest:
            yield from self._shown(picture)
        yield from self._fail(_NOTHING)
        self._context = self._open()

    def _open(self) -> Any:
        try:
            import av
        except ImportError as error:
            raise MissingLibrary(
                f"a {self.codec} video stream needs the library av",
                remedy=how_to_install("video"),
            ) from error
        av.logging.set_level(av.logging.PANIC)  # what is wrong is told in the diagnostics
        self._error = av.error.FFmpegError

        def logged() -> tuple[int, str]:
            count, last = av.logging.get_last_error()
            return count, last[2].strip() if last else ""

        self._logged = logged
        context: Any = av.CodecContext.create(_DECODERS.get(self.codec, self.codec), "r")
        context.thread_count = 1  # the other cores decode and measure the frames before
        context.options = {"max_pixels": str(self._max_pixels)}
        if self.codec == "av1":
            context.options |= {"max_frame_delay": "1"}
        return context

    def _pictures(self, data: bytes, number: int) -> list[VideoFrame]:
        from av.packet import Packet

        packet = Packet(data)
        packet.pts = packet.dts = number
        before, _ = self._logged()
        pictures: list[VideoFrame] = self._context.decode(packet)
        count, text = self._logged()
        if count != before and not text.startswith(_HARMLESS):
            # It goes on without what is missing, and would show smears up to the next key frame.
            raise ValueError(text)
        return pictures

    def _shown(self, picture: VideoFrame) -> Iterator[Out[Item]]:
        """Yield a decoded frame; frames come in the order in which they are shown."""
        if picture.pts not in self._sent:
            return  # a stream that was cut can bring a frame twice
        if not self._context.has_b_frames:
            for number in [n for n in self._sent if n < picture.pts]:
                yield self._lost(number, _NOTHING)
        if picture.pts < self._clean_from:
            yield self._lost(picture.pts, _UNCLEAN)
            return
        if getattr(picture, "is_corrupt", False):
            yield self._lost(picture.pts, "the decoder says that it is damaged")
            return
        item, times = self._taken(picture.pts)
        image, layout = _pixels(picture)
        yield Out(item, times, EncodedImage(self.codec, image, layout))

    def _keep(self, item: Item, times: Times) -> None:
        self._sent[self._number] = (item, times.capture_time_ns is not None)
        log_ns, capture_ns = times
        insort(self._log_times, log_ns)
        insort(self._capture_times, log_ns if capture_ns is None else capture_ns)

    def _taken(self, number: int) -> tuple[Item, Times]:
        """Return what was sent with a packet, and the earliest times that wait.

        Without B-frames these are its own. With them, some recorders stamp a packet with the time
        at which it is shown, and others as it comes; what is shown first was taken first.
        """
        item, stated = self._sent.pop(number)
        log_ns, capture_ns = self._log_times.pop(0), self._capture_times.pop(0)
        return item, Times(log_ns, capture_ns if stated else None)

    def _lost(self, number: int, problem: str) -> Out[Item]:
        item, times = self._taken(number)
        return self._without(item, times, problem)

    def _fail(self, problem: str) -> Iterator[Out[Item]]:
        """Tell that all packets sent and not shown are lost."""
        self._waiting_for_key = True
        for number in sorted(self._sent):
            yield self._lost(number, problem)

    def _without(self, item: Item, times: Times, problem: str) -> Out[Item]:
        return Out(item, times, EncodedImage(self.codec, b""), problem)


def _pixels(picture: VideoFrame) -> tuple[bytes, RawLayout]:
    """Return a frame's pixels: as the decoder made them, if their layout is the usual one."""
    width, height = picture.width, picture.height
    usual = picture.format.name == "yuv420p" and picture.color_range != _FULL_RANGE
    if usual and width % 2 == 0 and height % 2 == 0:
        return picture.to_ndarray().tobytes(), RawLayout("i420", width, height)
    return picture.to_ndarray(format="bgr24").tobytes(), RawLayout("bgr8", width, height)


def is_key_frame(codec: str, data: bytes) -> bool:
    """Return whether a packet can be decoded with nothing before it."""
    if codec == "h264":
        return any(unit[0] & 0x1F == _H264_IDR for unit in units_of(codec, data))
    if codec == "hevc":
        return any(unit[0] >> 1 & 0x3F in _HEVC_IRAP for unit in units_of(codec, data))
    if codec == "vp9":
        return _is_vp9_key(data)
    return _AV1_SEQUENCE_HEADER in _av1_unit_types(data)


def _is_vp9_key(data: bytes) -> bool:
    if not data or data[0] >> 6 != 2:  # the frame marker
        return False
    profile = data[0] >> 5 & 1 | data[0] >> 3 & 2
    first = 2 if profile == 3 else 3  # profile 3 has a reserved bit before
    shows_existing, is_inter = data[0] >> first & 1, data[0] >> (first - 1) & 1
    return not shows_existing and not is_inter


def _av1_unit_types(data: bytes) -> Iterator[int]:
    at = 0
    while at < len(data):
        head = data[at]
        yield head >> 3 & 0xF
        at += 2 if head & 4 else 1  # with an extension
        if not head & 2:  # no size: it goes to the end
            return
        size, shift = 0, 0
        while at < len(data) and shift < 56:
            size |= (data[at] & 0x7F) << shift
            shift += 7
            at += 1
            if not data[at - 1] & 0x80:
                break
        at += size
