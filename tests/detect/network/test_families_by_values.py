"""Families whose outputs have one shape, told apart by the values for one picture."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.core.errors import UnusableModel
from pipeline.detect.network.families import STRIDES, cells, recognise

SIZE = (416, 320)


def table(family: str) -> np.ndarray:
    """Return a box a cell, as a network that sees nothing gives them."""
    random = np.random.default_rng(2)
    centre_x, centre_y, stride = cells(SIZE, STRIDES).T
    offset = random.normal(0.5, 0.4, (len(stride), 2))
    rows = np.zeros((len(stride), 85))
    if family == "yolox":
        rows[:, :2] = offset
        rows[:, 2:4] = random.normal(0.5, 0.5, offset.shape)
    else:
        rows[:, 0] = centre_x + (offset[:, 0] - 0.5) * stride
        rows[:, 1] = centre_y + (offset[:, 1] - 0.5) * stride
        rows[:, 2:4] = stride[:, None] * np.exp(random.normal(0.5, 0.5, offset.shape))
    rows[:, 4] = 1.0 if family == "yolov5" else random.uniform(0, 0.01, len(stride))
    return rows[None]


@pytest.mark.parametrize("family", ["yolox", "yolox_decoded", "yolov5"])
def test_values_tell_what_shapes_do_not(family: str) -> None:
    values = table(family)
    assert recognise([values.shape], SIZE, None, {}, [values]) == family


def test_values_that_fit_nothing_are_not_guessed_at() -> None:
    values = np.zeros_like(table("yolox"))
    values[..., :2] = [[[20.0, 20.0]]]
    for outputs in ([], [values], [np.full_like(values, np.nan)]):
        with pytest.raises(UnusableModel, match="yolox or yolox_decoded or yolov5"):
            recognise([values.shape], SIZE, None, {}, outputs)
