"""What a user should know of the estimates that were not made, or lie outside a calibration."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from pipeline.core.calibration import Calibration, Method
from pipeline.core.config import Config
from pipeline.core.records import Diagnostic, Severity
from pipeline.estimate.methods.scaling import calibrations_for
from pipeline.estimate.types import Estimated, Measured


@dataclass(slots=True)
class Classes:
    """How many observations a camera has of each class, summed over batches of them."""

    count: Counter[str] = field(default_factory=Counter)
    f_number_known: Counter[str] = field(default_factory=Counter)
    f_number_beyond: Counter[str] = field(
        default_factory=Counter
    )  # what `aperture` is calibrated for

    def add(self, measured: Measured, config: Config) -> None:
        """Count the observations of a batch."""
        calibrated = _by_class(config, measured.camera)
        for name in set(measured.class_name):
            n = measured.f_number[measured.class_name == name]
            self.count[name] += len(n)
            self.f_number_known[name] += int(np.isfinite(n).sum())
            if name not in calibrated:
                continue
            table = calibrated[name].by_f_number("k")[0]
            if len(table):
                self.f_number_beyond[name] += int(((n < table[0]) | (n > table[-1])).sum())


def _by_class(config: Config, camera: str) -> Mapping[str, Calibration]:
    return {c.object_class: c for c in calibrations_for(config, Method.APERTURE, camera)}


def not_applicable(camera: str, classes: Classes, config: Config) -> list[Diagnostic]:
    """Say, once a class of a camera, why a method does not apply to it."""
    calibrated = _by_class(config, camera)
    sized = {p.object_class for p in config.size_prior} | {
        c.object_class for c in config.calibration if c.camera in ("", camera)
    }
    notes = []
    for name, count in sorted(classes.count.items(), key=str):
        if name not in sized:
            problem = f"the size of {name!r} is not known: no depth from its size"
            notes.append(_info(camera, "size_unknown", problem, count))
        if name not in calibrated:
            problem = (
                f"`aperture` does not apply to {name!r}: k holds for the camera and objects on "
                "which it was calibrated, and there is no calibration for these"
            )
            notes.append(_info(camera, "method_not_applicable", problem, count))
        elif not classes.f_number_known[name]:
            problem = f"`aperture` does not apply to {name!r}: the f-number is not known"
            notes.append(_info(camera, "method_not_applicable", problem, count))
        elif (beyond := classes.f_number_beyond[name]) and not config.estimate.extrapolate:
            table = calibrated[name].by_f_number("k")[0]
            problem = (
                f"`aperture` was refused for {name!r} at f-numbers outside the calibrated "
                f"f/{table[0]:g} to f/{table[-1]:g}"
            )
            notes.append(_info(camera, "f_number_outside_calibration", problem, beyond))
    return notes


def outside_calibration(
    measured: Measured, estimated: Estimated, method: Method
) -> list[Diagnostic]:
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
