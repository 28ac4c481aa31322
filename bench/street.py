"""The street's camera, found from the people who walk there, beside its published survey.

    python -m bench.street [RECORDING of the same camera]

`street` is the first view of PETS 2009 S2.L1, whose cameras were surveyed with Tsai's method; the
figures below are those that public projection code for the data set carries. `run` is told nothing of
them: it gets the recording alone, without the lens's distortion. Then the survey says, of the foot of
every box that was found, how far away it is, and how far above it the head. Errors of the boxes are not
in the depth errors, but they are in the heights.

The scale of such a pose is the population's mean stature. Who walked here was as tall as they were: the
heights by the survey say so, and the difference is inside the stated interval or it is not.
"""

from __future__ import annotations

import math
import sys
import tempfile
from pathlib import Path

import numpy as np
import numpy.typing as npt

from pipeline.cli.console import out, print_rows
from pipeline.core.config import Config
from pipeline.run.recordings import run
from pipeline.store.database import Store

Floats = npt.NDArray[np.float64]

STREET = Path(__file__).resolve().parents[1] / "recordings" / "street.mcap"

# Tsai's model: sensor coordinates in mm, undistorted = distorted (1 + kappa r^2).
FOCAL_LENGTH_MM = 5.5549183034
KAPPA_PER_MM2 = 5.1113043639e-3
CENTRE_PX = np.array([324.22149053, 282.56650051])
PITCH_MM = np.array([5.1273271277e-3 / 1.0937855397, 4.65e-3])
ROTATION_RAD = (2.0405458695, -0.89337703748, -0.43056124791)  # about x, then y, then z
TRANSLATION_M = np.array([0.82873214225, -3.1754796051, 35.469298547])

_FOUND = """
SELECT camera_height_m, camera_height_std_m, degrees(tilt_rad) AS tilt_deg,
    degrees(tilt_std_rad) AS tilt_std_deg, degrees(roll_rad) AS roll_deg,
    degrees(roll_std_rad) AS roll_std_deg
FROM cameras WHERE camera_height_m IS NOT NULL
"""
_BOXES = """
SELECT track_id, method, depth_m, depth_std_m, height_m,
    (x_min_px + x_max_px) / 2 AS middle_px, y_min_px, y_max_px
FROM current_estimates JOIN observations USING (recording_id, observation_index, track_id)
WHERE method IN ('fused', 'ground') AND NOT truncated_bottom AND NOT truncated_top
"""
_TRACKS = """
SELECT t.height_m, t.height_std_m, s.spread_m
FROM track_heights AS t JOIN (
    SELECT track_id, stddev_samp(height_m) AS spread_m,
        (max(capture_time_ns) - min(capture_time_ns)) / 1e9 AS seconds
    FROM current_estimates WHERE method = 'fused' AND NOT height_assumed GROUP BY track_id
) AS s USING (track_id)
WHERE t.method = 'fused' AND t.height_plausible AND s.seconds >= 2
"""


def survey() -> tuple[Floats, Floats]:
    """Return the rotation from world to camera, (3, 3), and the camera's place, (3,), z up."""
    (cx, cy, cz), (sx, sy, sz) = np.cos(ROTATION_RAD), np.sin(ROTATION_RAD)
    about_x = np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
    about_y = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
    about_z = np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]])
    rotation = about_z @ about_y @ about_x
    return rotation, -rotation.T @ TRANSLATION_M


def surveyed_pose() -> tuple[float, float, float]:
    """Return the camera's height in m, tilt and roll in degrees."""
    rotation, place_m = survey()
    down = -rotation[:, 2]
    tilt, roll = math.asin(down[2]), math.atan2(down[0], down[1])
    return float(place_m[2]), math.degrees(tilt), math.degrees(roll)


def surveyed_depth_and_height_m(foot_px: Floats, head_px: Floats) -> tuple[Floats, Floats]:
    """Return the depth of feet on the ground, and how high above them the head's ray passes."""
    rotation, place_m = survey()
    to_foot, to_head = (_rays(p) @ rotation for p in (foot_px, head_px))
    depth_m = -place_m[2] / to_foot[:, 2]
    foot_m = place_m + depth_m[:, None] * to_foot
    # Where the head's ray is nearest to the vertical above the foot, seen from above.
    over = foot_m[:, :2] - place_m[:2]
    along = (over * to_head[:, :2]).sum(axis=1) / (to_head[:, :2] ** 2).sum(axis=1)
    return depth_m, place_m[2] + along * to_head[:, 2]


def _rays(points_px: Floats) -> Floats:
    """Return the direction of pixels, (n, 3), in the camera's frame, one long along its axis."""
    distorted_mm = (points_px - CENTRE_PX) * PITCH_MM
    squared = (distorted_mm**2).sum(axis=1, keepdims=True)
    plane = distorted_mm * (1 + KAPPA_PER_MM2 * squared) / FOCAL_LENGTH_MM
    return np.column_stack([plane, np.ones(len(plane))])


def main(recording: Path = STREET) -> None:
    """Run on the recording alone, and print what came out beside the survey."""
    with tempfile.TemporaryDirectory(prefix="stadimeter-street-") as folder:
        database = Path(folder) / "street.duckdb"
        run([recording], database, Config())
        with Store.open(database, read_only=True) as store:
            found = store.query(_FOUND).to_pylist()
            boxes = store.query(_BOXES).to_pandas()
            tracks = store.query(_TRACKS).to_pandas()
    if not found:
        out.print("street: the pose was not determined")
        return
    _print_pose(found[0])
    foot = boxes[["middle_px", "y_max_px"]].to_numpy()
    head = boxes[["middle_px", "y_min_px"]].to_numpy()
    boxes["true_depth_m"], boxes["true_height_m"] = surveyed_depth_and_height_m(foot, head)
    rows = []
    for method, these in boxes.groupby("method"):
        error = these.depth_m - these.true_depth_m
        relative = error / these.true_depth_m
        inside = (error.abs() <= 1.96 * these.depth_std_m).mean()
        rows.append(
            [
                str(method),
                f"{len(these):,}",
                f"{100 * relative.abs().median():.1f}",
                f"{100 * relative.median():+.1f}",
                f"{100 * inside:.0f}",
            ]
        )
    header = ("method", "boxes", "depth off, median %", "bias, median %", "in 95 % interval, %")
    print_rows("Depth of the feet of the boxes, by the survey", header, rows)
    by_survey = boxes[boxes.method == "ground"].groupby("track_id").true_height_m.median()
    out.print(
        f"{len(tracks)} tracks of one person over 2 s or more: median height "
        f"{tracks.height_m.median():.2f} m, {100 * tracks.height_m.between(1.5, 2.0).mean():.0f} % "
        f"within 1.5-2.0 m, median spread along a track {100 * tracks.spread_m.median():.1f} cm"
    )
    out.print(f"median height of the tracks' boxes by the survey: {by_survey.median():.2f} m")


def _print_pose(found: dict[str, float]) -> None:
    names = ("camera_height_m", "tilt_deg", "roll_deg")
    rows = []
    for name, surveyed in zip(names, surveyed_pose(), strict=True):
        stem, unit = name.rsplit("_", 1)
        std = found[f"{stem}_std_{unit}"]
        off = (found[name] - surveyed) / std
        rows.append(
            [name, f"{surveyed:.2f}", f"{found[name]:.2f} ± {1.96 * std:.2f}", f"{off:+.1f}"]
        )
    header = ("", "survey", "found (95 %)", "off, standard deviations")
    print_rows("street: the pose from the people who walk there", header, rows)


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:2]))
