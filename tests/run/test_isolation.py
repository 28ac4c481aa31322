"""One bad recording costs one recording, in one process, in workers and in a folder of parts."""

from __future__ import annotations

import os
from pathlib import Path

import cv2
import numpy as np
import pytest

import pipeline.run.recording
from pipeline.cluster.shared_run import run_shared
from pipeline.core.config import Config
from pipeline.core.text import storable
from pipeline.messages import json_text
from pipeline.messages.tree import UndecodableMessage
from pipeline.run.recordings import estimate_again, run
from pipeline.store.database import Store
from tests.run.test_recordings import LEVEL, fail_on, write_people

NO_UTF8 = os.fsdecode(b"bad\xff\xfename.mcap")
ERRORS = (
    MemoryError("9,000 boxes"),
    np.linalg.LinAlgError("Singular matrix"),
    cv2.error("after a clock jump"),
    UnicodeEncodeError("utf-8", "\ud800", 0, 1, "surrogates not allowed"),
    RecursionError("too deep"),
    AssertionError("never so"),
    OSError(5, "Input/output error"),
    type("PanicException", (BaseException,), {})("a library in Rust"),
)


@pytest.fixture(scope="module")
def good(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("good") / "good.mcap"
    write_people(path, frames=3)
    return path


@pytest.mark.parametrize("error", ERRORS, ids=lambda e: type(e).__name__)
def test_any_error_is_that_recording_s_row(
    error: BaseException, good: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    bad = tmp_path / "bad.mcap"
    write_people(bad, frames=2)
    whole = pipeline.run.recording.measure_recording

    def measure(path: Path, *arguments: object, **named: object) -> object:
        if path.name == "bad.mcap":
            raise error
        return whole(path, *arguments, **named)  # type: ignore[arg-type]

    monkeypatch.setattr(pipeline.run.recording, "measure_recording", measure)
    result = run([bad, good], tmp_path / "x.duckdb", LEVEL)
    assert [o.path for o in result.stored] == [good]
    (failed,) = result.failed
    with Store.open(tmp_path / "x.duckdb", read_only=True) as store:
        rows = store.query("SELECT file_name, message FROM diagnostics WHERE severity = 'error'")
    assert rows.to_pylist() == [{"file_name": "bad.mcap", "message": str(failed.error)}]


@pytest.mark.parametrize("workers", [1, 2])
def test_a_file_name_that_is_no_utf8_is_stored_and_its_failure_told(
    workers: int, good: Path, tmp_path: Path
) -> None:
    strange, broken = tmp_path / NO_UTF8, tmp_path / ("broken" + NO_UTF8)
    write_people(strange, frames=2)
    broken.write_bytes(b"no recording")
    result = run([broken, strange, good], tmp_path / "x.duckdb", LEVEL, workers=workers)
    assert [o.path for o in result.stored] == [strange, good]
    with Store.open(tmp_path / "x.duckdb", read_only=True) as store:
        names = store.query("SELECT file_name FROM recordings")["file_name"].to_pylist()
        failed = store.query("SELECT file_name FROM diagnostics WHERE recording_id IS NULL")
    assert set(names) == {storable(NO_UTF8), "good.mcap"}
    assert failed["file_name"].to_pylist() == ["broken" + storable(NO_UTF8)]
    assert storable(NO_UTF8) == r"bad\xff\xfename.mcap"


def test_a_folder_of_parts_takes_any_file_name(good: Path, tmp_path: Path) -> None:
    strange, broken = tmp_path / NO_UTF8, tmp_path / ("broken" + NO_UTF8)
    write_people(strange, frames=2)
    broken.write_bytes(b"no recording")
    result = run_shared([broken, strange, good], tmp_path / "parts", LEVEL)
    assert [f.path for f in result.made] == [strange, good]
    assert [f.path for f in result.failed] == [broken]
    again = run_shared([strange, good], tmp_path / "parts", LEVEL)
    assert [f.path for f in again.there] == [strange, good]


@pytest.mark.parametrize("text", [r'{"frame_id": "\ud800"}', r'{"a": [{"\udfff": 1}]}'])
def test_half_a_character_in_json_is_no_message(text: str) -> None:
    with pytest.raises(UndecodableMessage, match="half a character"):
        json_text.read(text.encode())
    assert json_text.read(rb'{"a": "\ud83d\ude00 \u00e9"}') == {"a": "\U0001f600 \u00e9"}


def test_an_error_in_estimating_again_costs_that_recording(
    good: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    bad, database = tmp_path / "bad.mcap", tmp_path / "x.duckdb"
    write_people(bad, frames=2)
    run([bad, good], database, LEVEL)
    monkeypatch.setattr(pipeline.run.recordings, "estimate_recording", fail_on("bad.mcap"))
    run_id, count = estimate_again(database, Config(), None)
    assert count == 1
    with Store.open(database, read_only=True) as store:
        rows = store.query(
            "SELECT file_name, code FROM diagnostics WHERE run_id = ? AND severity = 'error'",
            [run_id],
        )
    assert rows.to_pylist() == [{"file_name": "bad.mcap", "code": "recording_failed"}]
