"""Recordings made to do harm, through the commands: names that are code, files that are bombs."""

from __future__ import annotations

import ast
import re
import struct
import time
from html.parser import HTMLParser
from pathlib import Path

import duckdb
import pytest
from google.protobuf.descriptor_pb2 import FileDescriptorSet
from mcap.opcode import Opcode
from mcap.writer import Writer
from rerun.chunk import RrdReader

from pipeline.core.config import Limits
from pipeline.core.records import Intrinsics
from pipeline.mcap_file.reader import ChannelInfo
from pipeline.mcap_file.writer import (
    RecordingWriter,
    calibration_message,
    image_message,
    timestamp,
)
from pipeline.messages.protobuf import class_in_schema
from pipeline.messages.registry import FAMILIES, decoder_of, reader_of
from pipeline.messages.tree import UndecodableMessage
from pipeline.store.connection import connect
from pipeline.store.database import Store
from schemas.stadimeter_pb2 import Detections, GroundTruth
from tests.cli.test_commands import ROOT, stadimeter
from tests.mcap_file.test_damage import codes, read
from tests.run.test_recordings import jpeg
from tests.support.damage import MAGIC, record

START_NS = 1_700_000_000_000_000_000
# SQL, a terminal's escapes, rich's markup, HTML, Jinja, a path, an entity path, shell, a direction
# override, a NUL, what no font has, and a word by which to find it again.
EVIL = (
    "EVIL'; DROP TABLE frames; --\x1b[2J\x1b]0;title\x07[red]x[/red]</script><img src=x onerror=1>"
    '{{7*7}}../../../tmp/evil/a:b!c"`$(id)`\u202e\0\x9b1m\U0010ffff\n'
)


