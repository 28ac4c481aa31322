"""What a user should know of the estimates that were not made, or lie outside a calibration."""

from __future__ import annotations

import numpy as np

from pipeline.config import Config
from pipeline.estimate.columns import Estimated, Measured
from pipeline.estimate.common import calibrations_for
from pipeline.records import Diagnostic, Method, Severity


def not_applicable(measured: Measured, config: Config) -> list[Diagnostic]:
    """Say, once a class of a camera, why a method does not apply to it."""
    by_aperture = calibrations_for(config, Method.APERTURE, measured.camera)
    calibrated = {c.object_class: c for c in by_aperture}
    sized = {p.object_class for p in config.size_prior} | {
        c.object_class for c in config.calibration if c.camera in ("", measured.camera)
    }
    notes = []
    for name in sorted(set(measured.class_name)):
        rows = measured.class_name == name
        count = int(rows.sum())
        n = measured.f_number[rows]
        if name not in sized:
            problem = f"the size of {name!r} is not known: no depth from its size"
            notes.append(_info(measured, "size_unknown", problem, count))
        if name not in calibrated:
            problem = (
                f"`aperture` does not apply to {name!r}: k holds for the camera and objects on "
                "which it was calibrated, and there is no calibration for these"
            )
            notes.append(_info(measured, "method_not_applicable", problem, count))
        elif not np.isfinite(n).any():
            problem = f"`aperture` does not apply to {name!r}: the f-number is not known"
            notes.append(_info(measured, "method_not_applicable", problem, count))
        else:
            table = calibrated[name].by_f_number("k")[0]
            beyond = int(((n < table[0]) | (n > table[-1])).sum()) if len(table) else 0
            if beyond and not config.estimate.extrapolate:
                problem = (
                    f"`aperture` was refused for {name!r} at f-numbers outside the calibrated "
                    f"f/{table[0]:g} to f/{table[-1]:g}"
                )
                notes.append(_info(measured, "f_number_outside_calibration", problem, beyond))
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
    return [_info(measured, "outside_calibrated_range", problem, count)]


def _info(measured: Measured, code: str, problem: str, count: int) -> Diagnostic:
    return Diagnostic(Severity.INFO, code, problem, camera=measured.camera, count=count)
