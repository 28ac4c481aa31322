"""Review: recordings found, parts shown, the opening moment, and access to the viewer."""

from __future__ import annotations

import shlex
import shutil
import time
from contextlib import suppress
from dataclasses import replace
from itertools import repeat
from pathlib import Path
from typing import Any

import pytest

import dashboards.timeline.writer
from dashboards.for_docs.screenshot import Viewer
from dashboards.review.review import Review, find_recording, go_to_moment, write_review
from dashboards.review.viewer import no_driver, started
from dashboards.timeline.source import Span, pictures, read_source, read_tables
from dashboards.timeline.split import spans_of
from dashboards.timeline.stills import media_type, preview
from dashboards.timeline.stream import ELAPSED, FRAME, TIME
from dashboards.timeline.writer import write_timeline
from pipeline.cli import main
from pipeline.core.config import Config, TimelineConfig
from pipeline.core.errors import StadimeterError, UsageError
from pipeline.images.header import image_size
from pipeline.run.recordings import run
from pipeline.store.database import Store
from tests.dashboards.timeline.test_writer import column, entities
from tests.run.test_recordings import CAMERA, LEVEL, START_NS, jpeg, write_people

STEP_NS = 100_000_000
LOOPBACK_HEX = "0100007F"  # 127.0.0.1, as /proc has it


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("review")
    write_people(folder / "people.mcap", frames=40)
    write_people(folder / "it's.mcap", frames=12)
    run([folder / "people.mcap", folder / "it's.mcap"], folder / "x.duckdb", LEVEL)
    return folder


@pytest.fixture
def store(folder: Path) -> Any:
    with Store.open(folder / "x.duckdb", read_only=True) as store:
        yield store


def test_a_recording_is_found_by_file_name_or_id(folder: Path, store: Store) -> None:
    row = find_recording(store, str(folder / "people.mcap"))
    for name in ("people.mcap", "people", row["recording_id"]):
        assert find_recording(store, name)["recording_id"] == row["recording_id"]
    with pytest.raises(UsageError, match=r"no recording 'nobody.mcap'.*people\.mcap"):
        find_recording(store, "nobody.mcap")


def test_another_file_of_the_same_name_is_refused(tmp_path: Path, store: Store) -> None:
    (tmp_path / "people.mcap").write_bytes(b"not it")
    with pytest.raises(UsageError, match="not the file that was measured"):
        find_recording(store, str(tmp_path / "people.mcap"))


def test_a_track_has_its_frames_and_the_plots_for_itself(store: Store, tmp_path: Path) -> None:
    written = write_review(store, Review(["people"], track=1), tmp_path / "t.rrd", Config())
    assert written.moment_ns == START_NS + 19 * STEP_NS
    curves = entities(tmp_path / "t.rrd")["/cameras/cam/depth/ground"]
    assert column(curves, "Measurements:names") == [["#1", "#0"]]
    truth = entities(tmp_path / "t.rrd")["/cameras/cam/depth/truth"]
    assert len(column(truth, "SeriesLines:names")[0]) == 1  # that of the track, not of both


def test_of_a_long_recording_a_stretch_is_shown(store: Store, tmp_path: Path) -> None:
    config = Config(timeline=TimelineConfig(split_s=1.0))
    written = write_review(store, Review(["people"]), tmp_path / "a.rrd", config)
    pictures = entities(tmp_path / "a.rrd")["/cameras/cam/camera/image"]
    assert len(column(pictures, "EncodedImage:blob")) == 11
    assert "of 0.0 hours" in written.remarks[0]


@pytest.mark.parametrize("at", ["#7", "0.7", "2023-11-14T22:13:20.7Z"])
def test_a_moment_is_found_however_it_is_written(at: str, store: Store, tmp_path: Path) -> None:
    written = write_review(store, Review(["people"], at=at), tmp_path / "a.rrd", Config())
    assert written.moment_ns == START_NS + 7 * STEP_NS


