"""A message as a dictionary, and accessors that take nothing on trust.

Nested messages are dictionaries, arrays are lists (or arrays of numpy), what is absent is unknown.
A time is `{sec, nsec}` in foxglove's JSON and ROS 2's `{sec, nanosec}`; ROS 1 and protobuf are
brought to the first.
"""

from __future__ import annotations

import base64
import binascii
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from pipeline.core.arrays import NAN

Tree = Mapping[str, Any]

# Boxes, coefficients, hypotheses, transforms: a message that holds more of one is no such message.
MAX_ITEMS = 100_000
_MAX_TEXT = 65_536


class UndecodableMessage(ValueError):
    """The bytes are not what the channel's schema says."""


def child(tree: Tree, name: str) -> Tree:
    """Return a nested message; an empty one where there is none."""
    value = tree.get(name)
    return value if isinstance(value, Mapping) else {}


def children(tree: Tree, name: str) -> list[Tree]:
    """Return nested messages.

    Raises:
        UndecodableMessage: there are absurdly many.
    """
    return [v for v in _items(tree, name) if isinstance(v, Mapping)]


def number(tree: Tree, name: str, default: float = NAN) -> float:
    """Return a number; `default` where it is absent or none."""
    value = tree.get(name)
    return default if value is None else as_number(value, default)


def as_number(value: object, default: float = NAN) -> float:
    """Return a value as a number; texts such as "NaN" and "12" are what some JSON writers make."""
    if isinstance(value, bool) or not isinstance(value, int | float | str | np.number):
        return default
    try:
        return float(value)
    except (ValueError, OverflowError):
        return default


def whole(tree: Tree, name: str, default: int = 0) -> int:
    """Return a whole number; `default` where it is absent or none."""
    value = number(tree, name, float(default))
    return int(value) if math.isfinite(value) else default


def numbers(tree: Tree, *names: str) -> list[float]:
    """Return an array of numbers, under the first of its names that is there."""
    for name in names:
        if name in tree:
            return [as_number(v) for v in _items(tree, name)]
    return []


def text(tree: Tree, name: str) -> str:
    """Return a text; empty where there is none. Numbers are written out."""
    value = tree.get(name)
    if isinstance(value, str):
        return value[:_MAX_TEXT]
    return str(value) if isinstance(value, int) and not isinstance(value, bool) else ""


def blob(tree: Tree, name: str) -> bytes:
    """Return bytes: as they are, or from base64 or an array of numbers, as JSON holds them.

    Raises:
        UndecodableMessage: it is none of these.
    """
    value = tree.get(name, b"")
    if isinstance(value, bytes):
        return value
    try:
        if isinstance(value, str):
            return base64.b64decode(value, validate=True)
        if isinstance(value, Sequence):
            return bytes(value)
    except (binascii.Error, ValueError, TypeError) as error:
        raise UndecodableMessage(f"{name} is neither base64 nor an array of bytes") from error
    raise UndecodableMessage(f"{name} holds no bytes")


def time_of(tree: Tree) -> int | None:
    """Return a message's own time in nanoseconds since 1970; None where it states none."""
    for value in (tree.get("timestamp"), child(tree, "header").get("stamp")):
        time_ns = as_time_ns(value)
        if time_ns is not None:
            return time_ns
    return None


def as_time_ns(value: object) -> int | None:
    """Return a time in nanoseconds, even an impossible one; 0 is how most encodings leave it out."""
    if not isinstance(value, Mapping):
        return None
    seconds = value.get("sec", value.get("seconds", value.get("secs", 0)))
    nanos = value.get("nsec", value.get("nanosec", value.get("nanos", value.get("nsecs", 0))))
    if not isinstance(seconds, int) or not isinstance(nanos, int):
        return None
    return seconds * 1_000_000_000 + nanos or None


def frame_id_of(tree: Tree) -> str:
    """Return the camera that a message speaks of; ROS 1 names may start with a slash."""
    return (text(tree, "frame_id") or text(child(tree, "header"), "frame_id")).removeprefix("/")


def _items(tree: Tree, name: str) -> list[Any]:
    value = tree.get(name)
    if isinstance(value, np.ndarray):
        value = value[: MAX_ITEMS + 1].tolist()
    if not isinstance(value, list | tuple | bytes):
        return []
    if len(value) > MAX_ITEMS:
        raise UndecodableMessage(f"{name} has more than {MAX_ITEMS:,} items")
    return list(value)
