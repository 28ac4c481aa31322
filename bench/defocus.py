"""Depth from defocus, from simulated pictures: the estimators of blur, depth, its intervals, and `fused`.

    python -m bench.defocus --shots 400

A shot is one target at 0.5-5 m before a textured wall, through a 50 mm lens at f/1.8-f/8 that is focused
at infinity, 0.7, 1.5 or 3 m, on pixels of 8-26 um, with a softness, mosaic, noise and JPEG of its own.
The lens that draws departs from the one that is stated by a maker's tolerances. `size` is a prior with
a spread of 15 %, whose mean is off by as much. What is measured is what `run` does with such a picture:
the same functions, without the database.
"""

from __future__ import annotations

import argparse
import time
from collections import Counter
from dataclasses import dataclass, field
from itertools import pairwise

import cv2
import numpy as np

from bench.blur_estimators import ESTIMATORS
from pipeline.cli.console import out, print_rows
from pipeline.core.arrays import FloatArray
from pipeline.core.calibration import Dimension
from pipeline.core.config import Config, SizePrior
from pipeline.core.lens import Lens
from pipeline.core.records import Boxes, Intrinsics
from pipeline.estimate.boxes.geometry import Geometry
from pipeline.estimate.fusion import fused
from pipeline.estimate.methods import defocus, size
from pipeline.estimate.types import Estimated, Measured
from pipeline.measure.blur import widths as blur_measure
from pipeline.measure.blur.expected import FLOOR_PX
from pipeline.measure.blur.widths import Blur, combine, expected, measure, unmeasured
from pipeline.optics.defocus import diffraction_sigma_um
from recordings.sweep_random import F_NUMBERS, Shot, random_shot
from recordings.sweep_scene import jpeg, photograph

PRIOR_SPREAD = 0.15
FIRST_SEED = 10_000  # not those on which constants were looked at
NARROW = 0.20  # whole width of the 95 % interval over depth
Z95 = 1.96
BINS_M = (0.5, 1.0, 1.5, 2.5, 5.0)


@dataclass(slots=True)
class Row:
    """Result of one shot."""

    shot: Shot
    true_sigma_px: float
    sigma_px: dict[str, float]
    seconds: dict[str, float]
    reason: str
    depth: dict[str, tuple[float, float]] = field(default_factory=dict)  # and its deviation
    branch: str = ""


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--shots", type=int, default=200)
    parser.add_argument("--seed", type=int, default=FIRST_SEED)
    given, _ = parser.parse_known_args()
    cv2.setNumThreads(1)
    rows = [row_of(seed) for seed in range(given.seed, given.seed + given.shots)]
    print_estimators(rows)
    print_depths(rows)
    print_fused(rows)


def row_of(seed: int) -> Row:
    """Draw a shot, and measure it in every way."""
    shot = random_shot(seed)
    picture = photograph(shot.scene, shot.lens, seed)
    picture = cv2.imdecode(np.frombuffer(jpeg(picture, shot.lens.jpeg_quality), np.uint8), 1)
    box = np.array(shot.target.box_px(shot.lens))
    sigma, seconds = {}, {}
    for name, estimator in ESTIMATORS.items():
        start = time.process_time()
        blur_measure.widths_of = estimator
        widths = blur_measure.widths_in(picture, box, np.empty((0, 4)), FLOOR_PX, 1.0)
        sigma[name] = combine(widths, box)[0]
        seconds[name] = time.process_time() - start
    blur_measure.widths_of = ESTIMATORS["edge fit, disc and floor"]
    blur, estimates = estimates_of(shot, picture, seed)
    row = Row(shot, true_sigma_px(shot), sigma, seconds, str(blur.reason[0] or ""))
    for method, estimated in estimates.items():
        row.depth[method] = (float(estimated.depth_m[0]), float(estimated.depth_std_m[0]))
    row.branch = str(estimates["defocus"].branch[0] or "")
    return row


def true_sigma_px(shot: Shot) -> float:
    """Return what the blur should be; a mosaic's own softness is taken as half a pixel."""
    lens = shot.lens
    diffraction = float(diffraction_sigma_um(lens.f_number)) / lens.pixel_pitch_um
    mosaic = 0.5 if lens.mosaic else 0.0
    radius = lens.blur_radius_px(shot.target.depth_m)
    return float(np.sqrt(radius**2 / 4 + lens.floor_sigma_px**2 + diffraction**2 + mosaic**2))