@pytest.mark.parametrize(
    ("review", "message"),
    [
        (Review(["people"], at="99"), "outside people.mcap"),
        (Review(["people"], at="#99"), "no frame #99"),
        (Review(["people"], track=77), "no track 77"),
        (Review(["people"], track=0, camera="nowhere"), "no track 0"),
        (Review(["people", "it's"], track=0), "exactly one recording"),
    ],
)
def test_what_is_not_there_is_said(
    review: Review, message: str, store: Store, tmp_path: Path
) -> None:
    with pytest.raises(UsageError, match=message):
        write_review(store, review, tmp_path / "a.rrd", Config())
    assert not list(tmp_path.iterdir())


def test_several_recordings_share_a_clock(store: Store, tmp_path: Path) -> None:
    written = write_review(store, Review(["people", "it's"]), tmp_path / "a.rrd", Config())
    assert written.clock == TIME  # they were recorded at the same time
    found = entities(tmp_path / "a.rrd")
    images = [e for e in found if e.endswith("/camera/image")]
    assert len(images) == 2
    for entity in images:
        names = {name for batch in found[entity] for name in batch.schema.names}
        assert {FRAME, TIME, ELAPSED} <= names


def test_the_worst_errors_name_the_command_that_shows_them(folder: Path, tmp_path: Path) -> None:
    run([folder / "it's.mcap"], tmp_path / "x.duckdb", LEVEL)
    with Store.open(tmp_path / "x.duckdb", read_only=True) as store:
        follow_the_worst(store, tmp_path)


def follow_the_worst(store: Store, tmp_path: Path) -> None:
    rows = store.query("SELECT * FROM accuracy.worst WHERE file_name = 'it''s.mcap'").to_pylist()
    words = shlex.split(rows[0]["review_command"])
    assert words[:2] == ["stadimeter", "review"]
    assert words[words.index("--db") + 1] == str(store.path)
    target = tmp_path / "worst.rrd"
    store.connection.close()  # a file is open for reading or writing once in a process
    assert main([*words[1:], "-o", str(target)]) == 0
    assert target.stat().st_size > 0


def test_pictures_by_the_index_are_those_of_the_walk(folder: Path, store: Store) -> None:
    row = find_recording(store, "people")
    tables = read_tables(store, row["recording_id"], None)
    spans = (None, Span(START_NS + 5 * STEP_NS, START_NS + 9 * STEP_NS))
    for span in spans:
        rows = tables if span is None else read_tables(store, row["recording_id"], span)
        by_index, by_walk = (
            [
                still._replace(image=bytes(still.image))
                for still in pictures(
                    Path(row["file"]), row | {"damaged": damaged}, rows, Config(), span
                )
            ]
            for damaged in (False, True)
        )
        assert by_index == by_walk
        assert [p.frame_index for p in by_index] == (
            list(range(40)) if span is None else list(range(5, 10))
        )


@pytest.mark.parametrize("side", ["rows", "pictures"])
def test_a_timeline_that_cannot_be_written_leaves_nothing(
    folder: Path, tmp_path: Path, store: Store, monkeypatch: pytest.MonkeyPatch, side: str
) -> None:
    row = find_recording(store, "people")
    source = read_source(store, row["recording_id"], folder / "people.mcap", Config())
    still = next(iter(source.images))

    def full(*_: Any) -> None:
        raise OSError("no space left")

    # However many pictures there are, none is sent any more when the rows cannot be.
    images = repeat(still) if side == "rows" else map(full, [still])
    if side == "rows":
        monkeypatch.setattr(dashboards.timeline.writer, "_log_rows", full)
    with pytest.raises(StadimeterError, match=r"cannot be written.*no space left"):
        write_timeline(tmp_path / "a.rrd", [replace(source, images=images)])
    assert list(tmp_path.iterdir()) == []


def test_the_rows_of_a_span_are_those_of_its_frames(store: Store) -> None:
    recording_id = find_recording(store, "people")["recording_id"]
    span = Span(START_NS + 5 * STEP_NS, START_NS + 9 * STEP_NS)
    whole, part = (read_tables(store, recording_id, s) for s in (None, span))
    assert set(part) == set(whole)
    for name in ("frames", "observations", "ground_truth", "matches"):
        kept = [r for r in whole[name].to_pylist() if 5 <= r["frame_index"] <= 9]
        assert sorted(map(repr, part[name].to_pylist())) == sorted(map(repr, kept))
    assert part["estimates"].num_rows * 8 == whole["estimates"].num_rows
    assert part["tracks"].equals(whole["tracks"])


