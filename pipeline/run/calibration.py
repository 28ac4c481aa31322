"""`stadimeter calibrate`: stored recordings become a camera file, and rows in `calibrations`."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from pipeline import __version__
from pipeline.calibrate.blur_floor import BlurFloor, calibrate_blur_floor, combined
from pipeline.calibrate.camera_entry import as_given
from pipeline.calibrate.stored_lens import known_lens
from pipeline.calibrate.truth.fit import (
    calibrate_from_truth,
    prior_as_calibration,
    says_nothing,
    size_priors_from_truth,
)
from pipeline.calibrate.truth.table import truth_table
from pipeline.calibrate.walkers.known_lengths import NOTHING_KNOWN, KnownLengths
from pipeline.calibrate.walkers.pose_and_lens import Calibrated, calibrate_stored
from pipeline.core.calibration import CalibratedMethod, Calibration
from pipeline.core.camera_file import write_camera_file
from pipeline.core.camera_row import CameraRow, camera_rows
from pipeline.core.config import ADULT, CameraConfig, Config, KnownPerson, SizePrior
from pipeline.core.errors import CalibrationUndetermined, StoreError, UsageError, Where
from pipeline.core.records import Diagnostic, FoundLens, GroundPlane
from pipeline.estimate.tables import calibrations_table, measured_by_camera
from pipeline.estimate.types import Measured
from pipeline.run.recordings import describe, library_versions
from pipeline.run.standing_part import in_standing_part
from pipeline.run.stored_camera import StoredCamera, lines_of
from pipeline.store.database import Store
from pipeline.store.estimates import add_calibrations
from pipeline.store.recordings import list_recordings
from pipeline.store.runs import finish_run, start_run
from pipeline.store.track_rows import tracks_of


@dataclass(frozen=True, slots=True)
class TruthOptions:
    """Options of fits of calibrations to truth."""

    methods: Sequence[CalibratedMethod]
    robust: bool = False
    folds: int = 5
    seed: int = 0
    exclude: frozenset[str] = frozenset()  # object ids whose rows are known to be wrong


@dataclass(frozen=True, slots=True)
class FittedToTruth:
    """Results of fits to truth: calibrations and size priors to use, and fits that say nothing."""

    calibrations: list[Calibration]
    priors: list[SizePrior]
    refused: list[Calibration]

    @property
    def rows(self) -> list[Calibration]:
        """All that is kept, as the table `calibrations` takes it."""
        return [*self.calibrations, *map(prior_as_calibration, self.priors)]


def calibrate_stored_truth(
    database: Path, camera_file: Path, config: Config, options: TruthOptions
) -> FittedToTruth:
    """Fit calibrations to all stored recordings with truth; write them to the file and the store.

    Raises:
        StoreError: the database does not exist.
        CalibrationUndetermined: no recording has truth that determines anything.
    """
    with _writable(database) as store:
        table = pa.concat_tables(
            [truth_table(i, *_tables(store, i)) for i in _recording_ids(store)] or [_NO_TRUTH]
        )
        if options.exclude and table.num_rows:
            keep = [o not in options.exclude for o in table["object_id"].to_pylist()]
            table = table.filter(pa.array(keep))
        if table.num_rows == 0:
            raise CalibrationUndetermined(
                "no stored recording has observations with truth",
                where=Where(database),
                remedy="Run recordings that hold stadimeter.GroundTruth messages first",
            )
        found = calibrate_from_truth(
            table,
            options.methods,
            robust=options.robust,
            folds=options.folds,
            seed=options.seed,
        )
        refused = [c for c in found if says_nothing(c, table)]
        kept = [c for c in found if c not in refused]
        fitted = FittedToTruth(kept, size_priors_from_truth(table), refused)
        if not fitted.rows:
            raise CalibrationUndetermined(
                "no fit predicts left-out depths better than their mean", where=Where(database)
            )
        sampled = {(p.object_class, p.dimension) for p in fitted.priors}
        others = [p for p in config.size_prior if (p.object_class, p.dimension) not in sampled]
        priors = (*fitted.priors, *others)
        write_camera_file(camera_file, replace(config, calibration=tuple(kept), size_prior=priors))
        run_id = _start(store, config)
        with store.transaction():
            add_calibrations(store, calibrations_table(fitted.rows), run_id)
        finish_run(store, run_id)
    return fitted


@dataclass(frozen=True, slots=True)
class Found:
    """Results from walkers for one camera: its pose and, where nothing told it, its lens."""

    plane: GroundPlane
    lens: FoundLens | None = None
    contradiction: Diagnostic | None = None  # of the lens that was told


def calibrate_stored_walkers(
    database: Path, camera_file: Path, config: Config, known: KnownLengths = NOTHING_KNOWN
) -> list[tuple[str, Found | CalibrationUndetermined]]:
    """Find the pose of every camera from the people who walked before it, in all its recordings together.

    Returns the pose of each camera, or why it is not determined; what was found is written.

    Raises:
        StoreError: the database does not exist.
        UsageError: something is known, but there are several recordings or cameras, so that the number
            of a track or a pixel says nothing; or it makes no sense.
    """
    if config.stature is None:
        raise CalibrationUndetermined(
            "the camera file has no size_prior on the height of people",
            remedy="Add one, or leave out size_prior for that of adults",
        )
    lengths = known.lengths
    results: list[tuple[str, Found | CalibrationUndetermined]] = []
    cameras: list[CameraConfig] = []
    with _writable(database) as store:
        ids = _recording_ids(store)
        _check_single(known, len(ids))
        for recording_id in ids:
            results += _of_recording(store, recording_id, config, known)
    for name in dict.fromkeys(name for name, _ in results):
        found = [f for n, f in results if n == name and isinstance(f, Found)]
        if found:
            lens, planes = _one_lens(found)
            people = tuple(
                KnownPerson(ids[0], p.track_id, p.height_m, p.std_m) for p in known.heights
            )
            entry = as_given(name, _combined(planes), lens)
            cameras.append(replace(entry, known_person=people, known_length=lengths))
    if cameras:
        write_camera_file(camera_file, replace(config, camera=tuple(cameras)))
    return results


def calibrate_stored_blur(
    database: Path, camera_file: Path, config: Config
) -> list[tuple[str, BlurFloor | CalibrationUndetermined]]:
    """Find how soft every camera is by itself, all its recordings taken together; write what was found.

    Raises:
        StoreError: the database does not exist.
    """
    found: dict[str, list[BlurFloor]] = {}
    refused: dict[str, CalibrationUndetermined] = {}
    with _writable(database) as store:
        for recording_id in _recording_ids(store):
            observations, frames, rows, matches = _tables(store, recording_id)
            depth_m = dict(
                zip(
                    matches["observation_index"].to_pylist(),
                    matches["true_depth_m"].to_pylist(),
                    strict=True,
                )
            )
            for measured in measured_by_camera(observations, frames, rows, {}):
                index = measured.observation_index.tolist()
                true_m = np.array([depth_m.get(i) for i in index], dtype=np.float64)
                try:
                    floor = calibrate_blur_floor(measured, true_m)
                except CalibrationUndetermined as error:
                    refused[measured.camera] = error
                else:
                    found.setdefault(measured.camera, []).append(floor)
    floors = {name: combined(several) for name, several in found.items()}
    if floors:
        cameras = tuple(
            CameraConfig(name, blur_floor_px=f.floor_px, blur_floor_std_px=f.std_px)
            for name, f in floors.items()
        )
        write_camera_file(camera_file, replace(config, camera=cameras))
    return [*floors.items(), *((n, e) for n, e in refused.items() if n not in floors)]


def _check_single(known: KnownLengths, count: int) -> None:
    if known and count > 1:
        raise UsageError(
            "a known height or length belongs to one camera of one recording",
            remedy="Run that recording alone into a database of its own",
        )


def _combined(planes: list[GroundPlane]) -> GroundPlane:
    """Return the precision-weighted mean of a camera's poses; it is fixed, so they are one pose.

    What the recordings share, the uncertainty of the population's mean, is counted again with each:
    the combined deviation is never below that of the best of them divided by the root of two.
    """
    if len(planes) == 1:
        return planes[0]
    weights = [np.linalg.inv(p.covariance) for p in planes]
    total = np.linalg.inv(sum(weights))
    poses = [np.array([p.camera_height_m, p.tilt_rad, p.roll_rad]) for p in planes]
    mean = total @ sum(w @ pose for w, pose in zip(weights, poses, strict=True))
    best = min((p.covariance for p in planes), key=lambda c: float(c[0, 0]))
    covariance = total if total[0, 0] > best[0, 0] / 2 else best / 2
    above_m, tilt_rad, roll_rad = (float(v) for v in mean)
    return GroundPlane(above_m, tilt_rad, roll_rad, covariance, "walkers")


def _one_lens(found: list[Found]) -> tuple[FoundLens | None, list[GroundPlane]]:
    """Return the lens of a camera and the poses that go with it.

    A pose and a focal length that were found together err together, so the poses are not averaged with
    another focal length: the recording that tells the focal length best is taken alone.
    """
    lenses = [f for f in found if f.lens is not None]
    if not lenses:
        return None, [f.plane for f in found]
    best = min(lenses, key=_relative)
    return best.lens, [best.plane]


def _relative(found: Found) -> float:
    return found.lens.std_px / found.lens.intrinsics.fx_px if found.lens else math.inf


def _of_recording(
    store: Store, recording_id: str, config: Config, known: KnownLengths
) -> Iterator[tuple[str, Found | CalibrationUndetermined]]:
    """Yield what walkers gave of each camera of a recording that saw anything."""
    edges = store.read("background_lines", recording_id)
    tracks = tracks_of(store, recording_id, (config.stature or ADULT).object_class)
    seen = set(pc.unique(tracks["camera"]).to_pylist())
    _check_single(known, len(seen))
    for row in camera_rows(store.read("cameras", recording_id)):
        name = row.camera
        config = config.naming(name, row.topic)
        if name not in seen:
            continue
        lens = known_lens(row, _unposed(config.camera_named(name)))
        camera = StoredCamera(store, recording_id, lens)
        prior = config.of_camera(name).stature or ADULT
        stated = config.camera_named(name).known_length
        here = replace(known, lengths=(*stated, *known.lengths))
        try:
            mine = tracks.filter(pc.equal(tracks["camera"], name))
            mine = mine.filter(in_standing_part(store, recording_id, name, mine))
            measured = _people(camera, mine, here)
            made = calibrate_stored(measured, lens, prior, here, lines_of(edges, name))
        except CalibrationUndetermined as error:
            yield name, error
        else:
            yield name, _found(made, name, lens)


def _people(camera: StoredCamera, tracks: pa.Table, known: KnownLengths) -> Measured:
    measured = camera.people(tracks, [person.track_id for person in known.heights])
    if measured is None:
        raise CalibrationUndetermined(
            "no people walk before the camera", remedy="Give its pose, or a recording with people"
        )
    return measured


def _found(made: Calibrated, camera: str, row: CameraRow) -> Found:
    doubt = made.contradiction
    said = doubt.describe(camera, row.intrinsics_source or "") if doubt else None
    return Found(made.plane, made.lens, said)


def _unposed(camera: CameraConfig) -> CameraConfig:
    """Return the entry of a camera without the pose, which is looked for anew."""
    return replace(camera, camera_height_m=math.nan)


def _writable(database: Path) -> Store:
    if not database.is_file():
        raise StoreError(
            "there is no such database", where=Where(database), remedy="`stadimeter run` makes one"
        )
    return Store.open(database, roomy=True)


def _recording_ids(store: Store) -> list[str]:
    return [row["recording_id"] for row in list_recordings(store).to_pylist()]


def _tables(store: Store, recording_id: str) -> tuple[pa.Table, pa.Table, pa.Table, pa.Table]:
    names = ("observations", "frames", "cameras", "matches")
    first, second, third, fourth = (store.read(name, recording_id) for name in names)
    return first, second, third, fourth


def _start(store: Store, config: Config) -> str:
    return start_run(store, "calibrate", None, describe(config), library_versions(), __version__)


_NO_TRUTH = pa.table({"object_id": pa.array([], pa.string())})
