"""H.264 and H.265 as recorders write them: units apart or together, without key frames, with losses."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction

import av
import numpy as np
import pytest

from pipeline.images.raw import decode_raw
from pipeline.ingest.video.access_units import Times
from pipeline.ingest.video.nal_units import START, units_of
from pipeline.ingest.video.video_stream import Out, VideoStream

COUNT, STEP = 40, 5
ENCODERS = {"h264": "libx264", "hevc": "libx265"}
KEY_EVERY = 10
Packets = list[bytes]


def stream(codec: str, options: str, key_every: int = KEY_EVERY, slices: int = 1) -> Packets:
    """Return packets of pictures whose brightness tells their number."""
    context = av.CodecContext.create(ENCODERS[codec], "w")
    context.width, context.height, context.pix_fmt = 128, 96, "yuv420p"
    context.time_base, context.framerate = Fraction(1, 25), Fraction(25)
    context.gop_size = key_every
    parameters = f"log-level=none:keyint={key_every}:{options}"
    if codec == "h264":
        parameters = f"keyint={key_every}:scenecut=0:slices={slices}:{options}"
    context.options = {f"x{codec.replace('hevc', 'h265')[1:]}-params": parameters}
    packets = []
    for number in range(COUNT):
        pixels = np.full((96, 128, 3), 10 + STEP * number, np.uint8)
        picture = av.VideoFrame.from_ndarray(pixels, format="bgr24").reformat(format="yuv420p")
        picture.pts = number
        packets += context.encode(picture)
    return [bytes(p) for p in [*packets, *context.encode(None)]]


def decoded(codec: str, messages: Packets) -> list[Out[int]]:
    video: VideoStream[int] = VideoStream(codec, 10**6)
    outs = []
    for number, data in enumerate(messages):
        outs += video.decode(data, number, Times(number * 100, number * 100))
    return outs + list(video.flush())


def shown(outs: list[Out[int]]) -> list[int]:
    """Return the numbers of the pictures that were not left out."""
    numbers = []
    for out in outs:
        if out.image.layout is not None:
            assert not out.problem
            mean = decode_raw(out.image.data, out.image.layout).mean()
            numbers.append(round((mean - 10) / STEP))
    return numbers


def unit_kind(codec: str, unit: bytes) -> int:
    return unit[0] & 31 if codec == "h264" else unit[0] >> 1 & 63


def is_picture(codec: str, unit: bytes) -> bool:
    return unit_kind(codec, unit) in ((1, 2, 5) if codec == "h264" else range(32))


def framed(units: list[bytes]) -> bytes:
    return b"".join(START + unit for unit in units)


def parameters_apart(codec: str, packets: Packets) -> Packets:
    messages = []
    for packet in packets:
        units = units_of(codec, packet)
        messages += [framed([u for u in units if not is_picture(codec, u)])]
        messages += [framed([u for u in units if is_picture(codec, u)])]
    return [m for m in messages if m]


def one_unit_a_message(codec: str, packets: Packets) -> Packets:
    return [START + unit for packet in packets for unit in units_of(codec, packet)]


def bare_units(codec: str, packets: Packets) -> Packets:
    return [unit for packet in packets for unit in units_of(codec, packet)]


def with_lengths(codec: str, packets: Packets) -> Packets:
    return [
        b"".join(len(u).to_bytes(4, "big") + u for u in units_of(codec, packet))
        for packet in packets
    ]


def configuration_first(codec: str, packets: Packets) -> Packets:
    """Return an MP4's packets: parameter sets in a configuration record, units by lengths."""
    units = units_of(codec, packets[0])
    if codec == "h264":
        sets = [[u for u in units if unit_kind(codec, u) == kind] for kind in (7, 8)]
        head = bytes([1, *sets[0][0][1:4], 0xFF, 0xE1])
        head += len(sets[0][0]).to_bytes(2, "big") + sets[0][0]
        head += b"\1" + len(sets[1][0]).to_bytes(2, "big") + sets[1][0]
    else:
        head = bytes([1]) + bytes(21) + b"\3"
        for kind in (32, 33, 34):
            unit = next(u for u in units if unit_kind(codec, u) == kind)
            head += bytes([kind]) + b"\0\1" + len(unit).to_bytes(2, "big") + unit
    bare = [framed([u for u in units_of(codec, p) if is_picture(codec, u)]) for p in packets]
    return [head, *with_lengths(codec, bare)]


def two_pictures_a_message(codec: str, packets: Packets) -> Packets:
    return [b"".join(packets[n : n + 2]) for n in range(0, len(packets), 2)]


