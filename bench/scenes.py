"""Depth and height of walking people, from pictures alone: simulated cameras through the real `run`.

    python -m bench.scenes --each

Every camera is another seed of `recordings.simulate_walkers`: its pose, lens, place and crowd. The
recording goes through detection, tracking, self-calibration and estimation as any other, and what
comes out is compared with the truth. To tell causes apart the same recordings are worked four ways:
boxes by the motion detector, or the true silhouettes; the pose found, or given, and that exactly, so
that its intervals are those of the boxes alone.

A true silhouette is not a true foot: of a walker's two feet the nearer is the lower end of the box.
What that costs is in the row with true boxes and the pose given.
"""

from __future__ import annotations

import argparse
import math
import multiprocessing
import tempfile
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
import numpy.typing as npt

from pipeline.cli.console import out, print_rows
from pipeline.core.config import CameraConfig, Config, DetectConfig
from pipeline.run.recordings import estimate_again, run
from pipeline.store.database import Store
from recordings.simulate_walkers import write
from recordings.walkers_random import make_scene
from recordings.walkers_scene import Settings
from recordings.walkers_view import View

Floats = npt.NDArray[np.float64]

CAMERA = "walkers"
# Small pictures, so that many cameras take minutes; the detector works on 256-511 rows anyway.
SETTINGS = Settings(duration_s=40.0, frame_rate=8.0, width_px=640, height_px=360)
# The README's figures are of 100 seeds from here on: develop on others.
FIRST_SEED = 8000
MIN_MATCHED = 8  # frames in which a track was matched with a person, before its height counts
DETECTORS = {"motion": "motion detector", "recorded": "true boxes"}
POSES = {"found": "pose from walkers", "given": "pose given"}
METHODS = ("fused", "ground")  # the first that there is

# Of every observation: does its box show one person, several, or none that it fits?
_KINDS = """
WITH pairs AS (
    SELECT o.observation_index, m.object_id IS NOT NULL AS matched,
        greatest(least(t.x_max_px, o.x_max_px) - greatest(t.x_min_px, o.x_min_px), 0)
        * greatest(least(t.y_max_px, o.y_max_px) - greatest(t.y_min_px, o.y_min_px), 0)
        / ((t.x_max_px - t.x_min_px) * (t.y_max_px - t.y_min_px)) AS held,
        greatest(least(t.x_max_px, o.x_max_px) - greatest(t.x_min_px, o.x_min_px), 0)
        * greatest(least(t.y_max_px, o.y_max_px) - greatest(t.y_min_px, o.y_min_px), 0)
        / ((o.x_max_px - o.x_min_px) * (o.y_max_px - o.y_min_px)) AS filled
    FROM observations AS o
    LEFT JOIN ground_truth AS t USING (frame_index)
    LEFT JOIN matches AS m USING (observation_index)
),
boxes AS (
    SELECT observation_index, any_value(matched) AS matched,
        count(*) FILTER (held > 0.7) AS people, coalesce(max(filled), 0) AS filled
    FROM pairs GROUP BY ALL
)
SELECT count(*) AS boxes,
    count(*) FILTER (people >= 2) AS several,
    count(*) FILTER (matched AND people < 2) AS one,
    count(*) FILTER (NOT matched AND people < 2 AND filled >= 0.3) AS part,
    count(*) FILTER (NOT matched AND people < 2 AND filled < 0.3) AS nobody
FROM boxes
"""
_ENDS = """
SELECT o.y_min_px - t.y_min_px AS head_px, o.y_max_px - t.y_max_px AS foot_px,
    t.y_max_px - t.y_min_px AS tall_px
FROM matches AS m
JOIN observations AS o USING (observation_index)
JOIN ground_truth AS t ON t.frame_index = m.frame_index AND t.object_id = m.object_id
WHERE NOT (truncated_left OR truncated_top OR truncated_right OR truncated_bottom)
"""
_DEPTHS = """
SELECT depth_error_m / true_depth_m AS relative, depth_z AS z, true_depth_m
FROM accuracy.all_errors
WHERE run_id = ? AND method = ? AND depth_error_m IS NOT NULL
"""
_HEIGHTS = """
SELECT height_error_m, height_z, heights.height_plausible IS NOT FALSE AS one_person
FROM accuracy.track_heights
JOIN main.track_heights AS heights USING (recording_id, run_id, camera, track_id, method)
WHERE run_id = ? AND method = ? AND matched_count >= ?
"""


