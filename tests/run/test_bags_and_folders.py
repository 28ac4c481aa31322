"""Bags of several files as one recording, folders and patterns, and what is refused."""

from __future__ import annotations

import io
from pathlib import Path

import pytest

from pipeline.core.config import Config
from pipeline.core.diagnostics import Notes
from pipeline.core.errors import NotARecording, UsageError
from pipeline.core.records import Intrinsics
from pipeline.ingest.frames import FrameAssembler
from pipeline.ingest.survey import survey
from pipeline.mcap_file.bag import JoinedFiles, is_recording, open_bytes, size_of
from pipeline.mcap_file.reader import McapFile
from pipeline.mcap_file.writer import RecordingWriter, calibration_message, image_message
from pipeline.run.recording_paths import folders_apart, recordings_of

START_NS = 1_700_000_000_000_000_000
STEP_NS = 100_000_000
LENS = Intrinsics(64, 48, 50.0, 50.0, 31.5, 23.5)


def write(path: Path, numbers: range, *, calibrated: bool = False) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    with RecordingWriter(path) as writer:
        if calibrated:
            time_ns = START_NS + numbers[0] * STEP_NS
            writer.write("/cam/info", calibration_message(LENS, time_ns, "cam"), time_ns)
        for number in numbers:
            time_ns = START_NS + number * STEP_NS
            writer.write("/cam/i", image_message(b"%d" % number, "jpeg", time_ns, "cam"), time_ns)
    return path


def split_bag(folder: Path, *, style: str = "block", prefix: str = "") -> Path:
    names = []
    for number in range(3):
        numbers = range(10 * number, 10 * number + 10)
        name = f"{folder.name}_{number}.mcap"
        write(folder / name, numbers, calibrated=number == 0)
        names.append(prefix + name)
    if style == "block":
        listed = "\n" + "".join(f"    - {name}\n" for name in names)
    else:
        listed = f" [{', '.join(names)}]\n"
    text = "rosbag2_bagfile_information:\n  version: 5\n  storage_identifier: mcap\n"
    text += f"  relative_file_paths:{listed}  duration:\n    nanoseconds: 29\n"
    (folder / "metadata.yaml").write_text(text)
    return folder


def read(path: Path):
    config, notes = Config(), Notes()
    file = McapFile(path, config.limits, notes.add)
    return list(FrameAssembler(file, config.ingest, notes)), notes, file


@pytest.mark.parametrize("style", ["block", "flow"])
@pytest.mark.parametrize("prefix", ["", "elsewhere/when_recorded/"])
def test_a_split_bag_is_one_recording_with_the_calibration_of_its_first_file(
    tmp_path: Path, style: str, prefix: str
) -> None:
    bag = split_bag(tmp_path / "walk", style=style, prefix=prefix)
    frames, _, file = read(bag)
    assert [int(f.image) for f in frames] == list(range(30))
    assert all(f.intrinsics is not None for f in frames)
    whole = b"".join((bag / f"walk_{n}.mcap").read_bytes() for n in range(3))
    joined = tmp_path / "joined.mcap"
    joined.write_bytes(whole)
    assert file.content_sha256 == read(joined)[2].content_sha256
    found = survey(bag, Config())
    assert found.cameras[0].frame_count == 30
    assert {c.topic: c.message_count for c in found.channels} == {"/cam/i": 30, "/cam/info": 1}
    assert not list(found.notes)
    assert is_recording(bag)
    assert not is_recording(bag.parent)
    assert size_of(bag) == len(whole)


def test_a_missing_part_is_told_and_the_others_are_read(tmp_path: Path) -> None:
    bag = split_bag(tmp_path / "walk")
    (bag / "walk_1.mcap").unlink()
    frames, notes, _ = read(bag)
    assert [int(f.image) for f in frames] == [*range(10), *range(20, 30)]
    told = next(n for n in notes if n.code == "missing_part")
    assert "walk_1.mcap" in told.message


