"""The shipped recording, decoded by nothing but the schemas that it carries."""

from __future__ import annotations

import csv
from collections import defaultdict
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest
from google.protobuf.descriptor_pb2 import FileDescriptorSet
from google.protobuf.descriptor_pool import DescriptorPool
from google.protobuf.message_factory import GetMessageClass
from mcap.reader import make_reader
from mcap.records import ChunkIndex

RECORDINGS = Path(__file__).parents[2] / "recordings"


@dataclass
class Contents:
    """Contents of an MCAP file: messages by the name of their schema."""

    messages: dict[str, list[Any]] = field(default_factory=lambda: defaultdict(list))
    log_times_ns: dict[str, list[int]] = field(default_factory=lambda: defaultdict(list))
    attachments: dict[str, bytes] = field(default_factory=dict)
    metadata: dict[str, dict[str, str]] = field(default_factory=dict)
    chunks: list[ChunkIndex] = field(default_factory=list)


def _message_class(name: str, schema: bytes) -> Any:
    pool = DescriptorPool()
    for file in FileDescriptorSet.FromString(schema).file:
        pool.Add(file)
    return GetMessageClass(pool.FindMessageTypeByName(name))


def _read(path: Path) -> Contents:
    contents, classes = Contents(), {}
    with path.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        summary = reader.get_summary()
        assert summary is not None
        contents.chunks = summary.chunk_indexes
        for schema in summary.schemas.values():
            assert schema.encoding == "protobuf"
            classes[schema.id] = _message_class(schema.name, schema.data)
        for schema, channel, message in reader.iter_messages():
            assert schema is not None
            assert channel.message_encoding == "protobuf"
            contents.messages[schema.name].append(classes[schema.id].FromString(message.data))
            contents.log_times_ns[schema.name].append(message.log_time)
        contents.attachments = {a.name: a.data for a in reader.iter_attachments()}
        contents.metadata = {m.name: m.metadata for m in reader.iter_metadata()}
    return contents


@pytest.fixture(scope="session")
def staff() -> Contents:
    return _read(RECORDINGS / "staff.mcap")


def rows_of(name: str) -> list[dict[str, str]]:
    with (RECORDINGS / "paper" / name).open(encoding="utf-8", newline="") as lines:
        return list(csv.DictReader(lines))


@pytest.fixture(scope="session")
def depth_rows() -> list[dict[str, str]]:
    return rows_of("depth_tables_3_to_7.csv")


@pytest.fixture(scope="session")
def height_rows() -> list[dict[str, str]]:
    return rows_of("height_tables_9_10.csv")


@pytest.fixture(scope="session")
def table_8() -> dict[float, float]:
    return {float(r["f_number"]): float(r["k"]) for r in rows_of("k_table_8.csv")}
