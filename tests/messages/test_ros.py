"""ROS schemas and wire formats: against rosbags' serialiser, and against hostile text and bytes."""

from __future__ import annotations

import contextlib
import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from pipeline.messages.registry import normalised
from pipeline.messages.ros_schema import MAX_FIELDS, parse
from pipeline.messages.ros_wire import cdr_reader, ros1_reader, unpacked
from pipeline.messages.tree import UndecodableMessage

TEXT = """# all kinds of fields
uint8 KIND_A=1
string NAME = "a # b"
bool flag
int8 small
uint16[] many  # a comment
string<=10 name
float64[3] fixed
Inner[] inners
Inner one
string[<=4] words
int64 big
float32 real 1.5
"""
INNER = "uint8 a\nfloat64 b\nuint8[] blob\n"


def definition() -> str:
    return f"{TEXT}{'=' * 80}\nMSG: test/Inner\n{INNER}"


@pytest.fixture(scope="module")
def store() -> Any:
    found = get_typestore(Stores.ROS2_HUMBLE)
    types = get_types_from_msg(INNER, "test/msg/Inner")
    found.register(types | get_types_from_msg(TEXT, "test/msg/Outer"))
    return found


inner = st.tuples(st.integers(0, 255), st.floats(allow_nan=False), st.binary(max_size=9))


@given(
    st.booleans(),
    st.integers(-128, 127),
    st.lists(st.integers(0, 65535), max_size=5),
    st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\0"), max_size=10),
    st.lists(inner, max_size=3),
    st.lists(st.sampled_from(["", "a", "bcd"]), max_size=4),
    st.booleans(),
    st.integers(-(2**63), 2**63 - 1),
)
def test_what_rosbags_writes_is_read(
    store: Any,
    flag: bool,
    small: int,
    many: list[int],
    name: str,
    inners: list[tuple[int, float, bytes]],
    words: list[str],
    ros1: bool,
    big: int,
) -> None:
    outer, part = store.types["test/msg/Outer"], store.types["test/msg/Inner"]
    parts = [part(a=a, b=b, blob=np.frombuffer(blob, np.uint8)) for a, b, blob in inners]
    one = part(a=7, b=0.5, blob=np.frombuffer(b"xyz", np.uint8))
    message = outer(
        flag=flag,
        small=small,
        many=np.array(many, np.uint16),
        name=name,
        fixed=np.array([1.0, 2.0, 3.0]),
        inners=parts,
        one=one,
        words=words,
        big=big,
        real=2.5,
    )
    schema = parse("test/msg/Outer", definition(), ros1=ros1)
    if ros1:
        tree = ros1_reader(schema)(bytes(store.serialize_ros1(message, "test/msg/Outer")))
        trees = [tree]
    else:
        both = [store.serialize_cdr(message, "test/msg/Outer", little_endian=e) for e in (0, 1)]
        trees = [cdr_reader(schema, 10**6)(bytes(data)) for data in both]
    for tree in trees:
        assert (tree["flag"], tree["small"], tree["name"]) == (flag, small, name)
        assert list(tree["many"]) == many
        assert list(tree["fixed"]) == [1.0, 2.0, 3.0]
        assert [(i["a"], i["b"], i["blob"]) for i in tree["inners"]] == inners
        assert (tree["one"]["blob"], tree["words"]) == (b"xyz", words)
        assert (tree["big"], tree["real"]) == (big, 2.5)


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("uint8 [3] x", "no field"),
        ("Missing x", "lacks the type"),
        ("uint8 x\n" * (MAX_FIELDS + 1), "more than"),
        (f"uint8 x\n{'=' * 80}\nuint8 y", "without a name"),
    ],
)
def test_a_schema_that_cannot_be_used_is_refused(text: str, word: str) -> None:
    with pytest.raises(UndecodableMessage, match=word):
        parse("a/B", text, ros1=True)


def test_a_schema_in_a_circle_and_empty_ones_by_the_billion_end() -> None:
    circle = parse("a/B", "B b\n", ros1=True)
    with pytest.raises(UndecodableMessage, match="deep"):
        ros1_reader(circle)(b"")
    levels = [f"{'=' * 80}\nMSG: a/L{i}\nL{i + 1}[100] x\n" for i in range(20)]
    text = "L0 x\n" + "".join(levels) + f"{'=' * 80}\nMSG: a/L20\n"
    with pytest.raises(UndecodableMessage, match="more"):
        ros1_reader(parse("a/B", text, ros1=True))(b"")


@pytest.mark.parametrize("text", ["uint8[] x", "float64[] x", "string x", "string[] x", "B2[] x"])
def test_a_length_is_held_against_the_bytes_before_memory_is_taken(text: str) -> None:
    schema = parse("a/B", f"{text}\n{'=' * 80}\nMSG: a/B2\nuint8 y\n", ros1=True)
    with pytest.raises(UndecodableMessage):
        ros1_reader(schema)(b"\xff\xff\xff\x7f" + b"abc")


def test_a_message_that_expands_to_too_much_is_refused() -> None:
    import zstandard

    bomb = zstandard.compress(b"\0" * 10_000_000)
    assert len(unpacked(bomb, 10**7)) == 10**7
    with pytest.raises(UndecodableMessage, match="more than"):
        unpacked(bomb, 10**6)
    with pytest.raises(UndecodableMessage):
        unpacked(bomb[: len(bomb) // 2] + b"junk", 10**7)


@given(st.binary(max_size=120), st.booleans())
def test_any_bytes_are_read_or_refused(data: bytes, ros1: bool) -> None:
    schema = parse("test/Outer", definition(), ros1=ros1)
    reader = ros1_reader(schema) if ros1 else cdr_reader(schema, 10**6)
    with contextlib.suppress(UndecodableMessage):
        tree = reader(data if ros1 else b"\0\1\0\0" + data)
        assert not math.isinf(len(tree))


@given(st.text(max_size=300))
def test_any_text_is_a_schema_or_refused(text: str) -> None:
    with contextlib.suppress(UndecodableMessage):
        parse("a/B", text, ros1=False)


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("sensor_msgs/msg/Image", "sensor_msgs/Image"),
        ("sensor_msgs/Image", "sensor_msgs/Image"),
        ("sensor_msgs::msg::Image", "sensor_msgs/Image"),
        ("foxglove.RawImage", "foxglove/RawImage"),
        ("foxglove_msgs/msg/RawImage", "foxglove/RawImage"),
        ("stadimeter.CameraExposure", "stadimeter/CameraExposure"),
        ("", ""),
    ],
)
def test_names_of_schemas_are_normalised(name: str, expected: str) -> None:
    assert normalised(name) == expected