def test_a_day_is_split_into_its_stretches(store: Store) -> None:
    recording_id = find_recording(store, "people")["recording_id"]
    spans = list(spans_of(store, recording_id, 1.0))
    assert len(spans) == 4
    counts = [read_tables(store, recording_id, span)["frames"].num_rows for span in spans]
    assert counts == [10, 10, 10, 10]


def test_run_splits_a_long_timeline_and_shrinks_its_pictures(folder: Path, tmp_path: Path) -> None:
    options = ["--rrd-preview", "64", "--rrd-split", str(2 / 60)]
    recording = str(folder / "people.mcap")
    command = ["run", recording, "--db", str(tmp_path / "y.duckdb"), "--rrd", str(tmp_path)]
    assert main([*command, *options]) == 0
    parts = sorted(tmp_path.glob("*.rrd"))
    assert [p.name for p in parts] == ["people.001.rrd", "people.002.rrd"]
    found = entities(parts[1])
    blobs = column(found["/cameras/cam/camera/image"], "EncodedImage:blob")
    assert len(blobs) == 20
    assert image_size(bytes(blobs[0][0])) == (64, 48)
    assert column(found["/cameras/cam/camera"], "Pinhole:resolution") == [[[64.0, 48.0]]]


def test_a_preview_is_no_larger_than_asked_for() -> None:
    small = preview(jpeg(), 100)
    assert image_size(small) == (100, 75)
    assert media_type(small) == "image/jpeg"
    assert preview(jpeg(), 320) == jpeg()
    assert preview(b"no picture", 100) == b""
    assert preview(jpeg()[:100], 100) == b""


def test_a_moved_recording_is_given_by_its_path(folder: Path, tmp_path: Path, store: Store) -> None:
    moved = tmp_path / "elsewhere.mcap"
    shutil.copy(folder / "people.mcap", moved)
    row = find_recording(store, str(folder / "people.mcap"))
    source = read_source(store, row["recording_id"], moved, Config())
    assert sum(1 for _ in source.images) == 40
    assert {image.camera for image in source.images} == set()  # they were read once
    assert source.tables["cameras"]["camera"].to_pylist() == [CAMERA]


def listening(process_id: int) -> list[str]:
    """Return the addresses on which a process listens, as /proc has them (Linux)."""
    inodes = set()
    for link in Path(f"/proc/{process_id}/fd").iterdir():
        with suppress(FileNotFoundError):  # closed meanwhile
            target = str(link.readlink())
            if target.startswith("socket:["):
                inodes.add(target[8:-1])
    found = []
    for table in ("tcp", "tcp6"):
        for line in Path(f"/proc/{process_id}/net/{table}").read_text().splitlines()[1:]:
            fields = line.split()
            if fields[3] == "0A" and fields[9] in inodes:
                found.append(fields[1].split(":")[0])
    return found


@pytest.mark.viewer
@pytest.mark.slow
def test_the_viewer_is_reached_from_this_machine_only(store: Store, tmp_path: Path) -> None:
    if no_driver():
        pytest.skip(no_driver())
    written = write_review(store, Review(["people"], at="#7"), tmp_path / "a.rrd", Config())
    with started(written.path, ["--headless", "--window-size", "1280x720"]) as running:
        client = running.client()
        go_to_moment(client, written)
        addresses = listening(running.process.pid)
        shown = client.get_state().recordings[0]
        reports = Viewer(client).reports()
    assert set(addresses) == {LOOPBACK_HEX}
    assert reports == []
    assert (shown.current_timeline, shown.current_time) == (TIME, START_NS + 7 * STEP_NS)
    with started(written.path, ["--serve-web", "--web-viewer-port", "0"]) as running:
        deadline = time.monotonic() + 20
        while len(addresses := listening(running.process.pid)) < 2 and time.monotonic() < deadline:
            time.sleep(0.2)
    assert set(addresses) == {LOOPBACK_HEX}
