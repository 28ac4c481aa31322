"""Known lengths of a scene in metres, beside the people who walk there: the scale of a pose."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pipeline.calibrate.walkers.model import Sample, Scale
from pipeline.calibrate.walkers.pose_prior import PosePrior
from pipeline.calibrate.walkers.segments import Segments, ends_px
from pipeline.calibrate.walkers.upright_edges import Uprights, bend_std_of
from pipeline.core.arrays import FloatArray
from pipeline.core.config import SizePrior
from pipeline.core.errors import UsageError
from pipeline.core.records import GroundPlane, KnownLength
from pipeline.estimate.boxes.geometry import COMMON_SHARE
from pipeline.estimate.gait import GAIT_DROP_M, GAIT_DROP_STD_M
from pipeline.estimate.types import Measured

# A walker's head rises and falls by about 2 cm either side, and the box's foot is now one foot, now
# the other (Whittle, Gait Analysis: vertical excursion of the trunk 46 mm).
GAIT_STD = 0.02  # of the stature
USUAL_M = 1.7
LONGEST_M = 1e4  # the ground is a plane no farther


@dataclass(frozen=True, slots=True)
class KnownHeight:
    """The height of one person when standing, with shoes."""

    track_id: int
    height_m: float
    std_m: float = 0.01


@dataclass(frozen=True, slots=True)
class KnownLengths:
    """Known lengths of a scene in metres, beside the stature of the population.

    `pose` is what somebody gave of the camera's pose, as sure as its covariance says.
    """

    heights: tuple[KnownHeight, ...] = ()
    lengths: tuple[KnownLength, ...] = ()
    pose: GroundPlane | None = None

    def __bool__(self) -> bool:
        return bool(self.heights or self.lengths)


NOTHING_KNOWN = KnownLengths()


def check_inside(points_px: FloatArray, measured: Measured) -> None:
    """Refuse points that are not in the camera's pictures."""
    lens = measured.intrinsics
    if lens is None:
        return
    size_px = (lens.width_px, lens.height_px)
    if not ((points_px >= -0.5) & (points_px <= np.array(size_px) - 0.5)).all():
        raise UsageError(
            f"a point of a known length lies outside of the pictures of {size_px[0]} x {size_px[1]} px"
        )


def check_known(known: KnownLengths, measured: Measured) -> None:
    """Refuse what is known if it makes no sense."""
    for person in known.heights:
        if not (measured.track_id == person.track_id).any():
            raise UsageError(f"there is no track {person.track_id} of camera {measured.camera!r}")
        if not (0.2 < person.height_m < 3.0 and person.std_m > 0):
            raise UsageError(f"no person is {person.height_m} m tall")
    for length in known.lengths:
        _check_length(length, measured)


def _check_length(known: KnownLength, measured: Measured) -> None:
    points_px = ends_px(known)
    if not np.ptp(points_px, axis=0).max() > 1:
        raise UsageError("a known length needs two points that are apart, and its length")
    if known.upright and not points_px[0, 1] > points_px[1, 1]:
        raise UsageError(
            "the first point of an upright length must be its foot, below the second in the picture"
        )
    if not 0 < known.length_m <= LONGEST_M:
        raise UsageError(
            f"a known length of {known.length_m:g} m: it must be more than 0 and at most "
            f"{LONGEST_M:g} m"
        )
    check_inside(points_px, measured)


def scale_of(
    sample: Sample,
    prior: SizePrior,
    known: KnownLengths,
    measured: Measured,
    uprights: Uprights,
    plane: GroundPlane | None = None,
) -> Scale:
    """Return what is known beside the tracks; the pose, if there is one already, weighs marks."""
    mean_m, std_m = np.full((2, sample.people), [[prior.walking_mean_m], [prior.std_m]])
    of_population = np.ones(sample.people, dtype=np.bool_)
    for person in known.heights:
        mine = sample.track_id == person.track_id
        mean_m[mine], of_population[mine] = person.height_m - GAIT_DROP_M, False
        std_m[mine] = np.linalg.norm([person.std_m, GAIT_DROP_STD_M, _own_box_std_m(sample, mine)])
    # Beside what is known here the population still says something: one person's boxes may be off all
    # along, and a mark misplaced.
    return Scale(
        mean_m,
        std_m,
        of_population,
        float(prior.mean_uncertainty_m / prior.mean_m),
        Segments.of(known.lengths, measured.intrinsics, plane),
        uprights,
        bend_std_of(measured.intrinsics),
        None if known.pose is None else PosePrior.of(known.pose),
    )


def _own_box_std_m(sample: Sample, person: npt.NDArray[np.bool_]) -> float:
    """Return how far all boxes of a person may be off together, in metres."""
    rows = person[sample.track]
    tall = np.maximum(sample.foot[rows, 1] - sample.head[rows, 1], 1e-9)
    noise = np.sqrt(np.maximum((sample.sigma[rows] / tall) ** 2 - GAIT_STD**2, 0.0))
    return float(USUAL_M * COMMON_SHARE * np.median(noise)) if rows.any() else 0.0
