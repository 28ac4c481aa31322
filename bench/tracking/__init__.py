"""Detection and tracking against boxes and identities drawn by hand, and the targets for them.

    python -m bench.tracking [RECORDING TRUTH | FOLDER] [--model FILE]

Without arguments: `street`, with the truth in `recordings/street_truth.csv`. The first row of a clip is
of tracks as the tracker leaves them, the second of tracks that are linked, filled and smoothed once all
is seen; with a network, the third is of those that it confirms. A folder holds recordings or videos, with
truth beside those that have some (NAME_truth.csv, NAME_gt.txt ...). Below are the targets of the clips
whose names have some: met, missed, or not measured. `merged` counts tracks as tall as no person is there.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path

from bench.tracking.clips import COUNTS, ENDS, TRACKING, Clip, clips_in, figures_of
from bench.tracking.targets import rows_of
from pipeline.cli.console import out, print_rows
from pipeline.core.config import Config
from pipeline.core.errors import StadimeterError

RECORDINGS = Path(__file__).resolve().parents[2] / "recordings"
STREET = Clip(RECORDINGS / "street.mcap", RECORDINGS / "street_truth.csv")
PEOPLE = ("person_count", "at_once_count", "pose_count", "merged_count")


def main(arguments: list[str] | None = None) -> None:
    """Print the figures."""
    parser = argparse.ArgumentParser(prog="python -m bench.tracking")
    parser.add_argument("recording", nargs="?", type=Path, help="a recording, a video or a folder")
    parser.add_argument("truth", nargs="?", type=Path)
    parser.add_argument("--model", type=Path)
    given = parser.parse_args([] if arguments is None else arguments)
    tracks, people, targets = [], [], []
    for clip in _clips(given.recording, given.truth):
        for name, config in _configurations(given.model):
            try:
                figures = figures_of(clip, config)
            except StadimeterError as error:
                out.print(f"{clip.path.name}: {error}", markup=False)
                break
            row = [clip.path.name, name]
            if clip.truth is not None:
                tracks.append([*row, *_cells(figures, (*TRACKING, *COUNTS, *ENDS))])
            people.append([*row, *_cells(figures, PEOPLE)])
            if config.track.offline:
                targets += rows_of(clip.path.stem, bool(config.detect.model), figures)
    _print("Tracks against truth", (*TRACKING, *COUNTS, *ENDS), tracks)
    out.print(
        "At an overlap of 0.5; ends: median of what the edges of matched boxes are off, downwards"
    )
    _print("People and poses found", PEOPLE, people)
    print_rows("Targets", ["clip", "figure", "target", "measured", ""], targets)


def _clips(recording: Path | None, truth: Path | None) -> list[Clip]:
    if recording is None:
        return [STREET]
    return list(clips_in(recording)) if recording.is_dir() else [Clip(recording, truth)]


def _configurations(model: Path | None) -> Iterator[tuple[str, Config]]:
    usual = Config()
    yield "as followed", replace(usual, track=replace(usual.track, offline=False))
    yield "linked and smoothed", usual
    if model is not None:
        yield "and confirmed", replace(usual, detect=replace(usual.detect, model=str(model)))


def _cells(figures: Mapping[str, float], names: tuple[str, ...]) -> list[str]:
    cells = []
    for name in names:
        value, digits = figures.get(name), 2 if name.endswith("_px") else 3
        whole = name.endswith("_count")
        cells.append("" if value is None else f"{value:.{0 if whole else digits}f}")
    return cells


def _print(title: str, names: tuple[str, ...], rows: list[list[str]]) -> None:
    if rows:
        heads = [n.removesuffix("_count").replace("_", " ") for n in names]
        print_rows(title, ["clip", "tracks", *heads], rows)