FRAMINGS: list[Callable[[str, Packets], Packets]] = [
    parameters_apart,
    one_unit_a_message,
    bare_units,
    with_lengths,
    configuration_first,
    two_pictures_a_message,
]


@pytest.mark.parametrize("codec", ENCODERS)
@pytest.mark.parametrize("framing", FRAMINGS)
@pytest.mark.parametrize("bframes", [0, 2])
def test_every_picture_is_decoded_however_it_is_framed(
    codec: str, framing: Callable[[str, Packets], Packets], bframes: int
) -> None:
    outs = decoded(codec, framing(codec, stream(codec, f"bframes={bframes}")))
    assert not [out.problem for out in outs if out.problem]
    assert shown(outs) == list(range(COUNT))
    times = [out.times.capture_time_ns or 0 for out in outs]
    assert times == sorted(set(times))


@pytest.mark.parametrize("framing", FRAMINGS)
def test_slices_of_a_picture_are_put_together(
    framing: Callable[[str, Packets], Packets],
) -> None:
    packets = stream("h264", "bframes=0", slices=3)
    assert sum(is_picture("h264", u) for u in units_of("h264", packets[0])) == 3
    outs = decoded("h264", framing("h264", packets))
    assert shown(outs) == list(range(COUNT))
    assert len(outs) == COUNT


@pytest.mark.parametrize("codec", ENCODERS)
@pytest.mark.parametrize("lost", [3, 14, 28])
def test_pictures_after_a_lost_packet_are_left_out_up_to_the_next_key_frame(
    codec: str, lost: int
) -> None:
    packets = stream(codec, "bframes=0")
    outs = decoded(codec, packets[:lost] + packets[lost + 1 :])
    resumed = (lost // KEY_EVERY + 1) * KEY_EVERY
    assert shown(outs) == [n for n in range(COUNT) if n < lost or n >= resumed]
    assert sum(bool(out.problem) for out in outs) == resumed - lost - 1


def test_with_b_frames_only_the_loss_of_what_others_refer_to_costs_more() -> None:
    packets = stream("h264", "bframes=2:b-pyramid=0", key_every=COUNT)
    refers = [bool(units_of("h264", p)[-1][0] >> 5 & 3) for p in packets]
    unused = refers.index(False, 12)
    used = refers.index(True, 12)
    assert len(shown(decoded("h264", packets[:unused] + packets[unused + 1 :]))) == COUNT - 1
    assert len(shown(decoded("h264", packets[:used] + packets[used + 1 :]))) <= used


def test_a_whole_stream_in_which_numbers_wrap_has_no_gap() -> None:
    packets = stream("h264", "bframes=0:ref=1", key_every=1000)
    assert shown(decoded("h264", packets)) == list(range(COUNT))  # frame_num has 4 bits or so


def test_a_stream_that_is_refreshed_by_columns_is_entered_at_a_recovery_point() -> None:
    packets = stream("h264", "bframes=0:intra-refresh=1:ref=1", key_every=8)
    keys = [n for n, p in enumerate(packets) if any(u[0] & 31 == 5 for u in units_of("h264", p))]
    assert keys == [0]
    head = [u for u in units_of("h264", packets[0]) if u[0] & 31 in (7, 8)]
    outs = decoded("h264", [framed(head) + packets[11], *packets[12:]])
    numbers = shown(outs)
    assert numbers == list(range(numbers[0], COUNT))
    assert 16 < numbers[0] < 32  # after a point and a whole refresh
    lost = shown(decoded("h264", packets[:13] + packets[14:]))
    assert lost[:13] == list(range(13))
    assert lost[-1] == COUNT - 1
    assert not set(lost) & {14, 15, 16}


def test_intra_pictures_are_entries_where_a_stream_tells_none() -> None:
    packets = stream("h264", "bframes=0:open-gop=1")
    stripped = [framed([u for u in units_of("h264", p) if u[0] & 31 not in (6,)]) for p in packets]
    head = [u for u in units_of("h264", packets[0]) if u[0] & 31 in (7, 8)]
    outs = decoded("h264", [framed(head) + stripped[4], *stripped[5:]])
    assert shown(outs) == list(range(10, COUNT))


def test_messages_that_hold_nothing_of_a_stream_are_told() -> None:
    packets = stream("h264", "bframes=0")
    outs = decoded("h264", [*packets[:5], b"\0\0\1\x1f" + bytes(20), *packets[5:]])
    assert sum("nothing of a stream" in out.problem for out in outs) >= 1
    assert shown(outs)[:5] == [0, 1, 2, 3, 4]
    assert shown(outs)[5:] == list(range(10, COUNT))
