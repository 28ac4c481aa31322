"""`stadimeter calibrate`: a camera file fitted to truth, to people who walk, or to blur."""

from __future__ import annotations

import argparse
import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from pipeline.cli.console import err, out, print_rows, progress_lines, safe
from pipeline.cli.exit_codes import DONE, FAILED
from pipeline.cli.options import Commands, add_database
from pipeline.core.errors import CalibrationUndetermined, StadimeterError, UsageError

T = TypeVar("T")

if TYPE_CHECKING:
    from stadimeter import BlurFloor, Calibration, FittedToTruth, Found


def add(commands: Commands) -> None:
    """Add the command and its arguments to the parser."""
    parser = commands.add_parser(
        "calibrate", help="fit a camera file to truth, to people who walk, or to blur"
    )
    parser.add_argument(
        "recordings", nargs="*", type=Path, metavar="RECORDING", help="run these first"
    )
    add_database(parser)
    parser.add_argument(
        "-o", "--output", type=Path, required=True, metavar="TOML", help="camera file to write"
    )
    parser.add_argument("--camera", type=Path, metavar="TOML", help="camera file for the run")
    parser.add_argument(
        "--walkers", action="store_true", help="find the camera's pose from people who walk"
    )
    parser.add_argument(
        "--blur",
        action="store_true",
        help="find the camera's own softness from aperture sweeps, truth, or its sharpest objects",
    )
    parser.add_argument(
        "--method",
        action="append",
        choices=("aperture", "size", "inverse"),
        help="fit this one (again for more; default: all three)",
    )
    parser.add_argument("--robust", action="store_true", help="bisquare fits")
    parser.add_argument("--folds", type=int, default=5, metavar="N", help="of the k-fold figures")
    parser.add_argument("--seed", type=int, default=0, help="of the folds")
    parser.add_argument(
        "--exclude",
        action="append",
        default=[],
        metavar="OBJECT_ID",
        help="leave out an object whose truth or box is known to be wrong",
    )
    parser.add_argument(
        "--known-height",
        action="append",
        default=[],
        metavar="TRACK=M",
        help="with --walkers: how tall a track's person is, with shoes; overrides the population",
    )
    parser.add_argument(
        "--known-distance",
        action="append",
        default=[],
        metavar="X,Y,X,Y=M",
        help="with --walkers: how far apart two points on the ground are, given in pixels",
    )
    parser.add_argument(
        "--known-upright",
        action="append",
        default=[],
        metavar="X,Y,X,Y=M",
        help="with --walkers: how tall a post or a door is, given by the pixels of its foot and its top",
    )
    parser.set_defaults(function=call)


def call(arguments: argparse.Namespace) -> int:
    """Run the command; return its exit code."""
    import stadimeter

    if arguments.walkers and arguments.blur:
        raise UsageError("--walkers and --blur are two calibrations: one after the other")
    heights_m = _known_heights_m(arguments.known_height)
    distances_m = _known_lengths_m("--known-distance", arguments.known_distance)
    uprights_m = _known_lengths_m("--known-upright", arguments.known_upright)
    if (heights_m or distances_m or uprights_m) and not arguments.walkers:
        raise UsageError("--known-height, --known-distance and --known-upright belong to --walkers")
    camera, output = arguments.camera, arguments.output
    if arguments.recordings:
        with progress_lines() as progress:
            result = stadimeter.measure(
                arguments.recordings, arguments.db, camera=camera, strict=False, progress=progress
            )
        for outcome in result.failed:
            raise outcome.error or StadimeterError(f"{outcome.path} could not be read")
    if arguments.blur:
        floors = stadimeter.calibrate(arguments.db, output, by="blur", camera=camera)
        found = print_blur_floors(floors)
    elif arguments.walkers:
        poses = stadimeter.calibrate(
            arguments.db,
            output,
            by="walkers",
            camera=camera,
            known_heights_m=heights_m,
            known_distances_m=distances_m,
            known_uprights_m=uprights_m,
        )
        found = print_poses(poses)
    else:
        fitted = stadimeter.calibrate(
            arguments.db,
            output,
            camera=camera,
            methods=arguments.method,
            robust=arguments.robust,
            folds=arguments.folds,
            seed=arguments.seed,
            exclude=arguments.exclude,
        )
        found = print_calibrations(fitted)
    if found:
        out.print(f"camera file  {safe(output)}", soft_wrap=True)
    return DONE if found else FAILED


def _known_heights_m(texts: list[str]) -> dict[int, float]:
    """Return statures in metres by track."""
    heights_m: dict[int, float] = {}
    for text in texts:
        try:
            track, _, height = text.partition("=")
            heights_m[int(track)] = float(height)
        except ValueError as error:
            raise UsageError(
                f"--known-height {text!r} is no TRACK=METRES, such as 12=1.80"
            ) from error
    return heights_m


