"""Effect of cutting a long recording: the same footage whole, and in windows stitched together.

Real people (`recordings/street.mcap`), played to and fro; the motion detector, which learns from what it
sees, is the hard case. With recorded detections or a network the boxes are the same by construction.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow.parquet as pq

from bench.footage import START_NS, STREET
from pipeline.cli.console import out, print_rows
from pipeline.cluster.manifest import read_manifests
from pipeline.cluster.shared_run import run_shared
from pipeline.core.config import Config
from pipeline.core.diagnostics import Notes
from pipeline.ingest.frames import FrameAssembler
from pipeline.mcap_file.reader import McapFile
from pipeline.mcap_file.writer import RecordingWriter, calibration_message, image_message

SIDES = ["x_min_px", "y_min_px", "x_max_px", "y_max_px"]
FRAME_NS = 100_000_000


def write_long(path: Path, seconds: float) -> None:
    """Write the street, played forwards and backwards, for a number of seconds at 10 frames a second."""
    config = Config()
    file = McapFile(STREET, config.limits, lambda note: None)
    frames = list(FrameAssembler(file, config.ingest, Notes()))
    lens = next(f.intrinsics for f in frames if f.intrinsics is not None)
    there_and_back = [*frames, *reversed(frames)]
    with RecordingWriter(path) as writer:
        writer.write("/bench/calibration", calibration_message(lens, START_NS, "bench"), START_NS)
        for index in range(round(seconds * 1e9 / FRAME_NS)):
            time_ns = START_NS + index * FRAME_NS
            picture = there_and_back[index % len(there_and_back)].image
            message = image_message(picture, "jpeg", time_ns, "bench")
            writer.write("/bench/image", message, time_ns)


def read(folder: Path, table: str) -> pd.DataFrame:
    """Return a table of the only recording in a folder."""
    (manifest,) = read_manifests(folder)
    return pq.read_table(folder / manifest.parts[table].path).to_pandas()


def compare(whole: pd.DataFrame, cut: pd.DataFrame) -> dict[str, float]:
    """Return the agreement of two sets of observations; boxes are matched if each is the other's best."""
    keys = ["camera", "frame_index"]
    pairs = whole.merge(cut, on=keys, suffixes=("", "_cut"))
    a = pairs[SIDES].to_numpy()
    b = pairs[[f"{s}_cut" for s in SIDES]].to_numpy()
    off_px = np.abs(a - b).max(axis=1)
    inside = np.minimum(a[:, 2:], b[:, 2:]) - np.maximum(a[:, :2], b[:, :2])
    shared = np.maximum(inside, 0).prod(axis=1)
    sizes = (a[:, 2:] - a[:, :2]).prod(axis=1) + (b[:, 2:] - b[:, :2]).prod(axis=1)
    pairs = pairs.assign(off_px=off_px, overlap=shared / (sizes - shared))
    for side in ("observation_index", "observation_index_cut"):
        pairs = pairs[pairs["overlap"] == pairs.groupby(side)["overlap"].transform("max")]
    pairs = pairs[pairs["overlap"] >= 0.5]
    tracks = pairs.groupby("track_id")["track_id_cut"].agg(lambda ids: ids.mode().iloc[0])
    same_track = pairs["track_id_cut"] == pairs["track_id"].map(tracks)
    return {
        "whole": len(whole),
        "windows": len(cut),
        "found by both": len(pairs) / max(len(whole), len(cut)),
        "within 1 px": float((pairs["off_px"] <= 1.0).mean()),
        "same track": float(same_track.mean()),
        "tracks whole": whole["track_id"].nunique(),
        "tracks windows": cut["track_id"].nunique(),
    }


def main() -> None:
    """Print the agreement of the results for several lengths of windows."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--seconds", type=float, default=480.0)
    parser.add_argument("--windows", type=float, nargs="*", default=[60.0, 120.0, 240.0])
    arguments = parser.parse_args() if __name__ == "__main__" else parser.parse_args([])
    with tempfile.TemporaryDirectory(prefix="stadimeter-bench-") as name:
        folder = Path(name)
        recording = folder / "long.mcap"
        write_long(recording, arguments.seconds)
        rows, whole = [], pd.DataFrame()
        for window_s in (0.0, *arguments.windows):
            target = folder / f"{window_s:g}"
            result = run_shared([recording], target, Config(), window_s=window_s)
            if result.failed:
                raise SystemExit(str(result.failed[0].error))
            found = read(target, "observations")
            if not window_s:
                whole = found
                continue
            alike = compare(whole, found)
            rows.append(
                [f"{window_s:g} s"]
                + [f"{v:.1%}" if isinstance(v, float) else f"{v:,}" for v in alike.values()]
            )
        out.print(f"{arguments.seconds:g} s of real street, motion detector")
        print_rows("Windows", ("window", *alike), rows)


if __name__ == "__main__":
    main()
