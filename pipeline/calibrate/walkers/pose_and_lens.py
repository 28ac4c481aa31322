"""The pose of a stored camera from walkers, with its lens where nothing tells that."""

from __future__ import annotations

from dataclasses import dataclass, replace

from pipeline.calibrate.walkers.focal_length import calibrate_lens_from_walkers
from pipeline.calibrate.walkers.known_lengths import NOTHING_KNOWN, KnownLengths
from pipeline.calibrate.walkers.lens_check import DOUBTFUL, LensCheck, check_lens
from pipeline.calibrate.walkers.pose import WalkersReport, fit_walkers
from pipeline.calibrate.walkers.walker_veto import check_walkers
from pipeline.core.arrays import FloatArray
from pipeline.core.camera_row import CameraRow
from pipeline.core.config import SizePrior
from pipeline.core.records import FoundLens, GroundPlane
from pipeline.estimate.types import Measured


@dataclass(frozen=True, slots=True)
class Calibrated:
    """Pose and lens of a camera by its walkers."""

    plane: GroundPlane
    report: WalkersReport
    lens: FoundLens | None = None  # where nothing else told it
    contradiction: LensCheck | None = None  # of the lens that was told


def calibrate_stored(
    measured: Measured,
    row: CameraRow,
    prior: SizePrior,
    known: KnownLengths = NOTHING_KNOWN,
    lines_px: FloatArray | None = None,
) -> Calibrated:
    """Return the pose of a stored camera and, if nothing tells it, the lens.

    Args:
        measured: the observations of one camera.
        row: the camera, of the table `cameras`.
        prior: as in `calibrate_from_walkers`, like the rest.
        known: what is known in metres.
        lines_px: straight edges.

    Raises:
        NotWalkers: the tracks are not of people who walk; not asked where a person's height is known.
        CalibrationUndetermined: as `calibrate_from_walkers`.
    """
    made = _calibrated(measured, row, prior, known, lines_px)
    if not known.heights:
        lens = made.lens.intrinsics if made.lens else measured.intrinsics
        check_walkers(replace(measured, intrinsics=lens), prior.object_class, made.plane)
    return made


def _calibrated(
    measured: Measured,
    row: CameraRow,
    prior: SizePrior,
    known: KnownLengths,
    lines_px: FloatArray | None,
) -> Calibrated:
    """Return what `calibrate_stored` does, whoever walks."""
    if not known.heights:
        check_walkers(measured, prior.object_class)
    if measured.intrinsics is None and row.size_px is not None:
        lens, plane, report = calibrate_lens_from_walkers(
            measured, row.size_px, prior, known, lines_px
        )
        return Calibrated(plane, report, lens)
    fitted = fit_walkers(measured, prior, known, lines_px)
    plane, report = fitted.result()
    check = check_lens(fitted)
    if check is None or not check.contradicts:
        return Calibrated(plane, report)
    if row.intrinsics_source == DOUBTFUL:
        plane = check.widened(plane)
    return Calibrated(plane, report, contradiction=check)
