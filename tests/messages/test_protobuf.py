"""A field of bytes where it stands, against Google's own parser."""

from __future__ import annotations

import pytest
from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from google.protobuf.timestamp_pb2 import Timestamp
from hypothesis import given
from hypothesis import strategies as st

from pipeline.messages.protobuf import bytes_field
from pipeline.messages.tree import UndecodableMessage

DATA = CompressedImage.DATA_FIELD_NUMBER


@given(
    st.binary(max_size=300),
    st.text(max_size=200),
    st.integers(0, 2**62),
    st.integers(0, 999_999_999),
    st.binary(max_size=20),
)
def test_the_field_is_what_the_parser_finds(
    data: bytes, frame_id: str, seconds: int, nanos: int, again: bytes
) -> None:
    message = CompressedImage(
        timestamp=Timestamp(seconds=seconds, nanos=nanos), frame_id=frame_id, data=data
    ).SerializeToString()
    assert bytes(bytes_field(memoryview(message), DATA)) == data
    # Of a field that comes twice the last counts.
    twice = message + CompressedImage(data=again).SerializeToString()
    expected = CompressedImage.FromString(twice).data
    assert bytes(bytes_field(memoryview(twice), DATA)) == expected


@given(st.binary(max_size=60))
def test_what_is_no_message_is_refused_or_read_in_bounds(data: bytes) -> None:
    try:
        found = bytes_field(memoryview(data), DATA)
    except UndecodableMessage:
        return
    assert len(found) <= len(data)


def test_numbers_of_a_fixed_size_are_passed_over() -> None:
    before = bytes([1 << 3 | 1, *range(8), 5 << 3 | 5, *range(4), 6 << 3, 0xFF, 0x01])
    message = before + CompressedImage(data=b"picture").SerializeToString()
    assert bytes(bytes_field(memoryview(message), DATA)) == b"picture"


@pytest.mark.parametrize("cut", [1, 2, 5])
def test_a_message_that_is_cut_off_is_refused(cut: int) -> None:
    message = CompressedImage(data=b"picture").SerializeToString()[:-cut]
    with pytest.raises(UndecodableMessage):
        bytes_field(memoryview(message), DATA)
