"""docs/paper.md says what bench.paper finds, and the figures are those that were aimed at."""

from __future__ import annotations

from pathlib import Path

import pytest

from bench.paper import SECTIONS, depths, heights

PAGE = (Path(__file__).parents[3] / "docs" / "paper.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("title", SECTIONS)
def test_the_page_holds_what_the_program_prints(title):
    assert "\n".join(SECTIONS[title]()) in PAGE


def figures(lines, label):
    (line,) = [line for line in lines if label in line]
    return [cell.strip() for cell in line.strip("|").split("|")]


def test_depth_of_rows_left_out_is_better_than_the_papers():
    _, _, _, loo_cm, _, _, r = figures(depths(), "**one size**")
    assert float(loo_cm) < 2.5
    assert float(r) > 0.9929
    assert float(figures(depths(), "printed estimates")[3]) == 3.23


def test_height_is_better_than_the_papers_with_nothing_fitted():
    _, fitted, error_cm, _, _ = figures(heights(), "**exact")
    assert fitted == ""
    assert float(error_cm) < 1.0
