"""Depths by size and by all methods beside the plain size prior, by range, on simulated cameras.

    python -m bench.size_prior [--cameras 40]

The plain prior is similar triangles, H / angle, with the mean stature and no tilt: what a method that
knows more must not be worse than. Crowds of a few people, whose pose is not found, and of twenty, whose
pose is. Crowds are of countries, one a camera, so that all depths of a camera are off together.
"""

from __future__ import annotations

import argparse
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from bench.walkers import Scene, scene
from pipeline.calibrate.walkers.pose import calibrate_from_walkers
from pipeline.calibrate.walkers.tilt import tilt_of_people
from pipeline.cli.console import print_rows
from pipeline.core.arrays import FloatArray
from pipeline.core.config import ADULT, CameraConfig, Config
from pipeline.core.errors import CalibrationUndetermined
from pipeline.estimate.boxes.quality import assess
from pipeline.estimate.boxes.reach import with_reach
from pipeline.estimate.estimate_tracks import fuse
from pipeline.estimate.methods import GROUND, ground, size

EDGES_M = np.array([0.0, 8.0, 12.0, 16.0, 24.0, np.inf])
FEW, MANY = 3, 20
PLAIN, NO_TILT, BY_SIZE, BY_ALL = "plain prior", "size, tilt unknown", "size", "fused"


@dataclass(frozen=True, slots=True)
class Depths:
    """True depths of one camera's boxes, (n,), and relative errors of each method."""

    true_m: FloatArray
    error: dict[str, FloatArray]
    inside: dict[str, FloatArray]  # whether the 95 % interval holds the truth

    def by_range(self, method: str) -> FloatArray:
        """Return the mean error between `EDGES_M`, (5,); NaN where nothing is."""
        at = np.digitize(self.true_m, EDGES_M) - 1
        error = self.error[method]
        means = [
            error[(at == i) & np.isfinite(error)].mean() if (at == i).any() else np.nan
            for i in range(len(EDGES_M) - 1)
        ]
        return np.array(means)


def of_few(simulated: Scene) -> Depths:
    """Return the depths of people who fix no pose: without a tilt, and with that by the people."""
    geometry = with_reach(assess(simulated.measured).applied(simulated.measured))
    config = Config()
    tilt = tilt_of_people(simulated.measured, ADULT)
    if tilt is not None:
        tilt_deg, std_deg = np.rad2deg([tilt.tilt_rad, tilt.std_rad])
        name = simulated.measured.camera
        told = CameraConfig(name, tilt_deg=float(tilt_deg), tilt_std_deg=float(std_deg))
        config = replace(config, camera=(told,))
    found = {NO_TILT: size.estimate(geometry, Config()), BY_SIZE: size.estimate(geometry, config)}
    depth_m = {name: (e.depth_m, e.depth_std_m) for name, e in found.items()}
    return _depths(simulated, geometry.height_angle, depth_m)


def of_many(simulated: Scene) -> Depths:
    """Return the depths of people whose walks fix the pose.

    Raises:
        CalibrationUndetermined: they do not.
    """
    plane, _ = calibrate_from_walkers(simulated.measured, ADULT)
    measured = replace(simulated.measured, ground_plane=plane)
    quality, config = assess(measured), Config()
    geometry = ground.with_scatter(with_reach(quality.applied(measured)), config)
    members = {
        GROUND: ground.estimate(geometry, config),
        BY_SIZE: size.estimate(geometry, config),
    }
    fused, _, _ = fuse(geometry, members, quality, config)
    found = members | {BY_ALL: fused}
    depth_m = {name: (e.depth_m, e.depth_std_m) for name, e in found.items()}
    return _depths(simulated, geometry.height_angle, depth_m)


def _depths(
    simulated: Scene, angle: FloatArray, found: dict[str, tuple[FloatArray, FloatArray]]
) -> Depths:
    true_m = simulated.true_depth_m
    error = {PLAIN: np.abs(ADULT.mean_m / angle / true_m - 1)}
    inside = {}
    for name, (depth_m, std_m) in found.items():
        error[name] = np.abs(depth_m / true_m - 1)
        inside[name] = (np.abs(depth_m - true_m) < 1.96 * std_m).astype(np.float64)
    return Depths(true_m, error, inside)


def compared(cameras: int, people: int, seed: int = 3) -> list[Depths]:
    """Return the depths of a number of cameras; those whose pose is not found are left out of many."""
    random = np.random.default_rng(seed)
    found = []
    for _ in range(cameras):
        simulated = scene(random, people, bad_share=0.0)
        with suppress(CalibrationUndetermined):
            found.append(of_few(simulated) if people <= FEW else of_many(simulated))
    return found


def mean_by_range(found: list[Depths], method: str) -> FloatArray:
    """Return the mean over cameras of a method's error at each range, (5,)."""
    return np.asarray(np.nanmean([depths.by_range(method) for depths in found], axis=0))


def main() -> None:
    """Print errors by range."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--cameras", type=int, default=40)
    arguments, _ = parser.parse_known_args()
    rows = []
    for title, people in (("no pose", FEW), ("pose from walkers", MANY)):
        found = compared(arguments.cameras, people)
        for method in found[0].error:
            held = [np.nanmean(d.inside[method]) for d in found if method in d.inside]
            cells = [f"{100 * error:.1f}" for error in mean_by_range(found, method)]
            rows.append([title, method, *cells, f"{100 * np.mean(held):.0f}" if held else ""])
    ranges = [f"{low:g}-{high:g} m" for low, high in pairwise(EDGES_M)]
    print_rows("Mean error of depth, %", ("", "method", *ranges, "in 95 %"), rows)


if __name__ == "__main__":
    main()