def estimates_of(shot: Shot, picture: np.ndarray, seed: int) -> tuple[Blur, dict[str, Estimated]]:
    """Return the target's blur and depths by defocus, size and both."""
    lens, stated = shot.lens, shot.stated
    off = np.random.default_rng((15, seed)).standard_normal() * PRIOR_SPREAD
    mean_m = shot.target.width_m * max(1 + off, 0.4)
    # The spread is that of the prior, so that it is right on average of what is drawn.
    prior = SizePrior("target", Dimension.WIDTH, mean_m, PRIOR_SPREAD * shot.target.width_m)
    config = Config(size_prior=(prior,))
    box = np.array([shot.target.box_px(lens)])
    boxes = Boxes(box, np.ones(1), ("target",), np.full((1, 4), 0.5), (None,))
    pitch = stated.pixel_pitch_um
    known = Lens(stated.f_number, stated.focal_length_mm, stated.focus_distance_m, pitch, pitch)
    worth = expected(boxes, known, config, "bench")
    blur = (
        measure(picture, boxes, worth, known, config, "bench")
        if worth.any()
        else unmeasured(1, known)
    )
    geometry = Geometry.of(_measured(boxes, known, shot, blur))
    by_size = size.estimate(geometry, config)
    members = {"size": by_size}
    by_blur = defocus.estimate(geometry.after(members), config)
    if np.isfinite(by_blur.depth_m).any():
        members["defocus"] = by_blur
    return blur, {
        "size": by_size,
        "defocus": by_blur,
        "fused": fused.estimate(geometry, members),
    }


def _measured(boxes: Boxes, lens: Lens, shot: Shot, blur: Blur) -> Measured:
    focal_px = shot.stated.focal_px  # at the stated focus
    width, height = shot.stated.width_px, shot.stated.height_px
    return Measured(
        camera="bench",
        observation_index=np.zeros(1, dtype=np.int64),
        frame_index=np.zeros(1, dtype=np.int64),
        capture_time_ns=np.zeros(1, dtype=np.int64),
        track_id=np.zeros(1, dtype=np.int64),
        class_name=np.array(["target"], dtype=np.object_),
        bbox_xyxy_px=boxes.bbox_xyxy_px,
        std_xyxy_px=boxes.std_px,
        truncated=np.zeros((1, 4), dtype=np.bool_),
        occlusion=np.zeros(1),
        f_number=np.array([lens.f_number]),
        focal_length_mm=np.array([lens.focal_length_mm]),
        focus_distance_m=np.array([lens.focus_distance_m]),
        pixel_pitch_x_um=np.array([lens.pixel_pitch_x_um]),
        pixel_pitch_y_um=np.array([lens.pixel_pitch_y_um]),
        intrinsics=Intrinsics(width, height, focal_px, focal_px, (width - 1) / 2, (height - 1) / 2),
        ground_plane=None,
        exposure_time_s=np.array([shot.stated.exposure_time_s]),
        blur_sigma_px=blur.sigma_px,
        blur_std_px=blur.std_px,
    )


def print_estimators(rows: list[Row]) -> None:
    """Print how wrong each estimator of blur is, by how wide the blur is."""
    true = np.array([r.true_sigma_px for r in rows])
    table = []
    for name in ESTIMATORS:
        found = np.array([r.sigma_px[name] for r in rows])
        for low, high in ((1.0, 2.0), (2.0, 5.0), (5.0, 10.0), (10.0, 60.0)):
            of = (true >= low) & (true < high)
            off = (found / true - 1)[of & np.isfinite(found)]
            table.append(
                [
                    name,
                    f"{low:g}-{high:g}",
                    f"{np.isfinite(found[of]).sum()} of {of.sum()}",
                    f"{100 * np.median(off):+.1f}" if len(off) else "",
                    f"{100 * np.median(np.abs(off)):.1f}" if len(off) else "",
                    f"{100 * np.percentile(np.abs(off), 90):.1f}" if len(off) else "",
                    f"{1e3 * np.mean([r.seconds[name] for r in rows]):.0f}",
                ]
            )
    header = ("estimator", "sigma, px", "found", "bias %", "median off %", "90 % within %", "ms")
    print_rows("the blur of a target's edges", header, table)


