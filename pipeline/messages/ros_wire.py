"""ROS messages by the definitions in their file: CDR (ROS 2) and ROS 1's serialisation.

Both are the fields one after the other. ROS 1 packs them; CDR aligns each number to its own size,
counted from behind four bytes that tell the byte order, and ends a text with a zero. An array is
never read before its length was held against the bytes that are left.

Sources: OMG DDS-RTPS 2.5, section 10.2 (the four bytes); OMG DDS-XTypes 1.3, section 7.4.3 (plain
CDR, version 1); the ROS 1 wiki, "Msgs" and "roscpp/Overview/MessagesSerializationAndAdaptingTypes".
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from typing import Any

import numpy as np
import zstandard

from pipeline.messages.ros_schema import Schema
from pipeline.messages.tree import Tree, UndecodableMessage

MAX_DEPTH = 32  # of messages in messages
_NUMBERS = {
    "bool": "?",
    "byte": "B",
    "char": "B",
    "int8": "b",
    "uint8": "B",
    "int16": "h",
    "uint16": "H",
    "int32": "i",
    "uint32": "I",
    "int64": "q",
    "uint64": "Q",
    "float32": "f",
    "float64": "d",
}
_BYTES = frozenset({"byte", "char", "uint8"})
# The representation identifiers of plain CDR, and whether the numbers are little-endian.
_ENCAPSULATIONS = {b"\0\0": False, b"\0\1": True}
_ZSTD = b"\x28\xb5\x2f\xfd"
_BLOCK = 1 << 20


class _Cursor:
    """Takes values off a message, bounded by its bytes."""

    def __init__(self, data: memoryview, *, little: bool, aligned: bool) -> None:
        self.data = data
        self.position = 0
        self.order = "<" if little else ">"
        self.aligned = aligned
        # Values may be empty and take no bytes; their number must still end somewhere.
        self.values_left = len(data) + 10_000

    def number(self, code: str) -> Any:
        size = struct.calcsize(code)
        self._align(size)
        (value,) = struct.unpack(self.order + code, self.take(size))
        return value

    def array(self, code: str, count: int) -> Any:
        size = struct.calcsize(code)
        if count == 0:
            return np.empty(0)
        self._align(size)
        kind = np.dtype(np.bool_) if code == "?" else np.dtype(self.order + code)
        return np.frombuffer(self.take(size * count), dtype=kind)

    def take(self, count: int) -> memoryview:
        left = len(self.data) - self.position
        if count > left:
            raise UndecodableMessage(f"a field claims {count:,} bytes, {max(left, 0):,} are left")
        self.position += count
        return self.data[self.position - count : self.position]

    def text(self) -> str:
        count: int = self.number("I")
        raw = self.take(count)
        if self.aligned:  # CDR counts the closing zero
            raw = raw[:-1] if count and raw[-1] == 0 else raw
        return str(raw, "utf-8", "backslashreplace")

    def spend(self) -> None:
        self.values_left -= 1
        if self.values_left < 0:
            raise UndecodableMessage("it holds more values than bytes")

    def _align(self, size: int) -> None:
        if self.aligned:
            self.position += -self.position % size


def cdr_reader(schema: Schema, max_bytes: int) -> Callable[[bytes], Tree]:
    """Return what turns a CDR message into a tree.

    Messages that rosbag2 compressed one by one are unpacked first, to at most `max_bytes`.
    """

    def read(data: bytes) -> Tree:
        if data[:4] == _ZSTD:
            data = unpacked(data, max_bytes)
        little = _ENCAPSULATIONS.get(data[:2])
        if little is None or len(data) < 4:
            raise UndecodableMessage(f"it starts with {data[:4]!r}, which is no plain CDR")
        cursor = _Cursor(memoryview(data)[4:], little=little, aligned=True)
        return _message(cursor, schema, schema.root, 0)

    return read


def ros1_reader(schema: Schema) -> Callable[[bytes], Tree]:
    """Return what turns a ROS 1 message into a tree."""

    def read(data: bytes) -> Tree:
        cursor = _Cursor(memoryview(data), little=True, aligned=False)
        return _message(cursor, schema, schema.root, 0)

    return read


def unpacked(data: bytes, max_bytes: int) -> bytes:
    """Return a message that was compressed by itself.

    Raises:
        UndecodableMessage: it is damaged, or expands to more than `max_bytes`.
    """
    parts, size = [], 0
    try:
        with zstandard.ZstdDecompressor(max_window_size=1 << 27).stream_reader(data) as stream:
            while part := stream.read(_BLOCK):
                parts.append(part)
                size += len(part)
                if size > max_bytes:
                    raise UndecodableMessage(f"it expands to more than {max_bytes:,} bytes")
    except zstandard.ZstdError as error:
        raise UndecodableMessage(f"its compression is damaged: {error}") from error
    return b"".join(parts)


def _message(cursor: _Cursor, schema: Schema, type_name: str, depth: int) -> dict[str, Any]:
    if depth > MAX_DEPTH:
        raise UndecodableMessage(f"messages lie more than {MAX_DEPTH} deep in each other")
    cursor.spend()
    fields = schema.types[type_name]
    if not fields and cursor.aligned:  # ROS 2 gives an empty message one byte
        cursor.number("B")
    return {
        field.name: (
            _value(cursor, schema, field.type_name, depth)
            if field.length is None
            else _array(cursor, schema, field.type_name, field.length, depth)
        )
        for field in fields
    }


def _value(cursor: _Cursor, schema: Schema, type_name: str, depth: int) -> Any:
    code = _NUMBERS.get(type_name)
    if code is not None:
        return cursor.number(code)
    if type_name == "string":
        return cursor.text()
    if type_name == "time":
        return {"sec": cursor.number("I"), "nsec": cursor.number("I")}
    if type_name == "duration":
        return {"sec": cursor.number("i"), "nsec": cursor.number("i")}
    if type_name == "wstring":
        return str(cursor.take(2 * cursor.number("I")), "utf-16", "backslashreplace")
    return _message(cursor, schema, type_name, depth + 1)


def _array(cursor: _Cursor, schema: Schema, type_name: str, count: int, depth: int) -> Any:
    if count < 0:
        count = cursor.number("I")
    if type_name in _BYTES:
        return bytes(cursor.take(count))
    code = _NUMBERS.get(type_name)
    if code is not None:
        return cursor.array(code, count)
    if count > cursor.values_left:
        raise UndecodableMessage(f"an array claims {count:,} items, more than it has bytes")
    values = []
    for _ in range(count):
        cursor.spend()
        values.append(_value(cursor, schema, type_name, depth))
    return values
