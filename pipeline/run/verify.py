"""Verification of stored recordings: the same file, and the same numbers if it is measured again.

The hash of each file is held against the stored one. Then the recording is worked again with the
settings that its run kept, in a database of its own, and the rows of some frames, drawn at random, are
held against the stored ones; the hash of all tables says whether all rows are equal.
"""
# ruff: noqa: S608  (the text that is put into SQL is names of our own tables)

from __future__ import annotations

import json
import math
import random
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pipeline.core.config import Config, build
from pipeline.core.errors import StadimeterError, StoreError, UsageError, Where
from pipeline.core.progress import Report, silent
from pipeline.core.timing import StageTimes
from pipeline.mcap_file.bag import is_recording, sha256_of
from pipeline.run.pass_one import measure_recording
from pipeline.run.recording import attempt, stored_alone
from pipeline.store.database import Store
from pipeline.store.fingerprint import tables_sha256
from pipeline.store.recordings import has_truth_of_files
from pipeline.store.scratch import Begun

_OF_FRAME = ("frames", "observations", "ground_truth")
_OF_OBSERVATION = ("estimates", "observation_quality")


@dataclass(frozen=True, slots=True)
class Verified:
    """Result for one recording. `problem` is empty if everything is as it was stored."""

    file_name: str
    problem: str
    frames_compared: int = 0
    all_rows_equal: bool = False


def verify_recordings(
    database: Path, frames: int, seed: int, report: Report = silent
) -> list[Verified]:
    """Hash the files of all stored recordings again, and measure some of their frames again.

    Args:
        database: DuckDB file.
        frames: frames of each recording whose rows are compared; 0 measures nothing again.
        seed: of the draw.
        report: is told what is done.

    Raises:
        StoreError: the database does not exist or cannot be read.
    """
    with Store.open_current(database) as store:
        rows = store.query("FROM recordings ORDER BY file_name, recording_id").to_pylist()
        found = []
        for row in rows:
            path = Path(row["path"])
            result = attempt(path, _verify, store, row, path, frames, seed, report)
            if isinstance(result, StadimeterError):
                result = Verified(row["file_name"], str(result))
            found.append(result)
        return found


def _verify(
    store: Store, row: dict[str, Any], path: Path, frames: int, seed: int, report: Report
) -> Verified:
    name = row["file_name"]
    if not is_recording(path):
        return Verified(name, f"the file is not there: {path}")
    if sha256_of(path) != row["content_sha256"]:
        return Verified(name, f"the file has changed since it was measured: {path}")
    if frames <= 0:
        return Verified(name, "")
    chosen = _chosen(store, row["recording_id"], frames, seed)
    config = config_of(store, row["run_id"])
    stored = _rows_of(store, row["recording_id"], row["run_id"], chosen)
    with tempfile.TemporaryDirectory(prefix="stadimeter-") as folder:
        times = StageTimes()
        again = measure_recording(
            path, config, Path(folder) / "parts", threads=2, report=report, times=times
        )
        begun = Begun(row["run_id"], None, "{}", "{}")
        with stored_alone(again, Path(folder) / "parts", begun, config, times, Path(folder)) as own:
            measured = _rows_of(own, row["recording_id"], row["run_id"], chosen)
            whole = tables_sha256(own, row["recording_id"], row["run_id"])
    labelled = has_truth_of_files(store, row["recording_id"])
    if labelled:  # truth of files was added since, and is in no recording
        stored.pop("ground_truth")
    different = [table for table, rows in stored.items() if rows != measured[table]]
    problem = ""
    if different:
        problem = f"measured again, rows of {len(chosen)} frames differ in: {', '.join(different)}"
    elif row["tables_sha256"] not in (None, whole) and not labelled:
        problem = f"{len(chosen)} frames are equal, but other rows differ (the hash of all tables)"
    return Verified(name, problem, len(chosen), whole == row["tables_sha256"])


def config_of(store: Store, run_id: str) -> Config:
    """Return the configuration that a stored run kept.

    Raises:
        StoreError: the run is not in the database.
        UsageError: it is of another version, which had other settings.
    """
    found = store.query("SELECT configuration FROM runs WHERE run_id = ?", [run_id]).to_pylist()
    if not found:
        raise StoreError("the run that measured it is not in the database", where=Where(store.path))
    return _config_from_json(found[0]["configuration"])


def _config_from_json(text: str) -> Config:
    """Return the configuration that a run kept as JSON (column `configuration` of `runs`).

    Raises:
        UsageError: it is of another version, which had other settings.
    """
    try:
        config: Config = build(Config, _without_unknown(json.loads(text)), "")
        return config
    except ValueError as error:
        raise UsageError(
            f"the settings of the run cannot be read: {error}",
            remedy="Use the version of stadimeter that made the run",
        ) from error


def _without_unknown(value: Any) -> Any:
    """Return a tree without None and NaN, which stand for what is not set."""
    if isinstance(value, dict):
        return {k: _without_unknown(v) for k, v in value.items() if not _is_unknown(v)}
    return [_without_unknown(v) for v in value] if isinstance(value, list) else value


def _is_unknown(value: Any) -> bool:
    return value is None or (isinstance(value, float) and math.isnan(value))


def _chosen(store: Store, recording_id: str, count: int, seed: int) -> list[tuple[str, int]]:
    """Return camera and index of frames drawn at random."""
    rows = store.query(
        "SELECT camera, frame_index FROM frames WHERE recording_id = ? ORDER BY ALL", [recording_id]
    ).to_pylist()
    keys = [(r["camera"], r["frame_index"]) for r in rows]
    return sorted(random.Random(seed).sample(keys, min(count, len(keys))))  # noqa: S311


def _rows_of(
    store: Store, recording_id: str, run_id: str, chosen: list[tuple[str, int]]
) -> dict[str, list[str]]:
    """Return the rows of some frames as text, by table."""
    given = [recording_id, [c for c, _ in chosen], [i for _, i in chosen]]
    frames = "SELECT unnest(?::VARCHAR[]) AS camera, unnest(?::INTEGER[]) AS frame_index"
    found = {}
    for table in _OF_FRAME:
        found[table] = _texts(
            store,
            f"FROM {table} SEMI JOIN ({frames}) USING (camera, frame_index) WHERE recording_id = ?",
            [*given[1:], recording_id],
        )
    for table in _OF_OBSERVATION:
        found[table] = _texts(
            store,
            f"SELECT t.* EXCLUDE (run_id) FROM {table} t SEMI JOIN (FROM observations "
            f"SEMI JOIN ({frames}) USING (camera, frame_index) WHERE recording_id = ?) "
            "USING (observation_index) WHERE t.recording_id = ? AND t.run_id = ?",
            [*given[1:], recording_id, recording_id, run_id],
        )
    return found


def _texts(store: Store, sql: str, values: list[object]) -> list[str]:
    rows = store.query(f"SELECT t::VARCHAR AS text FROM ({sql}) t ORDER BY ALL", values)
    return [str(text) for text in rows["text"].to_pylist()]
