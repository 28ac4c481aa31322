"""Protobuf: messages of known types by their own classes, any other by the schema in the file."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache
from graphlib import CycleError, TopologicalSorter
from importlib import import_module
from typing import Any

from google.protobuf.descriptor_pb2 import FileDescriptorSet
from google.protobuf.descriptor_pool import DescriptorPool
from google.protobuf.message import DecodeError, Message
from google.protobuf.message_factory import GetMessageClass

from pipeline.messages.tree import Tree, UndecodableMessage
from schemas import stadimeter_pb2

_TIMES = frozenset({"google.protobuf.Timestamp", "google.protobuf.Duration"})


@cache
def known_class(full_name: str) -> type[Message] | None:
    """Return the class of one of Foxglove's messages or ours."""
    package, _, name = full_name.rpartition(".")
    if not name.isidentifier():
        return None
    if package == "stadimeter":
        return getattr(stadimeter_pb2, name, None)
    if package == "foxglove":
        try:
            module = import_module(f"foxglove_schemas_protobuf.{name}_pb2")
        except ImportError:
            return None
        return getattr(module, name, None)
    return None


def class_in_schema(full_name: str, schema: bytes) -> type[Message]:
    """Return a message class by the descriptors in a file.

    Raises:
        UndecodableMessage: the schema does not hold together.
    """
    pool = DescriptorPool()
    try:
        files = {file.name: file for file in FileDescriptorSet.FromString(schema).file}
        graph = {name: [d for d in file.dependency if d in files] for name, file in files.items()}
        for name in TopologicalSorter(graph).static_order():
            pool.Add(files[name])
        return GetMessageClass(pool.FindMessageTypeByName(full_name))
    except CycleError as error:
        raise UndecodableMessage("the schema's files depend on each other in a circle") from error
    except (DecodeError, KeyError, TypeError, ValueError, RecursionError) as error:
        raise UndecodableMessage(f"the schema of {full_name!r} cannot be used: {error}") from error


def reader(kind: type[Message]) -> Callable[[bytes], Tree]:
    """Return what turns the bytes of a message of this type into a tree."""

    def read(data: bytes) -> Tree:
        try:
            return tree_of(kind.FromString(data))
        except (DecodeError, UnicodeDecodeError, RecursionError) as error:
            raise UndecodableMessage(str(error) or "not a protobuf message") from error

    return read


def tree_of(message: Message) -> dict[str, Any]:
    """Return the fields that a message states."""
    tree: dict[str, Any] = {}
    for field, value in message.ListFields():
        if field.message_type is None:
            tree[field.name] = list(value) if field.is_repeated else value
        elif isinstance(value, Mapping):  # a protobuf map: nothing here has any
            continue
        elif field.is_repeated:
            tree[field.name] = [tree_of(v) for v in value]
        elif field.message_type.full_name in _TIMES:
            tree[field.name] = {"sec": value.seconds, "nsec": value.nanos}
        else:
            tree[field.name] = tree_of(value)
    return tree


def bytes_field(message: memoryview, number: int) -> memoryview:
    """Return a field of bytes where it stands in a message, empty if there is none.

    The other fields are passed over (Protocol Buffers, "Encoding": tags, varints, lengths), and the
    large one is not copied.

    Raises:
        UndecodableMessage: the bytes are no message, or hold a group.
    """
    at, end, found = 0, len(message), message[:0]
    try:
        while at < end:
            tag, at = _varint(message, at)
            kind = tag & 7
            if kind == _BYTES:
                length, at = _varint(message, at)
                if tag >> 3 == number:
                    found = message[at : at + length]
                at += length
            elif kind == _VARINT:
                _, at = _varint(message, at)
            else:
                at += _FIXED[kind]
    except (IndexError, KeyError) as error:
        raise UndecodableMessage("not a protobuf message") from error
    if at > end:
        raise UndecodableMessage("a protobuf message that is cut off")
    return found


_VARINT, _BYTES = 0, 2
_FIXED = {1: 8, 5: 4}  # bytes of numbers of a fixed size


def _varint(message: memoryview, at: int) -> tuple[int, int]:
    """Return a number and where the next field begins."""
    value, shift = 0, 0
    while True:
        byte = message[at]
        at += 1
        value |= (byte & 0x7F) << shift
        if byte < 0x80:
            return value, at
        shift += 7