@dataclass(frozen=True, slots=True)
class Score:
    """Scores of one camera, with one kind of boxes and one origin of the pose."""

    relative: Floats  # depth errors over true depths
    depth_z: Floats  # depth errors in stated standard deviations
    height_error_m: Floats  # a track
    height_z: Floats
    one_person: npt.NDArray[np.bool_]  # a track: whether the height can be one person's


@dataclass(slots=True)
class Result:
    """Results of one camera."""

    seed: int
    view: View
    scores: dict[tuple[str, str], Score]
    found_pose: dict[str, tuple[float, float, float] | None]
    pose_z: dict[str, Floats]
    found_share: dict[str, float]
    kinds: dict[str, int]
    ends: Floats  # (n, 3) head, foot, height, in pixels: the motion detector's
    refusal: str
    seconds: tuple[float, float]  # to simulate, to run


def measure(seed: int, keep: Path | None = None) -> Result:
    """Simulate a camera, unless its recording was kept, and work the recording four ways."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        start = time.perf_counter()
        settings = replace(SETTINGS, seed=seed)
        recording = (keep or folder) / f"{seed}.mcap"
        if not recording.exists():
            write(recording, settings, with_detections=True)
        view = make_scene(settings).view
        simulated = time.perf_counter()
        result = Result(
            seed, view, {}, {}, {}, {}, {}, np.empty((0, 3)), "", (simulated - start, 0.0)
        )
        for detector in DETECTORS:
            config = Config(detect=DetectConfig(method=detector))
            database = folder / f"{detector}.duckdb"
            run_id = run([recording], database, config).run_id
            with Store.open(database, read_only=True) as store:
                result.scores[detector, "found"] = _score(store, run_id)
                _describe(store, result, detector)
            given = replace(config, camera=(_true_camera(view),))
            run_id, _ = estimate_again(database, given, None)
            with Store.open(database, read_only=True) as store:
                result.scores[detector, "given"] = _score(store, run_id)
        result.seconds = (simulated - start, time.perf_counter() - simulated)
    return result


def _true_camera(view: View) -> CameraConfig:
    plane = view.plane
    return CameraConfig(
        CAMERA,
        camera_height_m=plane.camera_height_m,
        camera_height_std_m=0.0,
        tilt_deg=math.degrees(plane.tilt_rad),
        tilt_std_deg=0.0,
        roll_deg=math.degrees(plane.roll_rad),
        roll_std_deg=0.0,
    )


def _score(store: Store, run_id: str) -> Score:
    for method in METHODS:
        depths = store.query(_DEPTHS, [run_id, method]).to_pandas()
        if len(depths):
            break
    heights = store.query(_HEIGHTS, [run_id, method, MIN_MATCHED]).to_pandas()
    return Score(
        depths["relative"].to_numpy(float),
        depths["z"].to_numpy(float),
        heights["height_error_m"].to_numpy(float),
        heights["height_z"].to_numpy(float),
        heights["one_person"].to_numpy(bool),
    )


def _describe(store: Store, result: Result, detector: str) -> None:
    """Keep what the first run says of the pose, and of the boxes."""
    camera = store.query("FROM cameras").to_pylist()[0]
    names = ("camera_height_m", "tilt_rad", "roll_rad")
    found = camera["pose_source"] == "walkers"
    above_m, tilt_rad, roll_rad = (camera[n] for n in names)
    pose = (above_m, tilt_rad, roll_rad) if found else None
    result.found_pose[detector] = pose
    if found:
        std_names = ("camera_height_std_m", "tilt_std_rad", "roll_std_rad")
        plane = result.view.plane
        truth = np.array([plane.camera_height_m, plane.tilt_rad, plane.roll_rad])
        std = np.array([camera[n] for n in std_names])
        result.pose_z[detector] = (np.array(pose) - truth) / std
    share = store.query("SELECT found_share FROM accuracy.matching").to_pylist()
    result.found_share[detector] = share[0]["found_share"] if share else 0.0
    if detector == "motion":
        result.kinds = store.query(_KINDS).to_pylist()[0]
        result.ends = store.query(_ENDS).to_pandas().to_numpy(float)
        said = store.query("SELECT message FROM diagnostics WHERE code = 'pose_undetermined'")
        result.refusal = "; ".join(said["message"].to_pylist())


def main() -> None:
    """Print the results of many cameras."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--cameras", type=int, default=100)
    parser.add_argument("--workers", type=int, default=multiprocessing.cpu_count())
    parser.add_argument("--each", action="store_true", help="a row for each camera, too")
    parser.add_argument("--first-seed", type=int, default=FIRST_SEED)
    parser.add_argument(
        "--keep",
        type=Path,
        metavar="DIR",
        help="keep recordings there, and use those that are there",
    )
    given, _ = parser.parse_known_args()
    seeds = range(given.first_seed, given.first_seed + given.cameras)
    if given.keep is not None:
        given.keep.mkdir(parents=True, exist_ok=True)
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(max(1, given.workers), mp_context=context) as pool:
        results = list(pool.map(partial(measure, keep=given.keep), seeds))
    out.print(
        f"{given.cameras} simulated cameras, {SETTINGS.duration_s:g} s of {SETTINGS.people} people "
        f"each, {SETTINGS.width_px}x{SETTINGS.height_px} at {SETTINGS.frame_rate:g} frames/s"
    )
    if given.each:
        _print_each(results)
    _print_accuracy(results)
    _print_poses(results)
    _print_boxes(results)
    simulating, working = np.array([r.seconds for r in results]).mean(axis=0)
    out.print(
        f"a camera takes {simulating:.1f} s to simulate "
        f"({SETTINGS.frames / simulating:.0f} frames/s) and {working:.1f} s to work, four ways"
    )


