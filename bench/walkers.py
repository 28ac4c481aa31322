"""The pose from walkers, and what it makes of depth and height, on simulated cameras with truth.

    python -m bench.walkers --cameras 100

Boxes only: people of normal stature walk straight paths before a camera of random height, tilt, roll
and focal length; head and feet bob as in a gait, boxes are off by noise that stays for half a second,
and some boxes hold two people or half of one. No picture is drawn: this tests geometry and statistics,
not the detector.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass, replace

import numpy as np

from pipeline.calibrate.walkers import POPULATION_MEAN_STD_M, calibrate_from_walkers
from pipeline.config import ADULT, Config
from pipeline.console import out, print_rows
from pipeline.errors import CalibrationUndetermined
from pipeline.estimate import fused, ground, size
from pipeline.estimate.columns import Measured
from pipeline.estimate.gait import EXCURSION_M, GAIT_DROP_M, GAIT_DROP_STD_M
from pipeline.estimate.geometry import Geometry
from pipeline.estimate.tracks import track_heights
from pipeline.optics.ground_plane import (
    foot_depth_m,
    ground_position_m,
    project_person,
    remove_roll,
)
from pipeline.records import FloatArray, GroundPlane, Intrinsics, Method

FRAME_NS = 100_000_000
WIDTH_PX, HEIGHT_PX = 1280, 720
PIXEL_PITCH_UM = 3.0
BOX_NOISE_PX = 1.0
NOISE_CORRELATION = 0.8  # of neighbouring frames, a tenth of a second apart
STEP_HZ = 1.9


@dataclass(frozen=True, slots=True)
class Scene:
    """Boxes of one camera, and the truth beside them."""

    measured: Measured
    plane: GroundPlane
    true_depth_m: FloatArray  # (n,)
    true_height_m: FloatArray  # (tracks,), standing


def scene(random: np.random.Generator, people: int = 20, *, bad_share: float = 0.1) -> Scene:
    """Return a scene of so many people, of whom a share is two in one box or half hidden.

    A camera that cannot see a whole person anywhere (near, steep and narrow) is drawn again.
    """
    while True:
        focal_px = random.uniform(4.0, 12.0) * 1e3 / PIXEL_PITCH_UM
        centre_px = ((WIDTH_PX - 1) / 2, (HEIGHT_PX - 1) / 2)
        intrinsics = Intrinsics(WIDTH_PX, HEIGHT_PX, focal_px, focal_px, *centre_px)
        tilt_rad, roll_rad = np.deg2rad(random.uniform(5, 45)), np.deg2rad(random.normal(0, 2))
        plane = GroundPlane(random.uniform(2.5, 8.0), tilt_rad, roll_rad)
        # who walks here is not the population: another country, other shoes
        local_mean_m = random.normal(ADULT.mean_m, POPULATION_MEAN_STD_M)
        boxes, depths, ids, times, heights = [], [], [], [], []
        for _ in range(30 * people):
            tall_m = random.normal(local_mean_m, ADULT.std_m)
            walking_m = tall_m - max(random.normal(GAIT_DROP_M, GAIT_DROP_STD_M), 0.0)
            walk = _walk(random, plane, intrinsics, walking_m)
            if walk is None:
                continue
            box, depth = walk
            if random.uniform() < bad_share:
                box[:, 1] -= (box[:, 3] - box[:, 1]) * random.choice([0.8, -0.45])
            boxes.append(box)
            depths.append(depth)
            ids.append(np.full(len(box), len(heights)))
            times.append(np.arange(len(box)) * FRAME_NS)
            heights.append(tall_m)
            if len(heights) == people:
                break
        if len(heights) == people:
            break
    count = sum(map(len, boxes))
    unknown = np.full(count, np.nan)
    bbox = np.concatenate(boxes)
    measured = Measured(
        camera="simulated",
        observation_index=np.arange(count),
        frame_index=np.arange(count),
        capture_time_ns=np.concatenate(times),
        track_id=np.concatenate(ids),
        class_name=np.full(count, "person", dtype=object),
        bbox_xyxy_px=bbox,
        std_xyxy_px=np.full((count, 4), BOX_NOISE_PX),
        truncated=np.zeros((count, 4), dtype=bool),
        occlusion=np.zeros(count),
        f_number=unknown,
        focal_length_mm=unknown,
        focus_distance_m=unknown,
        pixel_pitch_x_um=unknown,
        pixel_pitch_y_um=unknown,
        intrinsics=intrinsics,
        ground_plane=None,
    )
    return Scene(measured, plane, np.concatenate(depths), np.array(heights))


def _walk(
    random: np.random.Generator, plane: GroundPlane, intrinsics: Intrinsics, tall_m: float
) -> tuple[FloatArray, FloatArray] | None:
    """Return boxes (n, 4) and depths (n,) of a straight walk, or None if it is hardly in view."""
    focal = np.array([intrinsics.fx_px, intrinsics.fy_px])
    centre = np.array([intrinsics.cx_px, intrinsics.cy_px])
    seen_px = random.uniform([0, 0.15 * HEIGHT_PX], [WIDTH_PX, HEIGHT_PX])
    x, y = remove_roll((seen_px - centre) / focal, plane.roll_rad)
    depth_m = foot_depth_m(plane.camera_height_m, plane.tilt_rad, y)
    passed = np.array(ground_position_m(depth_m, x, y, plane.tilt_rad))
    if not 4.0 < depth_m < 45.0:
        return None
    heading, speed_m_s = random.uniform(0, 2 * np.pi), random.uniform(0.8, 1.8)
    half = round(random.uniform(2, 8) * 1e9 / FRAME_NS)
    time_s = np.arange(-half, half + 1) * FRAME_NS / 1e9
    x_m = passed[0] + np.cos(heading) * speed_m_s * time_s
    y_m = passed[1] + np.sin(heading) * speed_m_s * time_s
    bob_m = EXCURSION_M / 2 * np.cos(2 * np.pi * STEP_HZ * time_s + random.uniform(0, 6))
    pose = (plane.camera_height_m, plane.tilt_rad, plane.roll_rad)
    foot, head = project_person(x_m, y_m, tall_m + bob_m, *pose)
    foot_px, head_px = foot * focal + centre, head * focal + centre
    tall_px = foot_px[:, 1] - head_px[:, 1]
    inside = (
        (np.abs(foot_px[:, 0] - centre[0]) < WIDTH_PX / 2 - 0.3 * tall_px)
        & (foot_px[:, 1] < HEIGHT_PX - 4)
        & (head_px[:, 1] > 4)
        & (tall_px > 0.04 * HEIGHT_PX)
    )
    if inside.sum() < 15:
        return None
    error = np.zeros((len(time_s), 2))
    for i in range(len(time_s)):
        fresh = random.normal(0, BOX_NOISE_PX * np.sqrt(1 - NOISE_CORRELATION**2), 2)
        error[i] = NOISE_CORRELATION * error[i - 1] + fresh if i else random.normal(0, 1, 2)
    middle = (foot_px[:, 0] + head_px[:, 0]) / 2
    box = np.stack(
        [
            middle - 0.17 * tall_px,
            head_px[:, 1] + error[:, 0],
            middle + 0.17 * tall_px,
            foot_px[:, 1] + error[:, 1],
        ],
        axis=1,
    )
    along_m = y_m * np.cos(plane.tilt_rad) + plane.camera_height_m * np.sin(plane.tilt_rad)
    return box[inside], along_m[inside]


@dataclass(frozen=True, slots=True)
class Score:
    """What came out of one camera by one method: errors, relative and in standard deviations."""

    depth_relative: float
    height_mae_m: float
    depth_z: FloatArray
    height_z: FloatArray
    pose_z: FloatArray  # camera height, tilt, roll


def score(simulated: Scene, plane: GroundPlane, method: Method = Method.FUSED) -> Score:
    """Return how good the estimates with this pose are."""
    measured = replace(simulated.measured, ground_plane=plane)
    geometry = Geometry(measured)
    by_ground = ground.estimate(geometry)
    members = {Method.GROUND: by_ground, Method.SIZE: size.estimate(geometry, Config())}
    found = fused.estimate(geometry, members)
    if method is Method.GROUND:
        by_ground.speed_m_s, found = found.speed_m_s, by_ground
    table = track_heights(measured, found, method, [ADULT])
    track, plausible = table["track_id"].to_numpy(), table["height_plausible"].to_pylist()
    one = np.array([p is not False for p in plausible])
    height_error = table["height_m"].to_numpy() - simulated.true_height_m[track]
    good = np.isin(measured.track_id, track[one])
    depth_error = (found.depth_m - simulated.true_depth_m)[good]
    pose = np.array([plane.camera_height_m, plane.tilt_rad, plane.roll_rad])
    truth = simulated.plane
    true_pose = np.array([truth.camera_height_m, truth.tilt_rad, truth.roll_rad])
    with np.errstate(divide="ignore", invalid="ignore"):
        pose_z = (pose - true_pose) / np.sqrt(np.diag(plane.covariance))
    return Score(
        float(np.nanmedian(np.abs(depth_error) / simulated.true_depth_m[good])),
        float(np.nanmean(np.abs(height_error[one]))),
        depth_error / found.depth_std_m[good],
        height_error[one] / table["height_std_m"].to_numpy()[one],
        pose_z,
    )


def main() -> None:
    """Print errors and coverage over many cameras."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--cameras", type=int, default=100)
    parser.add_argument("--people", type=int, default=20)
    arguments, _ = parser.parse_known_args()
    random = np.random.default_rng(4)
    methods = (Method.GROUND, Method.FUSED)
    found: dict[Method, list[Score]] = {m: [] for m in methods}
    known: dict[Method, list[Score]] = {m: [] for m in methods}
    refused = 0
    for _ in range(arguments.cameras):
        simulated = scene(random, arguments.people)
        for method in methods:
            known[method].append(score(simulated, simulated.plane, method))
        try:
            plane, _ = calibrate_from_walkers(simulated.measured, ADULT)
        except CalibrationUndetermined:
            refused += 1
            continue
        for method in methods:
            found[method].append(score(simulated, plane, method))
    out.print(
        f"{arguments.cameras} cameras, {arguments.people} people each, one in ten boxes bad: "
        f"{len(found[Method.FUSED])} poses found, {refused} refused"
    )
    rows = []
    parts = [("pose known", m, known[m]) for m in methods]
    parts += [("pose from walkers", m, found[m]) for m in methods]
    for label, method, scores in parts:
        rows.append(
            [
                label,
                method,
                f"{100 * np.median([s.depth_relative for s in scores]):.2f}",
                f"{100 * np.quantile([s.depth_relative for s in scores], 0.9):.2f}",
                f"{100 * np.median([s.height_mae_m for s in scores]):.2f}",
                f"{100 * _inside(np.concatenate([s.depth_z for s in scores])):.1f}",
                f"{100 * _inside(np.concatenate([s.height_z for s in scores])):.1f}",
            ]
        )
    header = (
        "",
        "method",
        "median depth error %",
        "of the worst tenth %",
        "height MAE cm",
        "depth in 95 % interval, %",
        "height in 95 % interval, %",
    )
    print_rows("Errors", header, rows)
    z = np.array([s.pose_z for s in found[Method.FUSED]])
    names = ("camera height", "tilt", "roll")
    shares = [[n, f"{100 * _inside(z[:, i]):.1f}"] for i, n in enumerate(names)]
    print_rows("Pose inside its 95 % interval", ("", "% of cameras"), shares)


def _inside(z: FloatArray) -> float:
    return float(np.nanmean(np.abs(z[np.isfinite(z)]) < 1.96))


if __name__ == "__main__":
    main()