class Elements(HTMLParser):
    """The elements of a page."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.found: list[str] = []
        self.feed(page)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.found.append(tag)
        assert not any(name.startswith("on") for name, _ in attrs), (tag, attrs)


def write_evil(path: Path) -> None:
    with RecordingWriter(path, library=EVIL) as writer:
        for index in range(8):
            time_ns = START_NS + index * 100_000_000
            writer.write(f"/{EVIL}/i", image_message(jpeg(), EVIL, time_ns, EVIL), time_ns)
            lens = Intrinsics(320, 240, 400.0, 400.0, 159.5, 119.5, EVIL, (0.1, 0.2))
            writer.write(f"/{EVIL}/c", calibration_message(lens, time_ns, EVIL), time_ns)
            found = Detections(timestamp=timestamp(time_ns), frame_id=EVIL, detector=EVIL)
            truth = GroundTruth(timestamp=timestamp(time_ns), frame_id=EVIL)
            box = {"x_min_px": 100, "x_max_px": 120, "y_min_px": 100, "y_max_px": 180}
            found.objects.add(box=box, class_name=EVIL, object_id=EVIL)
            truth.objects.add(box=box, class_name=EVIL, object_id=EVIL, depth_m=10, height_m=1.7)
            truth.objects.add(class_name=EVIL, object_id=EVIL, depth_m=-1)
            writer.write(f"/{EVIL}/d", found, time_ns)
            writer.write(f"/{EVIL}/t", truth, time_ns)
        writer.add_metadata(EVIL, {EVIL: EVIL})
        writer.add_attachment(EVIL, EVIL, b"x" * 50, START_NS)


def safe_text(text: str) -> None:
    assert "Traceback" not in text
    assert all(c == "\n" or c.isprintable() for c in text), ascii(text)


def test_names_from_a_file_are_only_ever_data(tmp_path: Path) -> None:
    folder = tmp_path / "work"
    folder.mkdir()
    (folder / "camera.toml").write_text("")
    name = "[red]$(id)'\x1b[31m<b>.mcap"
    write_evil(folder / name)
    data = (folder / name).read_bytes()
    # a damaged attachment and a message that is none: their names come into diagnostics
    at = data.rindex(b"x" * 50)
    (folder / name).write_bytes(data[:at] + b"y" + data[at + 1 :])
    commands = (
        ("run", name, "--db", "x.duckdb", "--rrd", "rrd"),
        ("inspect", name),
        ("query", "--db", "x.duckdb", "--view", "observations"),
        ("query", "--db", "x.duckdb", "--view", "diagnostics"),
        ("query", "--db", "x.duckdb", "--view", EVIL.replace("\0", "")),
        ("estimate", "--db", "x.duckdb", "--label", EVIL.replace("\0", "")),
        ("report", "--db", "x.duckdb", "-o", "x.html"),
    )
    found = [stadimeter(*command, cwd=folder) for command in commands]
    for done in found:
        safe_text(done.stdout + done.stderr)
    assert [done.returncode for done in found] == [3, 3, 0, 0, 2, 0, 0], found
    assert "EVIL" in found[1].stdout

    with Store.open(folder / "x.duckdb", read_only=True) as store:
        rows = store.query("SELECT DISTINCT camera, class_name, object_id FROM observations")
        notes = store.query("SELECT code FROM diagnostics")["code"].to_pylist()
    assert [set(row.values()) for row in rows.to_pylist()] == [{EVIL}]
    assert "damaged_attachment" in notes

    elements = Elements((folder / "x.html").read_text(encoding="utf-8")).found
    assert "img" not in elements
    assert elements.count("body") == 1

    rrd = next((folder / "rrd").glob("*.rrd"))
    paths = {str(c.entity_path) for c in RrdReader(rrd).stream().to_chunks()}
    cameras = {re.split(r"(?<!\\)/", path)[2] for path in paths if path.startswith("/cameras/")}
    assert len(cameras) == 1, "the name of the camera is one part of the path"
    assert all(c.isprintable() for path in paths for c in path)

    expected = {name, "camera.toml", "x.duckdb", "x.html", "rrd"}
    assert {p.name for p in folder.iterdir()} == expected
    assert {p.parent for p in tmp_path.rglob("*") if p.is_file()} == {folder, folder / "rrd"}


def _channels(count: int, schema: str) -> bytes:
    name = schema.encode()
    body = struct.pack("<HI", 1, len(name)) + name + struct.pack("<I", 8) + b"protobuf"
    parts = [MAGIC, record(Opcode.SCHEMA, body + bytes(4))]
    image = image_message(b"x", "jpeg", START_NS, "").SerializeToString()
    for number in range(count):
        topic = f"/{number}".encode()
        body = struct.pack("<HHI", number, 1, len(topic)) + topic
        body += struct.pack("<I", 8) + b"protobuf" + bytes(4)
        parts.append(record(Opcode.CHANNEL, body))
        body = struct.pack("<HIQQ", number, 0, START_NS + number, 0) + image
        parts.append(record(Opcode.MESSAGE, body))
    return b"".join(parts)


def test_a_file_of_65535_cameras_makes_a_bounded_number_of_them(tmp_path: Path) -> None:
    data = _channels(65_535, "foxglove.CompressedImage")
    frames, notes, lost = read(data, tmp_path)
    assert frames == Limits().cameras
    assert codes(notes) >= {"too_many_cameras", "damaged_record", "unknown_channel"}
    assert len(notes) < 10_000
    assert frames + lost == Limits().channels


def test_endless_frame_ids_make_a_bounded_number_of_sources(tmp_path: Path) -> None:
    path = tmp_path / "x.mcap"
    with RecordingWriter(path) as writer:
        for number in range(3000):
            found = Detections(timestamp=timestamp(START_NS + number), frame_id=f"f{number}")
            writer.write("/d", found, START_NS + number)
    _, notes, _ = read(path.read_bytes(), tmp_path)
    assert codes(notes) == {"too_many_sources"}


def test_a_giant_map_of_metadata_is_refused(tmp_path: Path) -> None:
    pairs = b"".join(
        struct.pack("<I", 4) + struct.pack("<I", n) + struct.pack("<I", 0) for n in range(200_000)
    )
    body = struct.pack("<I", 1) + b"m" + struct.pack("<I", len(pairs)) + pairs
    _, notes, _ = read(MAGIC + record(Opcode.METADATA, body), tmp_path)
    assert "damaged_record" in codes(notes)


def _million_fields() -> bytes:
    files = FileDescriptorSet()
    message = files.file.add(name="x.proto", package="x").message_type.add(name="X")
    for number in range(1, 1_000_001):
        message.field.add(name=f"f{number}", number=number, type=1, label=1)
    return files.SerializeToString()


def test_a_schema_of_a_million_fields_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "x.mcap"
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        schema = writer.register_schema("x.X", "protobuf", _million_fields())
        writer.add_message(writer.register_channel("/x", "protobuf", schema), 5, b"", 5)
        text = "\n".join(f"float64 f{n}" for n in range(1_000_000)).encode()
        schema = writer.register_schema("sensor_msgs/msg/Image", "ros2msg", text)
        writer.add_message(writer.register_channel("/y", "cdr", schema), 5, b"", 5)
        writer.finish()
    frames, notes, _ = read(path.read_bytes(), tmp_path)
    assert frames == 0
    assert "damaged_record" in codes(notes)


def test_nesting_without_end_is_no_message() -> None:
    files = FileDescriptorSet()
    node = files.file.add(name="n.proto", package="foxglove").message_type.add(name="RawImage_")
    node.field.add(name="child", number=1, type=11, label=1, type_name=".foxglove.RawImage_")
    deep = b""
    for _ in range(3000):
        deep = b"\x0a" + _varint(len(deep)) + deep
    recursive = ChannelInfo(
        "/t", "protobuf", "foxglove.RawImage_", "protobuf", files.SerializeToString()
    )
    reader = reader_of(recursive, 10**6)
    assert reader is not None
    with pytest.raises(UndecodableMessage):
        reader(deep)


@pytest.mark.parametrize("name", [*FAMILIES])
@pytest.mark.parametrize("opening", [b'{"a":', b"["])
def test_json_nested_without_end_is_no_message(name: str, opening: bytes) -> None:
    decoder = decoder_of(ChannelInfo("/t", "json", name, "jsonschema"), 10**6)
    assert decoder is not None
    with pytest.raises(UndecodableMessage):
        decoder(opening * 100_000)


def test_a_ros_type_that_holds_itself_is_refused() -> None:
    channel = ChannelInfo("/t", "cdr", "sensor_msgs/msg/Image", "ros2msg", b"Image inner\nbyte b")
    try:
        decoder = decoder_of(channel, 10**6)
    except UndecodableMessage:
        return
    assert decoder is not None
    with pytest.raises(UndecodableMessage):
        decoder(bytes(10_000))


def test_a_long_chain_of_schema_files_takes_no_time(tmp_path: Path) -> None:
    files = FileDescriptorSet()
    count = 20_000
    for number in range(count):
        file = files.file.add(name=f"{number}")
        if number + 1 < count:
            file.dependency.append(f"{number + 1}")
    started = time.process_time()
    with pytest.raises(UndecodableMessage):
        class_in_schema("x.X", files.SerializeToString())
    assert time.process_time() - started < 10


def _varint(value: int) -> bytes:
    out = b""
    while value > 127:
        out, value = out + bytes([value & 127 | 128]), value >> 7
    return out + bytes([value])


def test_a_message_of_empty_objects_cannot_fill_the_memory(tmp_path: Path) -> None:
    path = tmp_path / "x.mcap"
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        schema = writer.register_schema("stadimeter.Detections", "protobuf", b"")
        channel = writer.register_channel("/d", "protobuf", schema)
        writer.add_message(channel, START_NS, b"\x22\x00" * 12_000_000, START_NS)
        writer.finish()
    _, notes, _ = read(path.read_bytes(), tmp_path)
    assert codes(notes) == {"oversized_message"}


# No network, no pickle, no eval

SOURCES = sorted(
    path
    for folder in ("pipeline", "dashboards", "schemas")
    for path in (ROOT / folder).rglob("*.py")
)
FORBIDDEN_MODULES = re.compile(
    r"(pickle|marshal|shelve|dill|cloudpickle|socket|ssl|http|urllib\.request|ftplib|smtplib|"
    r"requests|httpx|aiohttp|xmlrpc|telnetlib|webbrowser|code|codeop|runpy)(\.|$)"
)
FORBIDDEN_CALLS = frozenset(("eval", "exec", "compile", "__import__"))
# A viewer on this machine is reached by its port, and a cluster by the address that the user gives;
# nothing of either comes from a recording.
BY_ADDRESS = frozenset(
    {
        "dashboards/review/viewer.py",
        "dashboards/for_docs/screenshot.py",
        "pipeline/cluster/engine.py",
    }
)


@pytest.mark.parametrize("path", SOURCES, ids=lambda p: str(p.relative_to(ROOT)))
def test_no_network_no_pickle_no_eval(path: Path) -> None:
    name = str(path.relative_to(ROOT))
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        modules: list[str] = []
        if isinstance(node, ast.Import):
            modules = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            modules = [node.module or ""]
        for module in modules:
            if not (name in BY_ADDRESS and module == "socket"):
                assert not FORBIDDEN_MODULES.match(module), f"{name}:{node.lineno}"
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
            assert node.func.id not in FORBIDDEN_CALLS, f"{name}:{node.lineno}"
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
            keywords = {k.arg: k.value for k in node.keywords}
            shell = keywords.get("shell")
            assert shell is None or getattr(shell, "value", True) is False, f"{name}:{node.lineno}"
            allowed = keywords.get("allow_pickle")
            assert allowed is None or getattr(allowed, "value", True) is False, name


@pytest.mark.parametrize("read_only", [False, True])
def test_no_connection_installs_loads_or_reaches_anything(read_only: bool, tmp_path: Path) -> None:
    database = tmp_path / "x.duckdb"
    with Store.open(database):
        pass
    connection = connect(database, read_only=read_only)
    settings = dict(
        connection.execute(
            "SELECT name, value FROM duckdb_settings() WHERE name IN ('autoinstall_known_extensions',"
            "'autoload_known_extensions', 'enable_external_access', 'lock_configuration')"
        ).fetchall()
    )
    assert settings == {
        "autoinstall_known_extensions": "false",
        "autoload_known_extensions": "false",
        "enable_external_access": "false",
        "lock_configuration": "true",
    }
    for statement in (
        "INSTALL httpfs",
        "LOAD httpfs",
        "FROM 'https://example.org/x.parquet'",
        f"COPY (SELECT 1) TO '{tmp_path}/stolen.csv'",
        "FROM read_text('/etc/passwd')",
        f"ATTACH '{tmp_path}/other.duckdb'",
        "SET enable_external_access = true",
    ):
        with pytest.raises(duckdb.Error):
            connection.execute(statement)
    connection.close()
    assert [p.name for p in tmp_path.iterdir()] == ["x.duckdb"]
