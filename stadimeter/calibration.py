"""Camera files fitted to stored recordings."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Literal, TypeAlias, overload

from pipeline.core.errors import CalibrationUndetermined, UsageError
from stadimeter.arguments import Camera, PathLike, config_of

if TYPE_CHECKING:
    from pipeline.calibrate.blur_floor import BlurFloor
    from pipeline.calibrate.walkers.known_lengths import KnownLengths
    from pipeline.run.calibration import FittedToTruth, Found

    Poses: TypeAlias = list[tuple[str, Found | CalibrationUndetermined]]
    Floors: TypeAlias = list[tuple[str, BlurFloor | CalibrationUndetermined]]

Pixels: TypeAlias = tuple[float, float, float, float]


@overload
def calibrate(
    db: PathLike,
    output: PathLike,
    *,
    by: Literal["truth"] = "truth",
    camera: Camera = None,
    methods: Sequence[str] | None = None,
    robust: bool = False,
    folds: int = 5,
    seed: int = 0,
    exclude: Iterable[str] = (),
) -> FittedToTruth: ...


@overload
def calibrate(
    db: PathLike,
    output: PathLike,
    *,
    by: Literal["walkers"],
    camera: Camera = None,
    known_heights_m: Mapping[int, float] | None = None,
    known_distances_m: Mapping[Pixels, float] | None = None,
    known_uprights_m: Mapping[Pixels, float] | None = None,
) -> Poses: ...


@overload
def calibrate(
    db: PathLike, output: PathLike, *, by: Literal["blur"], camera: Camera = None
) -> Floors: ...


def calibrate(
    db: PathLike,
    output: PathLike,
    *,
    by: Literal["truth", "walkers", "blur"] = "truth",
    camera: Camera = None,
    methods: Sequence[str] | None = None,
    robust: bool = False,
    folds: int = 5,
    seed: int = 0,
    exclude: Iterable[str] = (),
    known_heights_m: Mapping[int, float] | None = None,
    known_distances_m: Mapping[Pixels, float] | None = None,
    known_uprights_m: Mapping[Pixels, float] | None = None,
) -> FittedToTruth | Poses | Floors:
    """Fit a camera file to the recordings of a database; write what was found.

    Args:
        db: database that `measure` made.
        output: camera file to write; what it holds already is kept.
        by: `truth` fits k, sizes and the inverse model to ground truth; `walkers` finds the pose, and
            the focal length where it is unknown, from people who walk; `blur` finds the softness of
            the camera itself.
        camera: camera file to start from, or a `Config`; None takes the defaults.
        methods: by truth, the methods to fit, of `aperture`, `size` and `inverse`; None fits all.
        robust: by truth, fit with Tukey's bisquare.
        folds: by truth, number of parts of the k-fold errors, at least 2.
        seed: by truth, seed of the division into parts.
        exclude: by truth, ids of objects whose truth or box is known to be wrong.
        known_heights_m: by walkers, statures in metres with shoes, by track id.
        known_distances_m: by walkers, distances in metres between two points on the ground, by their
            pixels (x, y, x, y).
        known_uprights_m: by walkers, heights in metres of what stands upright on the ground, by the
            pixels of its foot and of its upper end (x, y, x, y).

    Returns:
        By truth, calibrations, size priors and refused fits. By walkers and by blur, a list of pairs:
        the name of a camera, and what was found of it or the error that says why nothing was.

    Raises:
        StoreError: the database does not exist, or cannot be written.
        CalibrationUndetermined: no recording has truth that determines anything, or no prior.
        UsageError: an argument is impossible, or does not belong to `by`.
    """
    from pipeline.core.calibration import CalibratedMethod
    from pipeline.run import calibration

    if folds < 2:
        raise UsageError(f"the number of folds must be at least 2, not {folds}")
    if (known_heights_m or known_distances_m or known_uprights_m) and by != "walkers":
        raise UsageError("known heights and lengths belong to a calibration by walkers")
    config = config_of(camera)
    if by == "walkers":
        known = _known(known_heights_m or {}, known_distances_m or {}, known_uprights_m or {})
        return calibration.calibrate_stored_walkers(Path(db), Path(output), config, known)
    if by == "blur":
        return calibration.calibrate_stored_blur(Path(db), Path(output), config)
    if by != "truth":
        raise UsageError(f"a calibration is by truth, walkers or blur, not by {by}")
    known_methods = [method.value for method in CalibratedMethod]
    for name in methods or ():
        if name not in known_methods:
            raise UsageError(
                f"no method {name!r} is fitted to truth; {', '.join(known_methods)} are"
            )
    options = calibration.TruthOptions(
        methods=[CalibratedMethod(name) for name in methods or known_methods],
        robust=robust,
        folds=folds,
        seed=seed,
        exclude=frozenset(exclude),
    )
    return calibration.calibrate_stored_truth(Path(db), Path(output), config, options)


def _known(
    heights_m: Mapping[int, float],
    distances_m: Mapping[Pixels, float],
    uprights_m: Mapping[Pixels, float],
) -> KnownLengths:
    from pipeline.calibrate.walkers.known_lengths import KnownHeight, KnownLengths
    from pipeline.core.records import KnownLength

    lengths = [
        KnownLength(tuple(map(float, pixels)), length_m, upright=upright)
        for lengths_m, upright in ((distances_m, False), (uprights_m, True))
        for pixels, length_m in lengths_m.items()
    ]
    heights = [KnownHeight(track, height_m) for track, height_m in heights_m.items()]
    return KnownLengths(tuple(heights), tuple(lengths))