def test_a_damaged_part_costs_no_other(tmp_path: Path) -> None:
    bag = split_bag(tmp_path / "walk")
    part = bag / "walk_1.mcap"
    part.write_bytes(part.read_bytes()[:400])
    frames, notes, _ = read(bag)
    numbers = [int(f.image) for f in frames]
    assert set(range(10)) | set(range(20, 30)) <= set(numbers)
    assert notes.lost_data


def test_folders_and_patterns_become_recordings(tmp_path: Path) -> None:
    bag = split_bag(tmp_path / "a" / "walk")
    one = write(tmp_path / "a" / "x.mcap", range(2))
    two = write(tmp_path / "b" / "deep" / "x.MCAP", range(2))
    (tmp_path / "b" / "x.mcap.part").write_bytes(b"")
    write(tmp_path / ".hidden" / "y.mcap", range(2))
    assert recordings_of([tmp_path]) == [bag, one, two]
    assert recordings_of([tmp_path / "a"]) == [bag, one]
    assert recordings_of([tmp_path / "*" / "x.mcap"]) == [one]
    assert recordings_of([tmp_path / "**" / "x.[mM]*[pP]"]) == [one, two]
    assert recordings_of([one, one, tmp_path / "a"]) == [one, bag]
    assert recordings_of(sorted(bag.glob("*.mcap"))) == [bag]  # what a shell makes of bag/*.mcap
    first = bag / "walk_0.mcap"
    assert recordings_of([first]) == [first]
    absent = tmp_path / "absent.mcap"
    assert recordings_of([absent]) == [absent]
    with pytest.raises(UsageError, match="no file fits"):
        recordings_of([tmp_path / "z*.mcap"])


def test_a_folder_without_recordings_says_what_is_there(tmp_path: Path) -> None:
    (tmp_path / "old").mkdir()
    (tmp_path / "old" / "x.bag").write_bytes(b"#ROSBAG V2.0")
    with pytest.raises(UsageError, match=r"there are \.bag files.*mcap convert"):
        recordings_of([tmp_path / "old"])


@pytest.mark.parametrize(
    ("name", "said"),
    [("x_0.db3", "ros2 bag convert"), ("x_0.mcap.zstd", "Unpack it first")],
)
def test_bags_in_another_storage_are_refused_with_what_to_do(
    tmp_path: Path, name: str, said: str
) -> None:
    (tmp_path / name).write_bytes(b"x")
    (tmp_path / "metadata.yaml").write_text(f"a:\n  relative_file_paths:\n    - {name}\n")
    with pytest.raises(NotARecording, match=said):
        McapFile(tmp_path, Config().limits, lambda _: None)


def test_a_folder_that_is_no_bag_is_refused(tmp_path: Path) -> None:
    with pytest.raises(NotARecording, match=r"metadata\.yaml"):
        McapFile(tmp_path, Config().limits, lambda _: None)


def test_timelines_of_one_name_go_into_folders_apart(tmp_path: Path) -> None:
    paths = [Path("a/n/x.mcap"), Path("b/n/x.mcap"), Path("b/y.mcap"), Path("b/n/X.mcap")]
    found = folders_apart(paths, tmp_path)
    assert found[paths[2]] == tmp_path
    assert found[paths[0]] == tmp_path / "a" / "n"
    assert found[paths[1]] == tmp_path / "b" / "n"
    targets = {(found[p], p.stem) for p in paths}
    assert len({found[p] / p.stem.casefold() for p in paths}) == len(targets)


def test_joined_files_read_as_one(tmp_path: Path) -> None:
    parts = [tmp_path / name for name in "abcd"]
    for part, data in zip(parts, (b"0123", b"", b"45", b"6789"), strict=True):
        part.write_bytes(data)
    joined = JoinedFiles(parts)
    assert joined.read() == b"0123456789"
    for start in range(11):
        for count in range(11):
            joined.seek(start)
            with_buffer = io.BufferedReader(JoinedFiles(parts))
            with_buffer.seek(start)
            assert with_buffer.read(count) == b"0123456789"[start : start + count]
    assert joined.seek(-2, io.SEEK_END) == 8
    with open_bytes(parts[0]) as stream:
        assert stream.read() == b"0123"
