"""The generated messages agree with the schema file."""

from __future__ import annotations

import re
from pathlib import Path

from schemas import stadimeter_pb2

PROTO = Path(stadimeter_pb2.__file__).with_name("stadimeter.proto").read_text(encoding="utf-8")
FIELD = re.compile(r"^\s*(optional |repeated )?([\w.]+) (\w+) = (\d+);", re.MULTILINE)
MESSAGE = re.compile(r"^message (\w+) \{(.*?)^\}", re.MULTILINE | re.DOTALL)
TYPES = {1: "double", 4: "uint64", 8: "bool", 9: "string", 13: "uint32"}


def written() -> dict[str, set[tuple[str, str, str, int]]]:
    return {
        name: {
            (label.strip(), kind, field, int(number))
            for label, kind, field, number in FIELD.findall(body)
        }
        for name, body in MESSAGE.findall(PROTO)
    }


def generated() -> dict[str, set[tuple[str, str, str, int]]]:
    found = {}
    for name, message in stadimeter_pb2.DESCRIPTOR.message_types_by_name.items():
        fields = set()
        for field in message.fields:
            is_message = field.message_type is not None
            kind = field.message_type.full_name if is_message else TYPES[field.type]
            optional = field.has_presence and field.containing_oneof is not None
            label = "repeated" if field.is_repeated else "optional" if optional else ""
            fields.add((label, kind.removeprefix("stadimeter."), field.name, field.number))
        found[name] = fields
    return found


def test_the_generated_code_is_up_to_date() -> None:
    assert written() == generated()


def test_every_scalar_of_the_exposure_is_optional() -> None:
    """Unknown is not zero."""
    fields = stadimeter_pb2.CameraExposure.DESCRIPTOR.fields
    scalars = [f for f in fields if f.message_type is None and f.name != "frame_id"]
    assert len(scalars) > 10
    assert all(field.has_presence for field in scalars)
