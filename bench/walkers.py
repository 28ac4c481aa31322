"""Pose from walkers, and the depths and heights that follow, on simulated cameras with truth.

    python -m bench.walkers --cameras 100

Boxes only: people of a crowd that no prior knows (`recordings.crowd`) walk straight paths before a camera
of random height, tilt, roll and focal length; heads bob and feet swing as in a gait, boxes end where the
outline of a body does (`optics.silhouette`; that rendered bodies do is shown by `bench.scenes`) and are
off by noise that stays for half a second, and some boxes hold two people or half of one. In a second set
of scenes everybody passes behind a wall that no box tells of, for a second or two. No picture is drawn:
this tests geometry and statistics, not the detector.

`fused` is compared with its best member, the surest being the ground: with what is drawn here, and the
error of the median over one camera's people being what it is, cameras differ by a few hundredths.
"""

from __future__ import annotations

import argparse
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from pipeline.calibrate.walkers.focal_length import calibrate_lens_from_walkers
from pipeline.calibrate.walkers.pose import calibrate_from_walkers
from pipeline.cli.console import out, print_rows
from pipeline.core.arrays import FloatArray
from pipeline.core.config import ADULT, Config
from pipeline.core.errors import CalibrationUndetermined
from pipeline.core.records import GroundPlane, Intrinsics
from pipeline.estimate.boxes.quality import assess
from pipeline.estimate.boxes.reach import with_reach
from pipeline.estimate.estimate_tracks import fuse
from pipeline.estimate.gait import EXCURSION_M, GAIT_DROP_M, GAIT_DROP_STD_M, as_standing
from pipeline.estimate.methods import FUSED, GROUND, ground, size
from pipeline.estimate.track_heights import track_heights
from pipeline.estimate.types import Measured
from pipeline.optics.ground_plane import (
    add_roll,
    foot_depth_m,
    ground_position_m,
    project_person,
    remove_roll,
)
from pipeline.optics.silhouette import (
    REACH_COMMON_STD,
    REACH_STD,
    REACH_TRACK_STD,
    mean_reach,
    silhouette_rows,
    steepness,
)
from recordings.crowd import Crowd

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


def scene(
    random: np.random.Generator,
    people: int = 20,
    *,
    bad_share: float = 0.1,
    wall_share: float = 0.0,
) -> Scene:
    """Return a scene of a number of people; a share of the boxes hold two people or half of one.

    Another share passes behind a wall, which hides their feet for a while.

    A camera that cannot see a whole person anywhere (near, steep and narrow) is drawn again.
    """
    while True:
        focal_px = random.uniform(4.0, 12.0) * 1e3 / PIXEL_PITCH_UM
        centre_px = ((WIDTH_PX - 1) / 2, (HEIGHT_PX - 1) / 2)
        intrinsics = Intrinsics(WIDTH_PX, HEIGHT_PX, focal_px, focal_px, *centre_px)
        tilt_rad, roll_rad = np.deg2rad(random.uniform(5, 45)), np.deg2rad(random.normal(0, 2))
        plane = GroundPlane(random.uniform(2.5, 8.0), tilt_rad, roll_rad)
        crowd = Crowd.drawn(random)
        shoes = random.normal(0, REACH_COMMON_STD)
        boxes, depths, ids, times, heights = [], [], [], [], []
        for _ in range(30 * people):
            tall_m = crowd.stature_m(random)
            walking_m = tall_m - max(random.normal(GAIT_DROP_M, GAIT_DROP_STD_M), 0.0)
            walk = _walk(random, plane, intrinsics, walking_m, shoes)
            if walk is None:
                continue
            box, depth = walk
            if random.uniform() < bad_share:
                box[:, 1] -= (box[:, 3] - box[:, 1]) * random.choice([0.8, -0.45])
            if wall_share and random.uniform() < wall_share:
                _hide_feet(random, box)
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


