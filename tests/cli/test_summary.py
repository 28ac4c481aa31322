"""The end of a run: what was found, what gave no number and why, every warning, exit codes."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
from mcap.reader import make_reader
from mcap.writer import Writer

import stadimeter as face
from stadimeter.summary import summarize
from tests.cli.test_commands import stadimeter
from tests.run.test_recordings import LEVEL, write_people

CAMERA = '[[camera]]\nname = "cam"\ncamera_height_m = 1.5\ntilt_deg = 0.0\n'


def without(source: Path, target: Path, topic: str) -> None:
    """Copy a recording without the messages of a topic."""
    with source.open("rb") as old, target.open("wb") as new:
        writer = Writer(new)
        writer.start()
        channels: dict[int, int] = {}
        for schema, channel, message in make_reader(old).iter_messages():
            if channel.topic == topic:
                continue
            if channel.id not in channels:
                known = writer.register_schema(schema.name, schema.encoding, schema.data)
                channels[channel.id] = writer.register_channel(
                    channel.topic, channel.message_encoding, known
                )
            writer.add_message(
                channels[channel.id], message.log_time, message.data, message.publish_time
            )
        writer.finish()


@pytest.fixture(scope="module")
def workplace(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("summary")
    write_people(folder / "people.mcap")
    (folder / "level.toml").write_text(CAMERA)
    without(folder / "people.mcap", folder / "lensless.mcap", "/calib")
    without(folder / "people.mcap", folder / "boxless.mcap", "/found")
    return folder


def test_a_run_says_cameras_people_and_next_steps(workplace: Path) -> None:
    done = stadimeter(
        "run", "people.mcap", "--db", "a.duckdb", "--camera", "level.toml", cwd=workplace
    )
    assert done.returncode == 0, done.stderr
    assert "camera cam: " in done.stdout
    assert "focal length 400 px, by the recording; 1.50 m above the ground" in done.stdout
    assert done.stdout.count("│ person │") == 2
    assert re.search(r"│ +(9\.9|10\.\d) \((8|9)\.\d to 1[01]\.\d\) │", done.stdout), done.stdout
    assert "next      stadimeter report --db a.duckdb -o report.html" in done.stdout
    assert "warning" not in done.stdout


def test_a_run_without_a_distance_says_so_and_why(workplace: Path) -> None:
    done = stadimeter(
        "run", "lensless.mcap", "--db", "b.duckdb", "--camera", "level.toml", cwd=workplace
    )
    assert done.returncode == 3
    assert "NO DISTANCE was estimated in this recording" in done.stdout
    assert "no distance for 24 of 24 observations of person (cam)" in done.stdout
    assert "lens unknown" in done.stdout
    assert "to do: give the lens in a camera file" in done.stdout


def test_a_recording_in_which_nothing_is_found_says_so(workplace: Path) -> None:
    done = stadimeter("run", "boxless.mcap", "--db", "c.duckdb", cwd=workplace)
    assert done.returncode == 3
    assert "nothing was found in its 12 frames" in done.stdout


def test_quiet_prints_warnings_alone(workplace: Path) -> None:
    good = stadimeter(
        "run", "people.mcap", "--db", "d.duckdb", "--camera", "level.toml", "-q", cwd=workplace
    )
    assert (good.returncode, good.stdout, good.stderr) == (0, "", "")
    bad = stadimeter("run", "lensless.mcap", "--db", "d.duckdb", "--quiet", cwd=workplace)
    assert bad.returncode == 3
    assert bad.stdout == ""
    assert "warning: " in bad.stderr
    assert "(lensless.mcap" in bad.stderr


def test_json_is_all_of_it_and_nothing_else(workplace: Path) -> None:
    done = stadimeter(
        "run", "people.mcap", "lensless.mcap", "--db", "e.duckdb", "--json", cwd=workplace
    )
    assert done.returncode == 3
    told = json.loads(done.stdout)
    assert told["in_doubt"]
    files = {one["file_name"]: one for one in told["recordings"]}
    assert not files["people.mcap"]["is_empty"]
    assert files["lensless.mcap"]["is_empty"]
    assert files["people.mcap"]["cameras"][0]["focal_length_px"] == pytest.approx(400.0)
    assert {f["severity"] for f in told["findings"]} >= {"warning"}
    assert all(f["advice"] or f["message"] for f in told["findings"])
    assert told["failed"] == []


def test_equal_findings_of_several_recordings_are_said_once(workplace: Path) -> None:
    (workplace / "again").mkdir(exist_ok=True)
    write_people(workplace / "again" / "other.mcap", frames=13)
    without(workplace / "again" / "other.mcap", workplace / "second.mcap", "/calib")
    face.measure(
        [workplace / "lensless.mcap", workplace / "second.mcap"],
        workplace / "f.duckdb",
        camera=LEVEL,
    )
    with face.open(workplace / "f.duckdb") as results:
        summary = summarize(results)
    lens = [f for f in summary.findings if f.code == "no_lens_data"]
    assert len(lens) == 1
    assert set(lens[0].recordings) == {"lensless.mcap", "second.mcap"}


def test_intervals_hold_their_estimate_and_stay_positive(workplace: Path) -> None:
    face.measure(workplace / "people.mcap", workplace / "g.duckdb", camera=LEVEL)
    with face.open(workplace / "g.duckdb") as results:
        tracks = summarize(results).recordings[0].tracks
    assert len(tracks) == 2
    for track in tracks:
        assert 0 < track.depth_low_m < track.depth_m < track.depth_high_m
        assert 0 <= track.height_low_m < track.height_m < track.height_high_m
        assert track.depth_low_m < 10.0 < track.depth_high_m
