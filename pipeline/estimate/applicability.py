"""Diagnostics on estimates that were not made, or that lie outside a calibration."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from pipeline.core.calibration import Calibration
from pipeline.core.config import Config
from pipeline.core.records import Diagnostic, Severity
from pipeline.estimate.methods import METHODS, Method
from pipeline.estimate.methods.scaling import calibrations_for
from pipeline.estimate.types import Estimated, Measured

# Methods whose calibration is a table over f-numbers.
BY_F_NUMBER = tuple(method for method in METHODS if method.by_f_number)


@dataclass(slots=True)
class Classes:
    """Counts of a camera's observations by class, summed over batches of them."""

    count: Counter[str] = field(default_factory=Counter)
    f_number_known: Counter[str] = field(default_factory=Counter)
    f_number_beyond: Counter[tuple[str, str]] = field(default_factory=Counter)
    """Observations beyond the calibrated f-numbers, by method and class."""

    def add(self, measured: Measured, config: Config) -> None:
        """Count the observations of a batch."""
        calibrated = {m.name: _by_class(config, m, measured.camera) for m in BY_F_NUMBER}
        for name in set(measured.class_name):
            n = measured.f_number[measured.class_name == name]
            self.count[name] += len(n)
            self.f_number_known[name] += int(np.isfinite(n).sum())
            for method in BY_F_NUMBER:
                calibration = calibrated[method.name].get(name)
                if calibration is None:
                    continue
                table = calibration.by_f_number(method.by_f_number)[0]
                if len(table):
                    beyond = int(((n < table[0]) | (n > table[-1])).sum())
                    self.f_number_beyond[method.name, name] += beyond


def _by_class(config: Config, method: Method, camera: str) -> Mapping[str, Calibration]:
    """Return the calibrations that a method needs, by class of object."""
    if method.calibration is None:
        return {}
    return {c.object_class: c for c in calibrations_for(config, method.calibration, camera)}


def not_applicable(camera: str, classes: Classes, config: Config) -> list[Diagnostic]:
    """Say, once a class of a camera, why a method does not apply to it."""
    sized = {p.object_class for p in config.size_prior} | {
        c.object_class for c in config.calibration if c.camera in ("", camera)
    }
    notes = []
    for name, count in sorted(classes.count.items(), key=str):
        if name not in sized:
            problem = f"the size of {name!r} is not known: no depth from its size"
            notes.append(_info(camera, "size_unknown", problem, count))
        for method in BY_F_NUMBER:
            notes += _by_f_number(method, name, camera, classes, config)
    return notes


def _by_f_number(
    method: Method, name: str, camera: str, classes: Classes, config: Config
) -> list[Diagnostic]:
    """Say why a method whose calibration is a table over f-numbers does not apply to a class."""
    calibration = _by_class(config, method, camera).get(name)
    if calibration is None:
        problem = (
            f"`{method.name}` does not apply to {name!r}: {method.by_f_number} holds for the camera "
            "and objects on which it was calibrated, and there is no calibration for these"
        )
        return [_info(camera, "method_not_applicable", problem, classes.count[name])]
    if not classes.f_number_known[name]:
        problem = f"`{method.name}` does not apply to {name!r}: the f-number is not known"
        return [_info(camera, "method_not_applicable", problem, classes.count[name])]
    beyond = classes.f_number_beyond[method.name, name]
    if not beyond or config.estimate.extrapolate:
        return []
    table = calibration.by_f_number(method.by_f_number)[0]
    problem = (
        f"`{method.name}` was refused for {name!r} at f-numbers outside the calibrated "
        f"f/{table[0]:g} to f/{table[-1]:g}"
    )
    return [_info(camera, "f_number_outside_calibration", problem, beyond)]


def outside_calibration(measured: Measured, estimated: Estimated, method: str) -> list[Diagnostic]:
    """Say how many estimates of a method lie outside the range in which it was calibrated."""
    count = int((estimated.in_calibrated_range == 0).sum())
    if count == 0:
        return []
    problem = (
        f"estimates by `{method}` lie outside the range in which it was calibrated; "
        "in_calibrated_range is false for them"
    )
    return [_info(measured.camera, "outside_calibrated_range", problem, count)]


def _info(camera: str, code: str, problem: str, count: int) -> Diagnostic:
    return Diagnostic(Severity.INFO, code, problem, camera=camera, count=count)
