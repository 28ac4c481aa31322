"""Truth of files into a database, and tracks judged by it."""

from __future__ import annotations

from pathlib import Path

from pipeline.calibrate.camera_entry import given_pose
from pipeline.core.camera_row import CameraRow, camera_rows
from pipeline.core.config import Config
from pipeline.core.errors import StoreError, UsageError, Where
from pipeline.core.exposure import Exposure
from pipeline.core.lens import intrinsics_of, lens_of
from pipeline.store.database import Store
from pipeline.store.matches import add_matches
from pipeline.store.recordings import add_diagnostics, list_recordings
from pipeline.truth.formats import read_truth
from pipeline.truth.judge import judge_tracking
from pipeline.truth.stored import AddedTruth, Surveyed, add_truth, places_by_survey


def add_truth_of_file(
    path: Path,
    database: Path,
    *,
    recording: str | None = None,
    camera: str | None = None,
    form: str = "auto",
    first_frame: int | None = None,
    survey: Config | None = None,
) -> AddedTruth:
    """Read truth from a file, and store it beside a recording; what was there of files is replaced.

    Args:
        path: the file.
        database: it holds the recording.
        recording: id or file name of the recording; None if there is one only.
        camera: name of the camera; None if the recording has one only.
        form: one of `formats.FORMS`, or auto.
        first_frame: the number of the recording's first frame in the file; None: as is usual there.
        survey: gives the surveyed pose of the camera, by which feet tell true depths.

    Raises:
        UsageError: the file is of no known form, or nothing in it belongs to the recording.
        StoreError: there is no such database.
    """
    if not database.is_file():
        raise StoreError("there is no such database", where=Where(database))
    truth = read_truth(path, form)
    with Store.open(database) as store:
        row = _recording(store, recording)
        of_camera = _camera(store, row["recording_id"], camera)
        surveyed = None if survey is None else _surveyed(of_camera, survey)
        with store.transaction():
            added = add_truth(
                store,
                row["recording_id"],
                of_camera.camera,
                path,
                truth,
                first_frame,
                surveyed,
            )
            add_diagnostics(
                store, added.notes, row["recording_id"], row["run_id"], row["file_name"]
            )
    return added


def match_again(store: Store, recording_id: str) -> None:
    """Match a recording with all truth that there is of it, and judge its tracks; in a transaction."""
    store.connection.execute("DELETE FROM matches WHERE recording_id = ?", [recording_id])
    add_matches(store, recording_id)
    judge_tracking(store, recording_id)


def _recording(store: Store, wanted: str | None) -> dict[str, str]:
    rows = list_recordings(store).to_pylist()
    if wanted is not None:
        rows = [r for r in rows if wanted in (r["recording_id"], r["file_name"], r["path"])]
    if len(rows) == 1:
        return dict(rows[0])
    known = ", ".join(r["file_name"] for r in list_recordings(store).to_pylist()[:20])
    raise UsageError(
        f"there is no recording {wanted!r}" if wanted and not rows else "which recording is it of?",
        where=Where(store.path),
        remedy=f"Give one with --recording: {known}",
    )


def _camera(store: Store, recording_id: str, wanted: str | None) -> CameraRow:
    rows = camera_rows(store.read("cameras", recording_id))
    found = [row for row in rows if wanted in (None, row.camera)]
    if len(found) == 1:
        return found[0]
    raise UsageError(
        f"there is no camera {wanted!r}" if wanted and not found else "which camera is it of?",
        where=Where(store.path),
        remedy=f"Give one with --camera-name: {', '.join(row.camera for row in rows[:20])}",
    )


def _surveyed(row: CameraRow, survey: Config) -> Surveyed:
    """Return the places of feet by a camera file's pose and lens."""
    entry = survey.camera_named(row.camera)
    plane = given_pose(entry, row)
    lens = row.intrinsics
    if row.size_px is not None:
        told, _, _ = intrinsics_of(
            None, entry, lens_of(Exposure(), entry, None, *row.size_px), *row.size_px
        )
        lens = told or lens
    if plane is None or lens is None:
        raise UsageError(
            f"the survey gives no pose or no lens of the camera {row.camera!r}",
            remedy="It is a camera file with camera_height_m, tilt_deg, roll_deg, fx_px, fy_px, cx_px "
            "and cy_px of this camera",
        )
    return places_by_survey(plane, lens)
