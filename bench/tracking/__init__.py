"""Detection and tracking on the street clip, against boxes and identities drawn by hand.

    python -m bench.tracking [RECORDING TRUTH] [--model FILE]

Without arguments: `street`, with the truth in `recordings/street_truth.csv`. The first row is of tracks
as the tracker leaves them, the second of tracks that are linked, filled and smoothed once all is seen;
with a network, the third is of those that it confirms.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from pipeline.cli.console import out, print_rows
from pipeline.core.config import Config
from pipeline.run.recordings import run
from pipeline.run.truth import add_truth_of_file
from pipeline.store.database import Store

RECORDINGS = Path(__file__).resolve().parents[2] / "recordings"
FIGURES = ("recall", "precision", "idf1", "hota", "deta", "assa", "mota")
COUNTS = ("switch_count", "fragment_count")
_ENDS = """
SELECT median(o.y_max_px - t.y_max_px) AS foot_bias_px, median(abs(o.y_max_px - t.y_max_px)) AS foot_px,
    median(o.y_min_px - t.y_min_px) AS head_bias_px, median(abs(o.y_min_px - t.y_min_px)) AS head_px
FROM matches AS m
JOIN observations AS o USING (recording_id, observation_index)
JOIN ground_truth AS t ON t.recording_id = m.recording_id AND t.camera = m.camera
    AND t.frame_index = m.frame_index AND t.object_id = m.object_id
"""


def main(arguments: list[str] | None = None) -> None:
    """Print the figures."""
    parser = argparse.ArgumentParser(prog="python -m bench.tracking")
    parser.add_argument("recording", nargs="?", type=Path, default=RECORDINGS / "street.mcap")
    parser.add_argument("truth", nargs="?", type=Path, default=RECORDINGS / "street_truth.csv")
    parser.add_argument("--model", type=Path)
    given = parser.parse_args([] if arguments is None else arguments)
    rows = [
        [name, *_measured(given.recording, given.truth, config)]
        for name, config in _configurations(given.model)
    ]
    ends = ("foot bias px", "foot px", "head bias px", "head px")
    title = f"{given.recording.name}: tracks against {given.truth.name}"
    print_rows(title, ["tracks", *FIGURES, *COUNTS, *ends], rows)
    out.print(
        "At an overlap of 0.5; ends: median of what the edges of matched boxes are off, downwards"
    )


def _configurations(model: Path | None) -> Iterator[tuple[str, Config]]:
    usual = Config()
    yield "as followed", replace(usual, track=replace(usual.track, offline=False))
    yield "linked and smoothed", usual
    if model is not None:
        yield "and confirmed", replace(usual, detect=replace(usual.detect, model=str(model)))


def _measured(recording: Path, truth: Path, config: Config) -> list[str]:
    with tempfile.TemporaryDirectory() as folder:
        database = Path(folder) / "street.duckdb"
        run([recording], database, config)
        add_truth_of_file(truth, database)
        with Store.open(database, read_only=True) as store:
            (figures,) = store.query("FROM accuracy.tracking").to_pylist()
            (ends,) = store.query(_ENDS).to_pylist()
    shares = [f"{figures[name]:.3f}" for name in FIGURES]
    return [*shares, *(str(figures[name]) for name in COUNTS), *(f"{v:.2f}" for v in ends.values())]
