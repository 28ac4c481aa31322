"""Tightness of the motion detector's boxes: each edge against true silhouettes, on simulated cameras.

Pass 1 alone works each recording. A box and a silhouette are one when they share enough; a box that
holds two people is a merged one, one that holds a piece of somebody a part. Edges are judged where the
whole silhouette is in the picture and nothing hides it: alone, or touched by somebody else's box. Errors
are relative to the silhouette's height, since that is what they cost in depth; down and right are
positive.
"""

from __future__ import annotations

import argparse
import csv
import io
import multiprocessing
import tempfile
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pandas as pd
import pyarrow.parquet as pq
from mcap.reader import make_reader
from scipy.optimize import linear_sum_assignment

from pipeline.cli.console import out, print_rows
from pipeline.core.config import Config, DetectConfig
from pipeline.run.pass_one import measure_recording
from recordings.simulate_walkers import write
from recordings.walkers_random import make_scene
from recordings.walkers_scene import Settings

Floats = npt.NDArray[np.float64]

FIRST_SEED = 3000
# Every third camera has larger pictures, which the detector sees at half their size.
SMALL = Settings(duration_s=30.0, frame_rate=8.0, width_px=640, height_px=360, people=14)
LARGE = Settings(duration_s=24.0, frame_rate=8.0, width_px=1280, height_px=720, people=12)

SAME = 0.4  # intersection over union, of a box and the silhouette that it shows
HELD = 0.7  # of a silhouette, within a box: that person is in it
FILLED = 0.3  # of a box, within a silhouette: it shows a part of that person
SHOWN = 0.3  # of a silhouette: somebody who counts as to be found
WHOLE = 0.97
EDGE_PX = 2.0  # from the picture's edge
EDGES = ("left", "top", "right", "bottom")
BOX = ("x_min_px", "y_min_px", "x_max_px", "y_max_px")
# Heights of silhouettes in rows of the stored picture.
TALL_PX = ((0, 45), (45, 90), (90, 4000))


@dataclass(frozen=True, slots=True)
class Result:
    """Result of one camera."""

    seed: int
    edges: pd.DataFrame  # one row for each matched, wholly visible silhouette
    counts: dict[str, int]
    ms_a_frame: float


def settings_of(seed: int) -> Settings:
    """Return the settings of the camera of a seed."""
    plain = LARGE if seed % 3 == 2 else SMALL
    return Settings(
        seed, plain.duration_s, plain.frame_rate, plain.width_px, plain.height_px, plain.people
    )


def measure(seed: int, kept: Path | None = None) -> Result:
    """Simulate a camera, or take its recording from where it is kept, and judge its boxes."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        settings = settings_of(seed)
        recording = (kept or folder) / f"boxes-{seed}.mcap"
        if recording.exists():
            scene = make_scene(settings)
        else:
            fresh = folder / "fresh.mcap"
            scene = write(fresh, settings)
            recording.write_bytes(fresh.read_bytes())
        start = time.process_time()
        config = Config(detect=DetectConfig(method="motion"))
        measure_recording(recording, config, folder / "parts", threads=1)
        spent_s = time.process_time() - start
        found = pq.read_table(folder / "parts" / "observations.parquet").to_pandas()
        tracks = pq.read_table(folder / "parts" / "tracks.parquet").to_pandas()
        found = found[found["track_id"].isin(tracks["track_id"])]
        size = (settings.width_px, settings.height_px)
        edges, counts = judge(found, silhouettes(recording), size)
        edges["sun"] = scene.sun is not None
        edges["seed"] = seed
        return Result(seed, edges, counts, 1e3 * spent_s / settings.frames)


def silhouettes(recording: Path) -> pd.DataFrame:
    """Return the true silhouettes of a simulated recording, a row each person and frame."""
    with recording.open("rb") as stream:
        for attachment in make_reader(stream).iter_attachments():
            if attachment.name == "silhouettes.csv":
                rows = list(csv.DictReader(io.StringIO(attachment.data.decode())))
                table = pd.DataFrame(rows)
                numbers = ["frame", "visible_share", *BOX]
                return table.astype(dict.fromkeys(numbers, float))
    raise ValueError(f"{recording} was not simulated")


def judge(
    found: pd.DataFrame, true: pd.DataFrame, size: tuple[int, int]
) -> tuple[pd.DataFrame, dict[str, int]]:
    """Return edges of matched boxes beside the true ones, and counts of kinds of boxes."""
    counts = dict.fromkeys(("boxes", "one", "several", "part", "nobody", "people", "found"), 0)
    rows = []
    boxes_of = dict(list(found.groupby("frame_index")))
    full = np.array([*(-0.5, -0.5), size[0] - 0.5, size[1] - 0.5])
    first = found["frame_index"].min() if len(found) else 0
    for frame, people in true[true["frame"] >= first].groupby("frame"):
        boxes = boxes_of.get(int(frame), found.iloc[:0])  # type: ignore[call-overload]
        whole = people[list(BOX)].to_numpy()
        seen = np.clip(whole, np.tile(full[:2], 2), np.tile(full[2:], 2))
        box = boxes[list(BOX)].to_numpy()
        std = boxes[[f"{n.removesuffix('_px')}_std_px" for n in BOX]].to_numpy()
        shows = people["visible_share"].to_numpy() > SHOWN
        shared = _shared(box, seen)
        union = _area(box)[:, None] + _area(seen) - shared
        overlap = shared / np.maximum(union, 1e-9)
        which, whom = linear_sum_assignment(-overlap)
        good = overlap[which, whom] >= SAME
        which, whom = which[good], whom[good]
        held = ((shared > HELD * _area(seen)) & shows).sum(axis=1)
        matched = np.isin(np.arange(len(box)), which)
        filled = (shared / np.maximum(_area(box), 1e-9)[:, None]).max(axis=1, initial=0.0)
        counts["boxes"] += len(box)
        counts["several"] += int((held > 1).sum())
        counts["one"] += int((matched & (held < 2)).sum())
        counts["part"] += int((~matched & (held < 2) & (filled >= FILLED)).sum())
        counts["nobody"] += int((~matched & (held < 2) & (filled < FILLED)).sum())
        counts["people"] += int(shows.sum())
        counts["found"] += int(shows[whom].sum())
        alone = (_shared(seen, seen) > 0).sum(axis=1) == 1
        inside = (whole[:, :2] > full[:2] + EDGE_PX).all(axis=1)
        inside &= (whole[:, 2:] < full[2:] - EDGE_PX).all(axis=1)
        usable = inside & (people["visible_share"].to_numpy() >= WHOLE)
        for b, p in zip(which, whom, strict=True):
            if usable[p] and held[b] < 2:
                tall = whole[p, 3] - whole[p, 1]
                who = people["object_id"].iloc[p]
                track = boxes["track_id"].iloc[b]
                rows.append([who, track, frame, tall, alone[p], *(box[b] - whole[p]), *std[b]])
    names = [*EDGES, *(f"{e}_std" for e in EDGES)]
    columns = ["person", "track", "frame", "tall_px", "alone", *names]
    return pd.DataFrame(rows, columns=columns), counts


def _area(box: Floats) -> Floats:
    return np.asarray(np.prod(np.maximum(box[:, 2:] - box[:, :2], 0), axis=1))


def _shared(a: Floats, b: Floats) -> Floats:
    """Return the area that each two share, (a, b)."""
    low = np.maximum(a[:, None, :2], b[None, :, :2])
    high = np.minimum(a[:, None, 2:], b[None, :, 2:])
    return np.asarray(np.prod(np.maximum(high - low, 0), axis=2))


def main() -> None:
    """Print the results of some cameras."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--cameras", type=int, default=4)
    parser.add_argument("--workers", type=int, default=multiprocessing.cpu_count())
    parser.add_argument("--keep", type=Path, help="folder in which recordings are kept")
    given, _ = parser.parse_known_args()
    if given.keep:
        given.keep.mkdir(parents=True, exist_ok=True)
    seeds = range(FIRST_SEED, FIRST_SEED + given.cameras)
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(max(1, given.workers), mp_context=context) as pool:
        results = list(pool.map(partial(measure, kept=given.keep), seeds))
    out.print(f"{given.cameras} simulated cameras")
    print_counts(results)
    edges = pd.concat([r.edges for r in results])
    print_edges(edges)
    out.print(
        f"pass 1: {np.mean([r.ms_a_frame for r in results]):.2f} ms CPU a frame, decoding too"
    )