def _hide_feet(random: np.random.Generator, box: FloatArray) -> None:
    """Cut the lower part off the boxes of a second or two, at most a third of the track."""
    long = min(round(random.uniform(1, 2) * 1e9 / FRAME_NS), len(box) // 3)
    begin = random.integers(0, len(box) - long + 1)
    hidden = slice(begin, begin + long)
    box[hidden, 3] -= random.uniform(0.15, 0.45) * (box[hidden, 3] - box[hidden, 1])


def _walk(
    random: np.random.Generator,
    plane: GroundPlane,
    intrinsics: Intrinsics,
    tall_m: float,
    shoes: float,
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
    foot, head = _outline(random, plane, x_m, y_m, tall_m + bob_m, heading, shoes, time_s)
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


def _outline(
    random: np.random.Generator,
    plane: GroundPlane,
    x_m: FloatArray,
    y_m: FloatArray,
    tall_m: FloatArray,
    heading_rad: float,
    shoes: float,
    time_s: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Return the ends, (n, 2) each, of a walker's outline, the reach changing with every step."""
    foot, head = project_person(x_m, y_m, tall_m, plane.camera_height_m, plane.tilt_rad)
    steep, _ = steepness(head[:, 1], plane.tilt_rad)
    towards = -np.sin(heading_rad)
    reach = mean_reach(steep, towards, towards**2) + shoes + random.normal(0, REACH_TRACK_STD)
    reach += (
        REACH_STD * np.sqrt(2) * np.cos(2 * np.pi * STEP_HZ * time_s + random.uniform(0, 2 * np.pi))
    )
    low, high = silhouette_rows(foot[:, 1], head[:, 1], plane.tilt_rad, reach)
    ends = (np.stack([foot[:, 0], low], axis=1), np.stack([head[:, 0], high], axis=1))
    return add_roll(ends[0], plane.roll_rad), add_roll(ends[1], plane.roll_rad)


@dataclass(frozen=True, slots=True)
class Score:
    """Errors of one camera by one method, relative and in standard deviations."""

    depth_relative: float  # median
    depth_relative_rms: float
    height_mae_m: float  # of tracks
    depth_z: FloatArray
    height_z: FloatArray  # of tracks
    frame_height_z: FloatArray
    pose_z: FloatArray  # camera height, tilt, roll


def score(simulated: Scene, plane: GroundPlane, method: str = FUSED) -> Score:
    """Return how good the estimates with this pose are."""
    measured = replace(simulated.measured, ground_plane=plane)
    quality = assess(measured)
    config = Config()
    geometry = ground.with_scatter(with_reach(quality.applied(measured)), config)
    members = {
        GROUND: ground.estimate(geometry, config),
        "size": size.estimate(geometry, config),
    }
    found, members, _ = fuse(geometry, members, quality, config)
    if method != FUSED:
        seen = members[method]
        found = as_standing(measured, seen, found.speed_m_s, seen.height_assumed)
    table = track_heights(measured, found, method, [ADULT])
    track, plausible = table["track_id"].to_numpy(), table["height_plausible"].to_pylist()
    one = np.array([p is not False for p in plausible])
    height_error = table["height_m"].to_numpy() - simulated.true_height_m[track]
    good = np.isin(measured.track_id, track[one])
    depth_error = (found.depth_m - simulated.true_depth_m)[good]
    relative = np.abs(depth_error) / simulated.true_depth_m[good]
    own = good & np.isfinite(found.height_m) & ~found.height_assumed
    tall_m = simulated.true_height_m[measured.track_id]
    pose = np.array([plane.camera_height_m, plane.tilt_rad, plane.roll_rad])
    truth = simulated.plane
    true_pose = np.array([truth.camera_height_m, truth.tilt_rad, truth.roll_rad])
    with np.errstate(divide="ignore", invalid="ignore"):
        pose_z = (pose - true_pose) / np.sqrt(np.diag(plane.covariance))
    return Score(
        float(np.nanmedian(relative)),
        float(np.sqrt(np.nanmean(relative**2))),
        float(np.nanmean(np.abs(height_error[one]))),
        depth_error / found.depth_std_m[good],
        height_error[one] / table["height_std_m"].to_numpy()[one],
        ((found.height_m - tall_m) / found.height_std_m)[own],
        pose_z,
    )


METHODS = (GROUND, FUSED)
LABELS = ("pose known", "pose from walkers", "lens and pose from walkers")


def without_lens(simulated: Scene) -> tuple[Scene, GroundPlane, float, float]:
    """Return a scene with the lens found by its people, the pose, and the focal length's error.

    That is relative, and in standard deviations.
    """
    measured, truth = replace(simulated.measured, intrinsics=None), simulated.measured.intrinsics
    lens, plane, _ = calibrate_lens_from_walkers(measured, (WIDTH_PX, HEIGHT_PX), ADULT)
    seen = replace(simulated, measured=replace(measured, intrinsics=lens.intrinsics))
    found_px, true_px = lens.intrinsics.fx_px, truth.fx_px if truth else np.nan
    return seen, plane, found_px / true_px - 1, (found_px - true_px) / lens.std_px


def main() -> None:
    """Print errors and coverage over many cameras."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--cameras", type=int, default=100)
    parser.add_argument("--people", type=int, default=20)
    arguments, _ = parser.parse_known_args()
    rows, poses = [], np.empty((0, 3))
    focal: list[tuple[float, float]] = []
    for title, wall_share in (("in the open", 0.0), ("behind a wall", 1.0)):
        random = np.random.default_rng(4)
        scores: dict[str, dict[str, list[Score]]] = {
            label: {m: [] for m in METHODS} for label in LABELS
        }
        for _ in range(arguments.cameras):
            simulated = scene(random, arguments.people, wall_share=wall_share)
            posed = {"pose known": (simulated, simulated.plane)}
            with suppress(CalibrationUndetermined):
                plane, _ = calibrate_from_walkers(simulated.measured, ADULT)
                posed["pose from walkers"] = simulated, plane
            if not wall_share:
                with suppress(CalibrationUndetermined):
                    seen, plane, focal_error, focal_z = without_lens(simulated)
                    posed["lens and pose from walkers"] = seen, plane
                    focal.append((focal_error, focal_z))
            for label, (seen, plane) in posed.items():
                for method in METHODS:
                    scores[label][method].append(score(seen, plane, method))
        found = scores["pose from walkers"]
        out.print(
            f"{title}: {arguments.cameras} cameras, {arguments.people} people each, one in ten "
            f"boxed badly: {len(found[FUSED])} poses found, the others refused"
        )
        if not wall_share:
            poses = np.array([s.pose_z for s in found[FUSED]]).reshape(-1, 3)
        for label, by_method in scores.items():
            for method in METHODS:
                if by_method[method]:
                    cells = _row(by_method[method], by_method[GROUND])
                    rows.append([title, label, method, *cells])
    header = (
        "",
        "",
        "method",
        "median depth error %",
        "of the worst tenth %",
        "RMS beside ground: median, worst",
        "height MAE cm",
        "in 95 %: depth",
        "height, frame",
        "height, track",
    )
    print_rows("Errors and intervals", header, rows)
    names = ("camera height", "tilt", "roll")
    shares = [[n, f"{100 * _inside(poses[:, i]):.1f}"] for i, n in enumerate(names)]
    print_rows("Pose inside its 95 % interval, in the open", ("", "% of cameras"), shares)
    if focal:
        error, z = np.array(focal).T
        out.print(
            f"focal length of cameras without lens data, in the open: {len(focal)} found of "
            f"{arguments.cameras}, median error {100 * np.median(np.abs(error)):.1f} %, "
            f"{100 * _inside(z):.1f} % in their 95 % interval"
        )


def _row(scores: list[Score], beside: list[Score]) -> list[str]:
    """Return the figures of a method over all cameras, beside those of another."""
    pairs = zip(scores, beside, strict=True)
    ratios = [s.depth_relative_rms / b.depth_relative_rms for s, b in pairs]
    return [
        f"{100 * np.median([s.depth_relative for s in scores]):.2f}",
        f"{100 * np.quantile([s.depth_relative for s in scores], 0.9):.2f}",
        f"{np.median(ratios):.2f}, {max(ratios):.2f}",
        f"{100 * np.median([s.height_mae_m for s in scores]):.2f}",
        f"{100 * _inside(np.concatenate([s.depth_z for s in scores])):.1f}",
        f"{100 * _inside(np.concatenate([s.frame_height_z for s in scores])):.1f}",
        f"{100 * _inside(np.concatenate([s.height_z for s in scores])):.1f}",
    ]


def _inside(z: FloatArray) -> float:
    return float(np.nanmean(np.abs(z[np.isfinite(z)]) < 1.96))


if __name__ == "__main__":
    main()