def _print_accuracy(results: list[Result]) -> None:
    rows = []
    for detector, boxes in DETECTORS.items():
        for origin, pose in POSES.items():
            scores = [r.scores[detector, origin] for r in results]
            scores = [s for s in scores if len(s.relative)]
            if not scores:
                continue
            medians = [np.median(np.abs(s.relative)) for s in scores]
            relative = np.concatenate([s.relative for s in scores])
            errors_m = np.concatenate([s.height_error_m for s in scores])
            one = np.concatenate([s.one_person for s in scores])
            rows.append(
                [
                    f"{boxes}, {pose}",
                    str(len(scores)),
                    f"{100 * np.median(medians):.2f}",
                    f"{100 * np.quantile(medians, 0.9):.2f}",
                    f"{100 * np.median(relative):+.2f}",
                    f"{100 * _inside(np.concatenate([s.depth_z for s in scores])):.1f}",
                    f"{100 * np.nanmean(np.abs(errors_m[one])):.1f}",
                    f"{100 * np.nanmedian(np.abs(errors_m[one])):.1f}",
                    f"{100 * np.nanmedian(errors_m[one]):+.1f}",
                    f"{100 * _inside(np.concatenate([s.height_z for s in scores])[one]):.1f}",
                    f"{100 * one.mean():.0f}",
                ]
            )
    header = (
        "",
        "cameras",
        "depth error %",
        "worst tenth %",
        "bias %",
        "in 95 %",
        "height MAE cm",
        "median cm",
        "bias cm",
        "in 95 % ",
        "tracks %",
    )
    print_rows("Depth, median of cameras; height, of tracks that can be one person", header, rows)