def print_counts(results: list[Result]) -> None:
    """Print how many boxes hold one person, several, or a part of one."""
    counts = {k: sum(r.counts[k] for r in results) for k in results[0].counts}
    boxes = max(counts["boxes"], 1)
    shares = {k: 100 * counts[k] / boxes for k in ("one", "several", "part", "nobody")}
    out.print(
        f"of {boxes} boxes {shares['one']:.1f} % show one person, {shares['several']:.1f} % several, "
        f"{shares['part']:.1f} % a part, {shares['nobody']:.1f} % nobody; of the people "
        f"{100 * counts['found'] / max(counts['people'], 1):.1f} % are found"
    )


def print_edges(edges: pd.DataFrame) -> None:
    """Print bias, spread and honesty of each edge, by the silhouette's size, light and company."""
    groups = [("all", np.full(len(edges), True))]
    groups += [("alone", edges["alone"]), ("touched", ~edges["alone"])]
    groups += [("sun", edges["sun"] & edges["alone"]), ("clouds", ~edges["sun"] & edges["alone"])]
    for low, high in TALL_PX:
        within = edges["tall_px"].between(low, high, inclusive="left") & edges["alone"]
        groups.append((f"{low}-{high} px", within))
    rows = []
    for label, chosen in groups:
        part = edges[chosen]
        if len(part) < 20:
            continue
        for edge in ("top", "bottom", "left", "right", "height"):
            rows.append([label if edge == "top" else "", edge, *_described(part, edge)])
    header = (
        "silhouettes",
        "edge",
        "boxes",
        "bias %",
        "spread %",
        "worst tenth %",
        "bias px",
        "spread px",
        "stated px",
        "in 95 %",
        "of the track",
    )
    print_rows("Edges less the true ones, as a share of the height", header, rows)


def _described(part: pd.DataFrame, edge: str) -> list[str]:
    if edge == "height":
        error = part["bottom"] - part["top"]
        std = np.hypot(part["bottom_std"], part["top_std"])
    else:
        error, std = part[edge], part[f"{edge}_std"]
    share = 100 * error / part["tall_px"]
    # the part of the spread that a whole track has in common, and more frames do not lessen
    people = share.groupby([part["seed"], part["track"]])
    common = people.median()[people.count() >= 8]
    return [
        str(len(part)),
        f"{share.median():+.2f}",
        f"{_spread(share):.2f}",
        f"{share.abs().quantile(0.9):.2f}",
        f"{error.median():+.2f}",
        f"{_spread(error):.2f}",
        f"{std.median():.2f}",
        f"{100 * (error.abs() < 1.96 * std).mean():.0f}",
        f"{_spread(common):.2f}",
    ]


def _spread(values: pd.Series) -> float:
    """Return the standard deviation by the median absolute deviation."""
    return float(1.4826 * (values - values.median()).abs().median())


if __name__ == "__main__":
    main()