def _known_lengths_m(
    option: str, texts: list[str]
) -> dict[tuple[float, float, float, float], float]:
    """Return lengths in metres by the pixels of their ends."""
    lengths_m: dict[tuple[float, float, float, float], float] = {}
    for text in texts:
        try:
            points, _, length = text.partition("=")
            x0_px, y0_px, x1_px, y1_px = (float(value) for value in points.split(","))
            lengths_m[x0_px, y0_px, x1_px, y1_px] = float(length)
        except ValueError as error:
            raise UsageError(
                f"{option} {text!r} is no X,Y,X,Y=METRES, such as 310,420,505,433=4.2"
            ) from error
    return lengths_m


def print_calibrations(fitted: FittedToTruth) -> int:
    """Print fitted parameters with standard errors, errors in and out of sample, what is refused."""
    rows = []
    for c in fitted.rows:
        for p in c.parameters:
            at = "" if math.isnan(p.f_number) else f"f/{p.f_number:g}"
            std = "" if math.isnan(p.std_error) else f"± {p.std_error:.2g}"
            rows.append(
                [c.camera, c.object_class, c.dimension, c.method, p.name, at, f"{p.value:.5g}", std]
            )
    header = ("camera", "class", "side", "method", "parameter", "at", "value", "std error")
    print_rows("Fitted", header, rows)
    names = ("camera", "class", "method", "rows", "range m", *_IN_AND_OUT, "source")
    print_rows("Errors", names, [_errors_row(c) for c in fitted.calibrations])
    if fitted.refused:
        title = "Not written: left-out depths are predicted no better than by their mean"
        print_rows(title, names, [_errors_row(c) for c in fitted.refused])
    return len(fitted.rows)


_IN_AND_OUT = ("fit RMSE cm", "leave-one-out cm", "k-fold cm")


def _errors_row(c: Calibration) -> list[str]:
    return [
        c.camera,
        c.object_class,
        c.method,
        f"{c.observation_count:,}",
        f"{c.depth_min_m:.2f}-{c.depth_max_m:.2f}",
        *(f"{100 * v:.2f}" for v in (c.fit_rmse_m, c.loo_rmse_m, c.kfold_rmse_m)),
        c.source,
    ]


def _determined(
    results: Sequence[tuple[str, T | CalibrationUndetermined]],
) -> Iterator[tuple[str, T]]:
    """Yield what was found of each camera; say of the others why nothing was."""
    for camera, result in results:
        if isinstance(result, CalibrationUndetermined):
            err.print(f"stadimeter: {safe(camera)}: {safe(result)}", soft_wrap=True)
        else:
            yield camera, result


def print_poses(
    results: Sequence[tuple[str, Found | CalibrationUndetermined]],
) -> int:
    """Print the pose of each camera, or why it is not determined; return how many are."""
    rows = []
    for camera, result in _determined(results):
        plane, lens = result.plane, result.lens
        if result.contradiction is not None:
            message = safe(result.contradiction.message)
            err.print(f"stadimeter: {safe(camera)}: {message}", soft_wrap=True)
        height_std_m, tilt_std, roll_std = (1.96 * v**0.5 for v in plane.covariance.diagonal())
        focal = f"{lens.intrinsics.fx_px:.0f} ± {1.96 * lens.std_px:.0f}" if lens else "as given"
        rows.append(
            [
                camera,
                f"{plane.camera_height_m:.2f} ± {height_std_m:.2f}",
                f"{math.degrees(plane.tilt_rad):.2f} ± {math.degrees(tilt_std):.2f}",
                f"{math.degrees(plane.roll_rad):.2f} ± {math.degrees(roll_std):.2f}",
                focal,
            ]
        )
    if rows:
        header = ("camera", "height m (95 %)", "tilt degrees", "roll degrees", "focal length px")
        print_rows("Poses from the people who walk, one for each recording", header, rows)
    return len(rows)


def print_blur_floors(
    results: Sequence[tuple[str, BlurFloor | CalibrationUndetermined]],
) -> int:
    """Print how soft each camera is by itself, or why it is not known; return how many are."""
    rows = []
    for camera, result in _determined(results):
        size = f"{result.floor_px:.2f} ± {1.96 * result.std_px:.2f}"
        rows.append([camera, size, result.source, f"{result.count:,}"])
    if rows:
        header = ("camera", "softness px (95 %)", "by", "observations")
        print_rows("Blur of the cameras themselves, without diffraction", header, rows)
    return len(rows)
