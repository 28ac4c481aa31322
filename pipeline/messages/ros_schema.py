"""ROS' message definitions, as they stand in the file: text -> fields.

The text of a type is followed by those of the types that it uses, each under a line `MSG: pkg/Name`
behind a line of equals signs. ROS 1 and ROS 2 share the form. Names are kept as `pkg/Name`.

Source: the definitions of `.msg` files in the documentation of ROS 1 and ROS 2, and the `ros1msg`
and `ros2msg` schemas of the MCAP format's registry.
"""

from __future__ import annotations

import re
from typing import NamedTuple

from pipeline.messages.tree import UndecodableMessage

MAX_FIELDS = 20_000  # of all types of a schema; a full robot state has some hundred
_SEPARATOR = re.compile(r"^={8,}\s*$", re.MULTILINE)
_FIELD = re.compile(
    r"^(?P<type>[A-Za-z][\w/]*)(?:<=\d+)?"
    r"(?P<array>\[(?:<=)?(?P<count>\d*)\])?"
    r"\s+(?P<name>[A-Za-z]\w*)\s*(?P<rest>.*)$"
)

PRIMITIVES = frozenset(
    ("bool byte char int8 uint8 int16 uint16 int32 uint32 int64 uint64 float32 float64 ")
    .strip()
    .split()
) | {"string", "wstring", "time", "duration"}


class Field(NamedTuple):
    """One field; `length` is None for a single value, -1 for an array of any length."""

    name: str
    type_name: str
    length: int | None


class Schema(NamedTuple):
    """The types of a message, by name."""

    root: str
    types: dict[str, tuple[Field, ...]]


def short_name(name: str) -> str:
    """Return a type's name without the folder that ROS 2 puts in it: pkg/msg/Name -> pkg/Name."""
    parts = name.replace("::", "/").split("/")
    return f"{parts[0]}/{parts[-1]}" if len(parts) > 1 else name


def parse(root: str, definition: str, *, ros1: bool) -> Schema:
    """Return the types of a definition.

    Raises:
        UndecodableMessage: a line is no field, a type is missing, or there are too many fields.
    """
    root = short_name(root)
    types: dict[str, tuple[Field, ...]] = {}
    fields_left = MAX_FIELDS
    for index, part in enumerate(_SEPARATOR.split(definition)):
        name, body = root, part
        if index:
            head, _, body = part.lstrip().partition("\n")
            if not head.startswith("MSG:"):
                raise UndecodableMessage(f"the schema of {root!r} has a part without a name")
            name = short_name(head.removeprefix("MSG:").strip())
        types[name] = tuple(_fields(name, body))
        fields_left -= len(types[name]) + 1
        if fields_left < 0:
            raise UndecodableMessage(f"the schema of {root!r} has more than {MAX_FIELDS:,} fields")
    for name, builtin in _builtin(ros1).items():
        types.setdefault(name, builtin)
    _check_complete(root, types)
    return Schema(root, types)


def _fields(owner: str, body: str) -> list[Field]:
    fields = []
    for line in body.splitlines():
        # A comment may follow, except in the text of a string constant, which is no field anyway.
        line = line.partition("#")[0].strip()
        if not line:
            continue
        match = _FIELD.match(line)
        if match is None:
            raise UndecodableMessage(f"{owner}: {line[:80]!r} is no field")
        if match["rest"].startswith("="):  # a constant
            continue
        length = None if match["array"] is None else -1
        if match["count"] and "<=" not in match["array"]:
            length = int(match["count"][:12])
        fields.append(Field(match["name"], _resolved(owner, match["type"]), length))
    return fields


def _resolved(owner: str, type_name: str) -> str:
    if type_name in PRIMITIVES:
        return type_name
    if "/" in type_name:
        return short_name(type_name)
    if type_name == "Header":
        return "std_msgs/Header"
    return f"{owner.split('/')[0]}/{type_name}"


def _builtin(ros1: bool) -> dict[str, tuple[Field, ...]]:
    """Return types that some writers take for granted."""
    stamp = "time" if ros1 else "builtin_interfaces/Time"
    header = (Field("stamp", stamp, None), Field("frame_id", "string", None))
    pair = (Field("sec", "int32", None), Field("nanosec", "uint32", None))
    return {
        "std_msgs/Header": ((Field("seq", "uint32", None), *header) if ros1 else header),
        "builtin_interfaces/Time": pair,
        "builtin_interfaces/Duration": pair,
    }


def _check_complete(root: str, types: dict[str, tuple[Field, ...]]) -> None:
    """Raise if a type that the root uses, at any depth, is not there."""
    seen, waiting = {root}, [root]
    while waiting:
        for field in types[waiting.pop()]:
            name = field.type_name
            if name in PRIMITIVES or name in seen:
                continue
            if name not in types:
                raise UndecodableMessage(f"the schema of {root!r} lacks the type {name!r}")
            seen.add(name)
            waiting.append(name)
