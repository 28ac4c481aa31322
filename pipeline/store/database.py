"""The DuckDB database: runs, recordings and estimates in and out.

One process writes at a time, and shuts out all others meanwhile; any number may read. A recording
is replaced whole inside one transaction. Values from files reach SQL as parameters or as Arrow
columns, never as text.
"""
# ruff: noqa: S608  (the text that is put into SQL is names of our own tables and columns)

from __future__ import annotations

import uuid
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from types import TracebackType
from typing import Any

import duckdb
import pyarrow as pa

from pipeline.core.diagnostics import diagnostics_table
from pipeline.core.errors import StoreError, UsageError, Where
from pipeline.core.records import Diagnostic, GroundPlane
from pipeline.core.tables import PASS_ONE, PASS_TWO
from pipeline.store.catalog import View, views
from pipeline.store.connection import connect
from pipeline.store.exposure_rows import exposure_verdicts
from pipeline.store.matches import add_matches
from pipeline.store.parquet_parts import read_part
from pipeline.store.precision import kept
from pipeline.store.schema import apply_schema, is_current
from pipeline.store.track_rows import observed, tracks_of

# What one recording has rows in; deleting these forgets it.
RECORDING_TABLES = (
    "recordings",
    *PASS_ONE,
    "matches",
    "estimates",
    "track_heights",
    "observation_quality",
)
# How rows are sorted as they go in, so that a recording's, a camera's and a time's lie together.
_ORDER = {
    "frames": "camera, frame_index",
    "tracks": "camera, track_id",
    "background_lines": "camera, x0_px, y0_px",
    "observations": "camera, frame_index, observation_index",
    "ground_truth": "camera, frame_index, object_id",
    "estimates": "method, observation_index",
    "track_heights": "method, camera, track_id",
    "observation_quality": "observation_index",
}

# A transaction that is read-only does not keep these from the disk, where files may be reached at all.
_WRITING_FILES = (
    duckdb.StatementType.ATTACH,
    duckdb.StatementType.COPY,
    duckdb.StatementType.COPY_DATABASE,
    duckdb.StatementType.EXPORT,
)


@dataclass(frozen=True, slots=True)
class RecordingRow:
    """What is known of a recording after pass 1."""

    path: Path
    content_sha256: str
    size_bytes: int
    start_time_ns: int | None
    end_time_ns: int | None
    frame_count: int
    frames_lost: int
    damaged: bool

    @property
    def recording_id(self) -> str:
        """The key: the same bytes under another name are the same recording."""
        return self.content_sha256[:16]


LENS_COLUMNS = (
    "fx_px",
    "fy_px",
    "cx_px",
    "cy_px",
    "focal_std_px",
    "distortion_model",
    "distortion",
    "intrinsics_source",
)


