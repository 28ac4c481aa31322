"""Properties of every function of the optics, later ones included."""

from __future__ import annotations

import ast
import importlib
import inspect
import sys
import warnings
from pathlib import Path

import numpy as np
import pytest

OPTICS = Path(__file__).parents[2] / "pipeline" / "optics"
MODULES = sorted(p.stem for p in OPTICS.glob("*.py") if p.stem != "__init__")
# Helpers that make no claim of their own, and functions that do not take arrays of numbers.
OTHER = {"floats", "positive", "check_distortion", "distort", "undistort"}
OTHER |= {"brown_curve", "fisheye_curve"}
POINTS = {"xy", "foot", "head"}
# An unknown focus distance counts as infinite (thin_lens), an unknown ray as level (silhouette).
UNKNOWN_IS_FINE = {
    ("mean_reach", "steep"),
    ("image_distance_mm", "focus_distance_m"),
    ("depth_of_field_m", "focus_distance_m"),
}
NASTY = np.array([np.nan, np.inf, -np.inf, 0.0, -0.0, -1.0, 0.05, 1.0, 50.0, 1e-310, 1e308])


def functions():
    for name in MODULES:
        module = importlib.import_module(f"pipeline.optics.{name}")
        for function in vars(module).values():
            mine = getattr(function, "__module__", "") == module.__name__
            if not (inspect.isfunction(function) and mine):
                continue
            if function.__name__[0] != "_" and function.__name__ not in OTHER:
                yield function


FUNCTIONS = list(functions())
every_function = pytest.mark.parametrize("function", FUNCTIONS, ids=lambda f: f.__name__)


def required(function):
    parameters = inspect.signature(function).parameters.values()
    return [p.name for p in parameters if p.default is p.empty]


def numbers(name, values):
    """Return an argument of a parameter: numbers, points, or the one covariance."""
    if name == "pose_covariance":
        return np.diag([0.1, 0.01, 0.01])
    return np.stack([values, values[::-1]], axis=-1) if name in POINTS else values


def results(result):
    return result if isinstance(result, tuple) else (result,)


def test_the_functions_are_found():
    assert len(FUNCTIONS) > 35
    assert {"depth_eq16_m", "height_jacobian"} <= {f.__name__ for f in FUNCTIONS}


@every_function
def test_nothing_warns_whatever_comes_in(function):
    rng = np.random.default_rng(1)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        function(*(numbers(p, rng.choice(NASTY, 3000)) for p in required(function)))


@every_function
def test_unknown_in_gives_unknown_out(function):
    names = required(function)
    known = {p: numbers(p, np.array([0.7, 0.8])) for p in names}
    for name in names:
        if name == "pose_covariance" or (function.__name__, name) in UNKNOWN_IS_FINE:
            continue
        one_unknown = known | {name: np.full_like(known[name], np.nan)}
        # Of several results not every one needs every argument.
        assert any(np.isnan(r).all() for r in results(function(**one_unknown))), name


@every_function
def test_arrays_broadcast_and_come_back_as_float64(function):
    names = required(function)
    shapes = [(3, 1), (1, 4)] * 4
    arguments = [numbers(p, np.full(s, 2)) for p, s in zip(names, shapes, strict=False)]
    returned = results(function(*arguments))
    for result in returned:
        assert isinstance(result, np.ndarray)
        assert result.dtype == np.float64
    if len(returned) == 1 and not POINTS & set(names):
        assert returned[0].shape == np.broadcast_shapes(*(a.shape for a in arguments))


@every_function
def test_the_docstring_says_what_it_returns(function):
    assert function.__doc__.startswith("Return ")


@pytest.mark.parametrize("name", MODULES)
def test_the_floor_stands_on_numpy_alone(name):
    tree = ast.parse((OPTICS / f"{name}.py").read_text())
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            imported = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            imported = [node.module or ""]
        else:
            continue
        for module in imported:
            root = module.split(".")[0]
            ours = module.startswith("pipeline.optics")
            assert ours or root == "numpy" or root in sys.stdlib_module_names, module
        assert not {"os", "io", "pathlib"} & set(imported)
    assert not [n for n in ast.walk(tree) if isinstance(n, ast.Name) and n.id in ("open", "print")]


def test_the_table_of_contents_lists_every_module():
    contents = importlib.import_module("pipeline.optics").__doc__
    assert all(f"\n{name}:" in contents for name in MODULES)
