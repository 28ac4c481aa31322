"""Targets and folders of `python -m bench.tracking`."""

from __future__ import annotations

import pytest

from bench import tracking
from bench.tracking.clips import Clip, clips_in, figures_of
from bench.tracking.targets import TARGETS, rows_of
from pipeline.core.config import Config


def test_a_bound_is_kept_from_its_own_side():
    verdict = {
        figure: rows_of("street", False, {figure: value})[order][-1]
        for order, figure, value in (
            (0, "recall", 0.95),
            (1, "precision", 0.8999),
            (4, "switch_count", 10),
            (5, "foot_px", 2.01),
        )
    }
    assert verdict == {
        "recall": "met", "precision": "missed", "switch_count": "met", "foot_px": "missed",
    }  # fmt: skip


def test_a_figure_that_is_not_there_is_not_met():
    rows = rows_of("tud_campus", True, {"recall": 0.9})
    assert [row[-1] for row in rows] == ["met", "not measured"]
    assert rows_of("nobody_knows", False, {"recall": 0.9}) == []


def test_every_target_is_of_a_figure_that_is_measured():
    known = {*tracking.TRACKING, *tracking.COUNTS, *tracking.ENDS, *tracking.PEOPLE}
    assert {target.figure for target in TARGETS} <= known


def test_a_folder_gives_its_clips_with_their_truth(tmp_path):
    for name in ("b.avi", "a.mcap", "a_truth.csv", "b_gt.txt", "c.MP4", "notes.txt"):
        (tmp_path / name).touch()
    assert list(clips_in(tmp_path)) == [
        Clip(tmp_path / "a.mcap", tmp_path / "a_truth.csv"),
        Clip(tmp_path / "b.avi", tmp_path / "b_gt.txt"),
        Clip(tmp_path / "c.MP4", None),
    ]


def test_a_clip_that_cannot_be_read_is_named_and_the_rest_goes_on(tmp_path, capsys):
    (tmp_path / "bottles.mp4").write_bytes(b"no video")
    tracking.main([str(tmp_path)])
    assert "bottles.mp4" in capsys.readouterr().out


@pytest.mark.slow
def test_street_is_judged_with_its_truth():
    figures = figures_of(tracking.STREET, Config())
    assert figures["recall"] > 0.9
    assert figures["hota"] > 0.65
    assert figures["pose_count"] == 1
    assert figures["person_count"] >= figures["at_once_count"] >= 4
    assert "merged_count" in figures
    without = figures_of(Clip(tracking.STREET.path, None), Config())
    assert "recall" not in without
    assert without["person_count"] == figures["person_count"]