class Store:
    """A connection to a stadimeter database; use `open`, and as a context manager."""

    def __init__(self, connection: duckdb.DuckDBPyConnection, path: Path) -> None:
        self.path = path
        self._connection = connection
        self._in_transaction = False

    @classmethod
    def open(cls, path: Path, *, read_only: bool = False, roomy: bool = False) -> Store:
        """Open a database, and create it if it is to be written and does not exist.

        No connection can reach any other file; one that only reads cannot change the database. One
        that writes keeps its memory small, unless it is to be `roomy` for large reads as well.

        Raises:
            StoreError: it does not exist, is none, is of another version, or is held by another
                process.
        """
        store = cls(connect(path, read_only=read_only, roomy=roomy), path)
        if not read_only:
            try:
                store.prepare()
            except BaseException:
                store._connection.close()
                raise
        return store

    @classmethod
    def hold(cls, path: Path, *, roomy: bool = False) -> Store:
        """Take hold of a database for writing, as `open`; until `prepare` it may have no tables."""
        return cls(connect(path, read_only=False, roomy=roomy), path)

    def prepare(self, views: Collection[str] = ()) -> None:
        """Make the tables and views of this version, or of these only some, where they are not there."""
        with self.transaction():
            apply_schema(self._connection, views)

    @classmethod
    def open_current(cls, path: Path) -> Store:
        """Open a database for reading, its tables and views brought up to date if they are older.

        Raises:
            StoreError: as `open`; or it is older, and held by another process.
        """
        store = cls.open(path, read_only=True)
        if not is_current(store._connection):
            store._connection.close()
            cls.open(path, roomy=True)._connection.close()
            store = cls.open(path, read_only=True)
        return store

    def __enter__(self) -> Store:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._connection.close()

    @contextmanager
    def transaction(self) -> Iterator[None]:
        """All or nothing: commit at the end, roll back on any error.

        Raises:
            StoreError: the database refused (a full disk, for one); nothing of it was kept.
        """
        if self._in_transaction:
            raise RuntimeError("transactions do not nest")
        self._connection.execute("BEGIN")
        self._in_transaction = True
        try:
            yield
            # After a fatal error COMMIT rolls back without saying so; any statement says so.
            self._connection.execute("SELECT 1")
            self._connection.execute("COMMIT")
        except BaseException as error:
            # A failed COMMIT has ended the transaction already.
            with suppress(duckdb.Error):
                self._connection.execute("ROLLBACK")
            if isinstance(error, duckdb.Error):
                raise StoreError(
                    f"nothing of this step was stored: {error}",
                    where=Where(self.path),
                    remedy="Free some disk space if it is full, then run the same command again",
                ) from error
            raise
        finally:
            self._in_transaction = False

    def start_run(
        self,
        command: str,
        label: str | None,
        configuration: str,
        libraries: str,
        version: str,
        run_id: str | None = None,
    ) -> str:
        """Enter a run, and return its name, a new one if none is given."""
        run_id = run_id or new_run_id()
        with self.transaction():
            self._connection.execute(
                "INSERT INTO runs BY NAME SELECT ? AS run_id, ? AS command, ? AS label, "
                "? AS started_at, ? AS software_version, ? AS libraries, ? AS configuration",
                [run_id, command, label, datetime.now(UTC), version, libraries, configuration],
            )
        return run_id

    def finish_run(self, run_id: str) -> None:
        """Enter when a run ended."""
        with self.transaction():
            self._connection.execute(
                "UPDATE runs SET finished_at = ? WHERE run_id = ?", [datetime.now(UTC), run_id]
            )

    def ingest(self, recording: RecordingRow, parts: Path, run_id: str) -> str:
        """Replace a recording by what pass 1 measured of it; call inside a transaction.

        Observations of tracks that did not last (they are not in the part `tracks`) are noise of
        the detector and are left out. Returns the recording's id.
        """
        recording_id = recording.recording_id
        self.refuse_collision(recording)
        self.forget(recording_id)
        self._connection.execute(
            "INSERT INTO recordings BY NAME SELECT ? AS recording_id, ? AS content_sha256, "
            "? AS file_name, ? AS path, ? AS size_bytes, ? AS start_time_ns, ? AS end_time_ns, "
            "? AS frame_count, ? AS frames_lost, ? AS damaged, ? AS run_id",
            [
                recording_id,
                recording.content_sha256,
                recording.path.name,
                str(recording.path),
                recording.size_bytes,
                recording.start_time_ns,
                recording.end_time_ns,
                recording.frame_count,
                recording.frames_lost,
                recording.damaged,
                run_id,
            ],
        )
        for table in PASS_ONE:
            self._insert_part(table, parts, recording_id, recording.path.name, run_id)
        add_matches(self._connection, recording_id)
        return recording_id

    def forget(self, recording_id: str) -> None:
        """Delete all rows of a recording; call inside a transaction."""
        for table in RECORDING_TABLES:
            self._connection.execute(f"DELETE FROM {table} WHERE recording_id = ?", [recording_id])

    @contextmanager
    def rows(self, table: str) -> Iterator[pa.RecordBatchReader]:
        """Give all rows of a table, a batch at a time, as they lie."""
        cursor = self._connection.cursor()
        try:
            yield cursor.sql(f"FROM {table}").to_arrow_reader()
        finally:
            cursor.close()

    def take(self, table: str, rows: pa.RecordBatchReader) -> None:
        """Add rows as `rows` gave them; what several recordings bring, once. Inside a transaction."""
        only_new = {"runs": ("run_id",), "calibrations": ("run_id", "calibration_id")}.get(table)
        source = "FROM incoming"
        if only_new:
            key = ", ".join(only_new)
            source += f" ANTI JOIN (SELECT {key} FROM {table}) USING ({key})"
        with self._incoming("incoming", rows):
            self._connection.execute(f"INSERT INTO {table} BY NAME {source}")

    def has_run_of(self, recording_id: str, run_id: str) -> bool:
        """Whether the rows of a recording are those that a run made."""
        found = self._connection.execute(
            "SELECT 1 FROM recordings WHERE recording_id = ? AND run_id = ?", [recording_id, run_id]
        ).fetchone()
        return found is not None

    def has_failure_of(self, file_name: str, run_id: str) -> bool:
        """Whether a run has said that a file is no recording."""
        found = self._connection.execute(
            "SELECT 1 FROM diagnostics WHERE recording_id IS NULL AND file_name = ? AND run_id = ?",
            [file_name, run_id],
        ).fetchone()
        return found is not None

    def refuse_collision(self, recording: RecordingRow) -> None:
        """Refuse a recording whose key another one has.

        Raises:
            StoreError: there is such a one.
        """
        other = self._connection.execute(
            "SELECT path FROM recordings WHERE recording_id = ? AND content_sha256 <> ?",
            [recording.recording_id, recording.content_sha256],
        ).fetchone()
        if other is not None:
            raise StoreError(
                f"its key {recording.recording_id} is taken by another recording, {other[0]}",
                where=Where(recording.path),
                remedy="Use another database for it",
            )

    def _insert_part(
        self, table: str, parts: Path, recording_id: str, file_name: str, run_id: str
    ) -> None:
        source = f"SELECT ? AS recording_id, {_known(table)} FROM part"
        values = [recording_id]
        if table == "diagnostics":
            source = f"SELECT ? AS run_id, ? AS file_name, * FROM ({source})"
            values = [run_id, file_name, recording_id]
        if table == "observations":
            source += " SEMI JOIN (FROM tracks WHERE recording_id = ?) USING (camera, track_id)"
            values.append(recording_id)
        # They come by time already: to sort some at a time is enough, and needs the memory of some.
        if table in _ORDER:
            source += f" ORDER BY {_ORDER[table]}"
        for rows in read_part(parts, table):
            with self._incoming("part", _once(rows)):
                self._connection.execute(f"INSERT INTO {table} BY NAME {source}", values)

    @contextmanager
    def _incoming(self, name: str, rows: pa.Table | pa.RecordBatchReader) -> Iterator[None]:
        """Let SQL see Arrow rows under a name."""
        self._connection.register(name, rows)
        try:
            yield
        finally:
            with suppress(duckdb.Error):  # after an error, which is what is to be told
                self._connection.unregister(name)

    def write_estimates(
        self,
        recording_id: str,
        run_id: str,
        estimates: pa.Table,
        track_heights: pa.Table,
        calibrations: pa.Table,
        quality: pa.Table | None = None,
    ) -> None:
        """Replace what pass 2 made of a recording in a run; call inside a transaction."""
        self.forget_estimates(recording_id, run_id)
        made = {"estimates": estimates, "track_heights": track_heights}
        if quality is not None:
            made["observation_quality"] = quality
        self.add_estimates(recording_id, run_id, made)
        self.add_calibrations(calibrations, run_id)

    def forget_estimates(self, recording_id: str, run_id: str) -> None:
        """Delete what pass 2 made of a recording in a run; call inside a transaction."""
        for table in PASS_TWO:
            if table in RECORDING_TABLES:
                self._connection.execute(
                    f"DELETE FROM {table} WHERE recording_id = ? AND run_id = ?",
                    [recording_id, run_id],
                )

    def add_estimates(self, recording_id: str, run_id: str, made: Mapping[str, pa.Table]) -> None:
        """Add rows of the tables of pass 2; call inside a transaction."""
        for table, rows in made.items():
            with self._incoming("incoming", _once(rows.select(PASS_TWO[table].names))):
                self._connection.execute(
                    f"INSERT INTO {table} BY NAME SELECT ? AS recording_id, ? AS run_id, "
                    f"{_known(table)} FROM incoming ORDER BY {_ORDER[table]}",
                    [recording_id, run_id],
                )

    def add_calibrations(self, calibrations: pa.Table, run_id: str) -> None:
        """Store the calibrations that a run used or made, each once; call inside a transaction."""
        with self._incoming("incoming", calibrations):
            self._connection.execute(
                f"INSERT INTO calibrations BY NAME SELECT ? AS run_id, {_known('calibrations')} "
                "FROM incoming ANTI JOIN (FROM calibrations WHERE run_id = ?) "
                "USING (calibration_id)",
                [run_id, run_id],
            )

    def set_pose(self, recording_id: str, camera: str, plane: GroundPlane) -> None:
        """Store the pose of a camera; call inside a transaction."""
        std = plane.covariance.diagonal() ** 0.5
        self._connection.execute(
            "UPDATE cameras SET camera_height_m = ?, camera_height_std_m = ?, tilt_rad = ?, "
            "tilt_std_rad = ?, roll_rad = ?, roll_std_rad = ?, pose_source = ? "
            "WHERE recording_id = ? AND camera = ?",
            [
                plane.camera_height_m,
                float(std[0]),
                plane.tilt_rad,
                float(std[1]),
                plane.roll_rad,
                float(std[2]),
                plane.source,
                recording_id,
                camera,
            ],
        )

    def set_lens(self, recording_id: str, row: Mapping[str, Any]) -> None:
        """Store the lens of a row of `cameras`; call inside a transaction."""
        self._connection.execute(
            "UPDATE cameras SET fx_px = ?, fy_px = ?, cx_px = ?, cy_px = ?, focal_std_px = ?, "
            "distortion_model = ?, distortion = ?, intrinsics_source = ? "
            "WHERE recording_id = ? AND camera = ?",
            [*(row[name] for name in LENS_COLUMNS), recording_id, row["camera"]],
        )

    def add_diagnostics(
        self, notes: Sequence[Diagnostic], recording_id: str | None, run_id: str, file_name: str
    ) -> None:
        """Add diagnostics, of a recording or of a file that is none; call inside a transaction."""
        with self._incoming("incoming", diagnostics_table(list(notes))):
            self._connection.execute(
                "INSERT INTO diagnostics BY NAME "
                "SELECT ? AS recording_id, ? AS run_id, ? AS file_name, * FROM incoming",
                [recording_id, run_id, file_name],
            )

    def read(self, table: str, recording_id: str) -> pa.Table:
        """Return a recording's rows of a table, by camera and time (estimates by method)."""
        if table not in RECORDING_TABLES:
            raise ValueError(f"{table!r} is no table of recordings")
        return self._connection.sql(
            f"SELECT * FROM {table} WHERE recording_id = ? ORDER BY {_ORDER.get(table, 'ALL')}",
            params=[recording_id],
        ).to_arrow_table()

    def tracks_of(self, recording_id: str, object_class: str) -> pa.Table:
        """Return every track of a recording, and how often it is of a class: `by_tracks.tracks_of`."""
        return tracks_of(self._connection, recording_id, object_class)

    def observed(
        self, recording_id: str, camera: str, track_ids: Sequence[int], frames: tuple[int, int]
    ) -> tuple[pa.Table, pa.Table]:
        """Return tracks' observations and the other boxes in their frames: `by_tracks.observed`."""
        return observed(self._connection, recording_id, camera, track_ids, frames)

    def read_current(self, table: str, recording_id: str) -> pa.Table:
        """Return a recording's rows of a table of pass 2 that the newest run made."""
        if table not in ("estimates", "track_heights", "observation_quality"):
            raise ValueError(f"{table!r} is no table of estimates")
        return self._connection.sql(
            f"SELECT t.* FROM {table} t SEMI JOIN main.current_run USING (recording_id, run_id) "
            f"WHERE recording_id = ? ORDER BY {_ORDER[table]}",
            params=[recording_id],
        ).to_arrow_table()

    def exposure_verdicts(self, recording_id: str) -> pa.Table:
        """Return how frames of each camera are judged: `exposures.exposure_verdicts`."""
        return exposure_verdicts(self._connection, recording_id)

    def recordings(self) -> pa.Table:
        """Return all recordings."""
        return self._connection.sql("FROM recordings ORDER BY file_name").to_arrow_table()

    def query(self, sql: str, parameters: Sequence[object] | Mapping[str, object] = ()) -> pa.Table:
        """Return the result of one statement that a user wrote; it cannot change anything.

        Ask a store that is open for reading when there are millions of rows: one that is open for
        writing keeps its memory small (`connection.WRITING_MEMORY`), and exact medians need it.

        Each `?` in it stands for a parameter, or each `$name` for one of a mapping.

        Raises:
            UsageError: DuckDB does not accept it, or it is not one statement.
        """
        cursor = self._connection.cursor()
        try:
            statements = cursor.extract_statements(sql)
            if len(statements) != 1:
                raise UsageError("one SQL statement is needed", remedy="Run them one by one")
            if statements[0].type in _WRITING_FILES:
                raise UsageError("a question writes no file", remedy="`--parquet FILE` does")
            cursor.execute("BEGIN TRANSACTION READ ONLY")
            values = dict(parameters) if isinstance(parameters, Mapping) else list(parameters)
            relation = cursor.sql(sql, params=values or None)
            if relation is None:
                raise UsageError("the statement has no rows to show", remedy="Give a SELECT")
            return relation.to_arrow_table()
        except duckdb.Error as error:
            raise UsageError(
                f"DuckDB: {error}", remedy="`stadimeter query --list` shows tables and views"
            ) from error
        finally:
            cursor.close()

    def views(self) -> list[View]:
        """Return tables, views and table macros, with comments and columns."""
        return views(self._connection)

    def catalog(self) -> pa.Table:
        """Return name and comment of tables, views and table macros."""
        found = self.views()
        return pa.table({"name": [v.name for v in found], "comment": [v.comment for v in found]})


def new_run_id() -> str:
    """Return a name that no other run has."""
    return uuid.uuid4().hex[:12]


def _once(rows: pa.Table) -> pa.RecordBatchReader:
    """Return rows to be read once.

    What is registered is held until the transaction ends. A reader that was read holds nothing.
    """
    return pa.RecordBatchReader.from_batches(rows.schema, iter(rows.to_batches()))


def _known(table: str) -> str:
    """Return the columns of a table that comes in, NaN made NULL; of estimates, infinity too."""
    test = "isfinite({0})" if table in PASS_TWO else "NOT isnan({0})"
    return ", ".join(
        f"CASE WHEN {test.format(c.name)} THEN {kept(table, c.name, c.name)} END AS {c.name}"
        if pa.types.is_floating(c.type)
        else c.name
        for c in (PASS_ONE | PASS_TWO)[table]
    )