def _print_poses(results: list[Result]) -> None:
    rows = []
    for detector, boxes in DETECTORS.items():
        poses = [(r.found_pose[detector], r.view.plane, r) for r in results]
        found = [(p, t, r) for p, t, r in poses if p is not None]
        if not found:
            rows.append([boxes, f"0 of {len(results)}", *[""] * 6])
            continue
        pose, truth = np.array([p for p, _, _ in found]), [t for _, t, _ in found]
        high = np.abs(pose[:, 0] / [t.camera_height_m for t in truth] - 1)
        tilt = np.abs(np.rad2deg(pose[:, 1] - [t.tilt_rad for t in truth]))
        roll = np.abs(np.rad2deg(pose[:, 2] - [t.roll_rad for t in truth]))
        z = np.array([r.pose_z[detector] for _, _, r in found])
        rows.append(
            [
                boxes,
                f"{len(found)} of {len(results)}",
                f"{100 * np.median(high):.1f}",
                f"{np.median(tilt):.2f}",
                f"{np.median(roll):.2f}",
                *(f"{100 * _inside(z[:, i]):.0f}" for i in range(3)),
            ]
        )
    header = (
        "",
        "poses found",
        "height error %",
        "tilt error °",
        "roll error °",
        "height in 95 %",
        "tilt in 95 %",
        "roll in 95 %",
    )
    print_rows("The pose from walkers: medians of cameras", header, rows)


def _print_boxes(results: list[Result]) -> None:
    kinds = {k: sum(r.kinds[k] for r in results) for k in results[0].kinds}
    total = max(kinds["boxes"], 1)
    out.print(
        f"boxes of the motion detector: {100 * kinds['one'] / total:.0f} % one person, "
        f"{100 * kinds['several'] / total:.0f} % several in one, "
        f"{100 * kinds['part'] / total:.0f} % a part or a loose fit, "
        f"{100 * kinds['nobody'] / total:.0f} % nobody; of the people in the pictures "
        f"{100 * np.mean([r.found_share['motion'] for r in results]):.0f} % were found"
    )
    ends = np.concatenate([r.ends for r in results])
    rows = []
    for name, column in (("head", 0), ("foot", 1)):
        error = ends[:, column]
        share = error / ends[:, 2]
        rows.append(
            [
                name,
                f"{np.median(error):+.2f}",
                f"{np.median(np.abs(error)):.2f}",
                f"{np.quantile(np.abs(error), 0.9):.2f}",
                f"{100 * np.median(share):+.2f}",
                f"{100 * np.median(np.abs(share)):.2f}",
            ]
        )
    header = ("end", "bias px", "median px", "worst tenth px", "bias %", "median % of height")
    print_rows("The motion detector's boxes less the true ones, down being positive", header, rows)


def _print_each(results: list[Result]) -> None:
    rows = []
    for r in results:
        motion, true = r.scores["motion", "found"], r.scores["recorded", "found"]
        plane = r.view.plane
        rows.append(
            [
                str(r.seed),
                f"{plane.camera_height_m:.1f}",
                f"{math.degrees(plane.tilt_rad):.0f}",
                f"{r.view.focal_length_mm:.1f}",
                f"{100 * r.found_share['motion']:.0f}",
                *(_pair(r, d) for d in DETECTORS),
                *(
                    f"{100 * np.median(np.abs(s.relative)):.1f}" if len(s.relative) else ""
                    for s in (motion, r.scores["motion", "given"], true)
                ),
                r.refusal[:60],
            ]
        )
    header = (
        "seed",
        "height m",
        "tilt °",
        "f mm",
        "found %",
        "motion: m, °",
        "true: m, °",
        "motion %",
        "pose given %",
        "true boxes %",
        "",
    )
    print_rows("Each camera: the pose found, and depth errors", header, rows)


def _pair(result: Result, detector: str) -> str:
    pose = result.found_pose[detector]
    return "" if pose is None else f"{pose[0]:.1f}, {math.degrees(pose[1]):.0f}"


def _inside(z: Floats) -> float:
    known = z[np.isfinite(z)]
    return float((np.abs(known) < 1.96).mean()) if len(known) else math.nan


if __name__ == "__main__":
    main()
