"""An export: the original byte for byte, and what was measured, as other tools read it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import duckdb
import numpy as np
import pytest
from google.protobuf.message import Message
from mcap.reader import make_reader
from mcap.writer import Writer
from mcap_protobuf.decoder import DecoderFactory

from pipeline.core.camera_row import CameraRow
from pipeline.core.config import CameraConfig, Config, Limits
from pipeline.core.diagnostics import Notes
from pipeline.core.errors import UsageError
from pipeline.export.annotations import CameraScene
from pipeline.export.recording import export_recording
from pipeline.ingest.frames import FrameAssembler
from pipeline.ingest.pose import rotation_matrix
from pipeline.mcap_file.reader import McapFile
from pipeline.messages.protobuf import tree_of
from pipeline.messages.transforms import frame_transform
from pipeline.run.recordings import run
from tests.run.test_recordings import write_people

CAMERA = CameraConfig("cam", camera_height_m=1.5, tilt_deg=0.0)


def rewritten(source: Path, target: Path) -> None:
    """Write a recording anew with what few writers make: metadata, attachments, odd channels."""
    with source.open("rb") as stream, target.open("wb") as out:
        writer = Writer(out, chunk_size=3000)
        writer.start(profile="x", library="y")
        ids: dict[int, int] = {}
        odd = writer.register_channel("/odd", "cbor", 0, {"a": "b"})
        for number, (schema, channel, message) in enumerate(make_reader(stream).iter_messages()):
            assert schema is not None
            if channel.id not in ids:
                schema_id = writer.register_schema(schema.name, schema.encoding, schema.data)
                ids[channel.id] = writer.register_channel(
                    channel.topic, channel.message_encoding, schema_id, {"number": "1"}
                )
            writer.add_message(
                ids[channel.id], message.log_time, message.data, message.log_time - 5, number
            )
            writer.add_message(odd, message.log_time, bytes([number % 256]), 7, number)
        writer.add_metadata("site", {"yard": "7"})
        writer.add_attachment(1, 2, "notes.txt", "text/plain", b"hello")
        writer.finish()


@pytest.fixture(scope="module")
def exported(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path, Path]:
    folder = tmp_path_factory.mktemp("export")
    write_people(folder / "plain.mcap")
    recording, database, target = (folder / n for n in ("people.mcap", "x.duckdb", "out.mcap"))
    rewritten(folder / "plain.mcap", recording)
    run([recording], database, Config(camera=(CAMERA,)))
    done = export_recording(recording, database, target, Limits())
    assert done.frames == 12
    assert not list(done.notes)
    return recording, database, target


def everything(path: Path, ours: bool) -> list[tuple[object, ...]]:
    with path.open("rb") as stream:
        return [
            (
                schema and (schema.name, schema.encoding, schema.data),
                (channel.topic, channel.message_encoding, dict(channel.metadata)),
                (message.log_time, message.publish_time, message.sequence, message.data),
            )
            for schema, channel, message in make_reader(stream).iter_messages(log_time_order=False)
            if ours == channel.topic.startswith("/stadimeter/")
        ]


def test_the_original_is_there_byte_for_byte(exported: tuple[Path, Path, Path]) -> None:
    recording, _, target = exported
    assert everything(target, ours=False) == everything(recording, ours=False)
    with target.open("rb") as stream:
        reader = make_reader(stream)
        assert [(m.name, m.metadata) for m in reader.iter_metadata()] == [("site", {"yard": "7"})]
        (attachment,) = reader.iter_attachments()
        assert (attachment.name, attachment.data, attachment.log_time) == ("notes.txt", b"hello", 2)


def decoded(path: Path, topic: str) -> list[Message]:
    with path.open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        return [item.decoded_message for item in reader.iter_decoded_messages([topic])]


def test_what_was_measured_is_there_for_every_frame(exported: tuple[Path, Path, Path]) -> None:
    _, database, target = exported
    with duckdb.connect(str(database), read_only=True) as connection:
        rows = connection.sql(
            "SELECT frame_index, depth_m, height_m, x_m, y_m FROM current_estimates "
            "WHERE method = 'fused' ORDER BY frame_index, observation_index"
        ).fetchall()
    estimates = decoded(target, "/stadimeter/cam/estimates")
    assert [m.frame_index for m in estimates] == list(range(12))
    found = [
        (m.frame_index, o.depth_m, o.height_m, o.x_m, o.y_m) for m in estimates for o in m.objects
    ]
    assert found == rows
    boxes = decoded(target, "/stadimeter/cam/boxes")
    for message, drawn in zip(estimates, boxes, strict=True):
        assert len(drawn.points) == len(message.objects) == len(drawn.texts)
        corner = drawn.points[0].points[2]
        assert corner.x == message.objects[0].box.x_max_px + 0.5
        assert f"{message.objects[0].depth_m:.1f} ±" in drawn.texts[0].text
    scene = decoded(target, "/stadimeter/cam/scene")
    entity = scene[0].entities[0]
    assert entity.frame_id == "stadimeter/cam/ground"
    assert entity.cubes[0].pose.position.y == estimates[0].objects[0].y_m


def test_the_results_are_no_evidence_when_an_export_is_read(
    exported: tuple[Path, Path, Path],
) -> None:
    recording, _, target = exported
    for path in (recording, target):
        notes = Notes()
        file = McapFile(path, Limits(), notes.add)
        assembler = FrameAssembler(file, Config().ingest, notes)
        detections = [f.detections for f in assembler]
        assert len(detections) == 12
        assert not assembler.poses


@pytest.mark.parametrize(("tilt_deg", "roll_deg"), [(0, 0), (35, 0), (20, 8), (-5, -12)])
def test_the_ground_is_where_the_pose_says(tilt_deg: float, roll_deg: float) -> None:
    tilt, roll = np.radians([tilt_deg, roll_deg])
    pose = {"camera_height_m": 3.0, "tilt_rad": float(tilt), "roll_rad": float(roll)}
    scene = CameraScene(replace(CameraRow("c", frame_id="optical"), **pose))
    message = scene.ground(10**18)
    assert message is not None
    (moved,) = frame_transform(tree_of(message)).payload
    assert (moved.parent, moved.child) == ("optical", "stadimeter/c/ground")
    turn = rotation_matrix(moved.rotation_xyzw)
    axis_on_ground = turn.T @ np.array([0.0, 0.0, 1.0])
    assert np.degrees(np.arcsin(-axis_on_ground[2])) == pytest.approx(tilt_deg)
    assert axis_on_ground[0] == pytest.approx(0, abs=1e-12)  # ahead is where the camera looks
    assert axis_on_ground[1] > 0
    camera_above_ground = turn.T @ (-np.array(moved.translation_m))
    assert camera_above_ground == pytest.approx([0, 0, 3.0], abs=1e-12)
    right = turn.T @ np.array([1.0, 0.0, 0.0])
    assert np.degrees(np.arcsin(-right[2])) == pytest.approx(
        np.degrees(np.arcsin(np.sin(roll) * np.cos(tilt)))
    )


def test_what_is_not_in_the_database_is_said_to_be_not(
    exported: tuple[Path, Path, Path], tmp_path: Path
) -> None:
    recording, database, _ = exported
    with pytest.raises(UsageError, match="no such file"):
        export_recording(tmp_path / "a.mcap", database, tmp_path / "o.mcap", Limits())
    with pytest.raises(UsageError, match="overwrite"):
        export_recording(recording, database, recording, Limits())
    other = tmp_path / "other.mcap"
    data = recording.read_bytes()
    other.write_bytes(data[:-40] + bytes([data[-40] ^ 1]) + data[-39:])  # same size, other content
    with pytest.raises(UsageError, match="same size"):
        export_recording(other, database, tmp_path / "o.mcap", Limits())
    assert not (tmp_path / "o.mcap").exists()