def print_depths(rows: list[Row]) -> None:
    """Print depth by defocus, by aperture and by distance."""
    why = Counter(r.reason or ("no side" if not r.branch else "depth") for r in rows)
    out.print("of the shots: " + ", ".join(f"{n} {w}" for w, n in why.most_common()))
    sides = Counter(
        r.branch == ("near" if r.shot.target.depth_m < r.shot.lens.focus_distance_m else "far")
        for r in rows
        if r.branch
    )
    out.print(f"on the right side of focus: {sides[True]} of {sides.total()}")
    groups = [(f"f/{n:g}", [r for r in rows if r.shot.stated.f_number == n]) for n in F_NUMBERS]
    groups += [
        (f"{a:g}-{b:g} m", [r for r in rows if a <= r.shot.target.depth_m < b])
        for a, b in pairwise(BINS_M)
    ]
    table = [_depth_row(name, group) for name, group in [*groups, ("all", rows)]]
    header = (
        "", "shots", "with depth", "median off %", "in 95 %",
        "narrow", "median off %", "in 95 %",
    )  # fmt: skip
    print_rows("depth by defocus; narrow: 95 % interval under 20 % wide", header, table)


def _depth_row(name: str, rows: list[Row]) -> list[str]:
    off, z, narrow = scores(rows, "defocus")
    return [
        name,
        str(len(rows)),
        str(len(off)),
        _percent(np.median(np.abs(off))) if len(off) else "",
        _percent((np.abs(z) < Z95).mean()) if len(off) else "",
        str(int(narrow.sum())),
        _percent(np.median(np.abs(off[narrow]))) if narrow.any() else "",
        _percent((np.abs(z[narrow]) < Z95).mean()) if narrow.any() else "",
    ]


def scores(rows: list[Row], method: str) -> tuple[FloatArray, FloatArray, np.ndarray]:
    """Return relative errors, errors in deviations, and whether the interval is narrow."""
    depth = np.array([r.depth[method] for r in rows]).reshape(-1, 2)
    true = np.array([r.shot.target.depth_m for r in rows])
    known = np.isfinite(depth[:, 0])
    depth, true = depth[known], true[known]
    off = depth[:, 0] - true
    return off / true, off / depth[:, 1], 2 * Z95 * depth[:, 1] < NARROW * depth[:, 0]


def print_fused(rows: list[Row]) -> None:
    """Print fused beside its members, where both are: by which of them is the surer, and how much."""
    both = [r for r in rows if np.isfinite(r.depth["defocus"][0])]
    ratio = np.array(
        [
            (r.depth["defocus"][1] / r.depth["defocus"][0])
            / (r.depth["size"][1] / r.depth["size"][0])
            for r in both
        ]
    )
    table = []
    groups = [
        ("defocus 4 times as sure as size, or more", ratio < 0.25),
        ("twice to 4 times", (ratio >= 0.25) & (ratio < 0.5)),
        ("half to twice", (ratio >= 0.5) & (ratio < 2)),
        ("less than half", ratio >= 2),
        *((f"f/{n:g}", np.array([r.shot.stated.f_number == n for r in both])) for n in F_NUMBERS),
        ("all", np.ones(len(both), dtype=bool)),
    ]
    for name, mask in groups:
        group = [r for r, m in zip(both, mask, strict=True) if m]
        if len(group) < 5:
            continue
        rms = {
            m: float(np.sqrt(np.mean(scores(group, m)[0] ** 2)))
            for m in ("defocus", "size", "fused")
        }
        z = scores(group, "fused")[1]
        table.append(
            [
                name,
                str(len(group)),
                *(_percent(rms[m]) for m in rms),
                f"{rms['fused'] / min(rms['defocus'], rms['size']):.2f}",
                _percent((np.abs(z) < Z95).mean()),
            ]
        )
    header = ("", "shots", "defocus %", "size %", "fused %", "fused / best", "fused in 95 %")
    print_rows("root mean square of relative depth errors", header, table)


def _percent(value: float) -> str:
    return f"{100 * value:.1f}"


if __name__ == "__main__":
    main()
