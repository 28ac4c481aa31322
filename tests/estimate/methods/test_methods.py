"""The table of methods: one row a method, and what reads it."""

from __future__ import annotations

import importlib
import pkgutil
from dataclasses import FrozenInstanceError

import numpy as np
import pytest

from dashboards.style import ERROR, METHOD_COLOURS, on_white
from pipeline.core.calibration import CalibratedMethod, Calibration, Dimension, Parameter
from pipeline.estimate import methods
from pipeline.estimate.methods import FUSED, METHODS, NAMES, in_order
from pipeline.estimate.types import Estimated


def luminance(colour: str) -> float:
    """Return the relative luminance of WCAG 2.2 of #RRGGBB."""
    share = np.array(list(bytes.fromhex(colour[1:]))) / 255
    linear = np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)
    return float(linear @ (0.2126, 0.7152, 0.0722))


def test_every_file_with_a_method_has_its_row() -> None:
    modules = {
        m.name: importlib.import_module(f"{methods.__name__}.{m.name}")
        for m in pkgutil.iter_modules(methods.__path__)
    }
    found = {m.estimate for m in modules.values() if hasattr(m, "estimate")}
    assert found == {m.estimate for m in METHODS} - {None}


def test_rows_do_not_clash() -> None:
    assert sorted(m.order for m in METHODS) == list(range(len(METHODS)))
    assert len({m.name for m in METHODS}) == len({m.colour for m in METHODS}) == len(METHODS)
    assert all(m.text for m in METHODS)
    assert all(m.reads for m in METHODS if m.estimate)
    assert NAMES[0] == FUSED  # what is made of all methods stands for an observation
    assert {m.calibration for m in METHODS} - {None} <= set(CalibratedMethod)


def test_names_that_the_table_does_not_know_come_last() -> None:
    assert in_order({"zebra", "size", "fused", "ape"}) == ["fused", "size", "ape", "zebra"]


def test_colours_are_seen_on_white_and_on_black_and_none_means_an_error() -> None:
    for name, colour in METHOD_COLOURS.items():
        assert tuple(colour) != ERROR, name
        assert luminance("#" + bytes(colour).hex()) > 0.1, name
        # contrast of graphics (WCAG 2.2, 1.4.11) asks for 3; Okabe and Ito's orange and sky blue have 2.2
        assert 1.05 / (luminance(on_white(colour)) + 0.05) > 2.0, name


def test_estimates_cannot_be_changed() -> None:
    nothing = Estimated.unknown(2)
    with pytest.raises(FrozenInstanceError):
        nothing.depth_m = np.ones(2)  # type: ignore[misc]
    with pytest.raises(ValueError, match="read-only"):
        nothing.depth_m[0] = 1.0


def test_calibrations_keep_the_ids_that_databases_of_version_0_3_hold() -> None:
    staff = Calibration(
        CalibratedMethod.SIZE, "staff", Dimension.WIDTH, (Parameter("object_size_m", 0.5),)
    )
    assert staff.calibration_id == "5c9c7f3d25bd"
