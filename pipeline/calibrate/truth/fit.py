"""Calibrations from observations whose true depth is known: k by aperture, one size, Eq. 17.

All three are linear in what they fit, with o the size on the sensor and v the image distance:

    aperture   depth = k (10 a_R v / o)      one k an f-number, within bounds (section 4.1.1)
    size       depth = W (v / o)             one equivalent object size for all apertures
    inverse    depth = b0 + b1 (1 / o)       Eq. 17

The error of the first two is taken to grow in proportion to depth, as that of a size in pixels and
of the object's own size does; the third is ordinary least squares, as in the paper's Tables 11-13.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import pyarrow as pa

from pipeline.calibrate.truth.regression import (
    Fit,
    fit_linear,
    held_out,
    k_folds,
    leave_one_out,
    rmse,
)
from pipeline.core.arrays import FloatArray, IntArray
from pipeline.core.calibration import CalibratedMethod, Calibration, Dimension, Parameter
from pipeline.core.config import SizePrior
from pipeline.core.errors import CalibrationUndetermined
from pipeline.optics.aperture_size import K_BOUNDS, equivalent_object_size_m
from pipeline.optics.thin_lens import image_distance_mm

BoolArray = npt.NDArray[np.bool_]

METHODS = tuple(CalibratedMethod)
FOLDS = 5
# Fewer rows give a fit, but no honest spread about it.
MIN_ROWS = 4


@dataclass(frozen=True, slots=True)
class Truth:
    """Observations of one class by one camera with their true depth: arrays of length n."""

    camera: str
    object_class: str
    dimension: Dimension
    size_on_sensor_mm: FloatArray
    f_number: FloatArray
    focal_length_mm: FloatArray
    image_distance_mm: FloatArray
    depth_m: FloatArray
    groups: IntArray  # equal for rows of the same object in the same recording

    def __len__(self) -> int:
        return len(self.depth_m)

    def take(self, rows: BoolArray) -> Truth:
        """Return the rows of a mask."""
        arrays = {
            name: getattr(self, name)[rows]
            for name in (
                "size_on_sensor_mm",
                "f_number",
                "focal_length_mm",
                "image_distance_mm",
                "depth_m",
                "groups",
            )
        }
        return Truth(self.camera, self.object_class, self.dimension, **arrays)


def calibrate_from_truth(
    table: pa.Table,
    methods: Sequence[CalibratedMethod] = METHODS,
    *,
    robust: bool = False,
    folds: int = FOLDS,
    seed: int = 0,
    k_bounds: tuple[float, float] | None = K_BOUNDS,
    dimension: Dimension | None = None,
) -> list[Calibration]:
    """Return a calibration of each method for every camera and class that has enough truth.

    Args:
        table: columns camera, class_name, f_number, focal_length_mm, focus_distance_m,
            width_on_sensor_mm, height_on_sensor_mm, true_depth_m, recording_id and object_id (or
            track_id); null or NaN is unknown.
        methods: of `METHODS`.
        robust: bisquare fits.
        folds: of the k-fold figure; the objects of a recording stay together.
        seed: of the folds.
        k_bounds: within which k is sought; None for no bounds.
        dimension: which side of the box to use; None takes, for each class, the side that predicts
            left-out depths better.

    Raises:
        CalibrationUndetermined: no class of any camera has enough observations with a true depth.
    """
    calibrations = []
    for candidates in _by_class(table, dimension):
        usable = [t for t in candidates if len(t) >= MIN_ROWS]
        if not usable:
            continue
        truth = usable[0]
        if len(usable) > 1:
            errors = [np.nan_to_num(_loo_rmse(fit_size, t, robust), nan=np.inf) for t in usable]
            truth = usable[int(np.argmin(errors))]
        for method in methods:
            calibration = _calibrate(truth, method, robust, folds, seed, k_bounds)
            if calibration is not None:
                calibrations.append(calibration)
    if not calibrations:
        raise CalibrationUndetermined(
            f"no class of objects has {MIN_ROWS} observations with a true depth and a size on the "
            "sensor",
            remedy="Calibration needs ground truth, and pixel pitch and focal length of the camera",
        )
    return calibrations


def size_priors_from_truth(table: pa.Table, source: str = "truth") -> list[SizePrior]:
    """Return the mean and spread of the true sizes of each class with enough objects.

    Args:
        table: columns class_name, true_height_m, true_width_m, recording_id and object_id.
        source: what the prior is from, for its record.
    """
    names = _text(table, "class_name")
    groups = _groups(table)
    priors = []
    for name in sorted(set(names)):
        for dimension in Dimension:
            size_m = _number(table, f"true_{dimension}_m")
            rows = (names == name) & (size_m > 0)
            objects = [float(np.median(size_m[rows & (groups == g)])) for g in set(groups[rows])]
            if len(objects) < MIN_ROWS:
                continue
            mean_m, std_m = float(np.mean(objects)), float(np.std(objects, ddof=1))
            if std_m > 0:
                text = f"{source}: {len(objects)} objects"
                priors.append(SizePrior(name, dimension, mean_m, std_m, text, len(objects)))
    return priors


def prior_as_calibration(prior: SizePrior) -> Calibration:
    """Return a prior for the table `calibrations`, with the standard errors of a normal sample."""
    n = prior.object_count
    return Calibration(
        CalibratedMethod.SIZE,
        prior.object_class,
        prior.dimension,
        (
            Parameter("prior_mean_m", prior.mean_m, prior.std_m / np.sqrt(n)),
            Parameter("prior_std_m", prior.std_m, prior.std_m / np.sqrt(2 * (n - 1))),
        ),
        observation_count=n,
        source=prior.source,
    )


def says_nothing(calibration: Calibration, table: pa.Table) -> bool:
    """Return whether a calibration predicts left-out depths no better than their mean does.

    Args:
        calibration: as it was fitted to `table`.
        table: as `calibrate_from_truth` takes it.
    """
    depth_m = _number(table, "true_depth_m")
    rows = (_text(table, "camera") == calibration.camera) & (
        _text(table, "class_name") == calibration.object_class
    )
    spread_m = float(np.std(depth_m[rows & (depth_m > 0)]))
    return calibration.loo_rmse_m >= spread_m > 0


@dataclass(frozen=True, slots=True)
class DepthFit:
    """A fit that gives depths: parameters, and a function from rows to depths."""

    parameters: tuple[Parameter, ...]
    fit: Fit
    relative: bool  # the spread is in proportion to depth
    truth: Truth
    note: str = ""

    def depth_m(self, truth: Truth) -> FloatArray:
        """Return the depths that the fit gives for other rows."""
        values = {(p.name, p.f_number): p.value for p in self.parameters if p.f_number > 0}
        by_name = {p.name: p.value for p in self.parameters}
        with np.errstate(invalid="ignore", divide="ignore"):
            scale = truth.image_distance_mm / truth.size_on_sensor_mm
            if "object_size_m" in by_name:
                return np.asarray(by_name["object_size_m"] * scale)
            if "b0_m" in by_name:
                return np.asarray(by_name["b0_m"] + by_name["b1_m_mm"] / truth.size_on_sensor_mm)
            k = np.array([values.get(("k", n), np.nan) for n in truth.f_number])
            size_m = equivalent_object_size_m(k, truth.focal_length_mm, truth.f_number)
            return np.asarray(size_m * scale)


TruthFitter = Callable[[Truth, bool], DepthFit]


def fit_size(truth: Truth, robust: bool = False) -> DepthFit:
    """Fit one equivalent object size W for all apertures."""
    x = (truth.image_distance_mm / truth.size_on_sensor_mm)[:, None]
    fit = _proportional(x, truth, robust)
    size = Parameter("object_size_m", float(fit.coefficients[0]), float(fit.std_errors[0]))
    return DepthFit((size,), fit, True, truth)


def fit_k(
    truth: Truth, robust: bool = False, k_bounds: tuple[float, float] | None = K_BOUNDS
) -> DepthFit:
    """Fit k of every f-number, all with the same spread; a bound that is reached is noted.

    The apertures share no coefficient, so the best k within the bounds is the best k, clipped.
    """
    n = np.unique(truth.f_number)
    per_k_m = equivalent_object_size_m(1.0, truth.focal_length_mm, truth.f_number)
    x = per_k_m * truth.image_distance_mm / truth.size_on_sensor_mm
    fit = _proportional(x[:, None] * (truth.f_number[:, None] == n), truth, robust)
    k = fit.coefficients if k_bounds is None else np.clip(fit.coefficients, *k_bounds)
    parameters = tuple(
        Parameter("k", float(value), float(std), float(f))
        for value, std, f in zip(k, fit.std_errors, n, strict=True)
    )
    clipped = [
        f"f/{f:g} (free: {free:.4g})"
        for f, free, value in zip(n, fit.coefficients, k, strict=True)
        if free != value
    ]
    note = f"k at its bound at {', '.join(clipped)}" if clipped else ""
    return DepthFit(parameters, fit, True, truth, note)


def fit_inverse(truth: Truth, robust: bool = False) -> DepthFit:
    """Fit Eq. 17 by ordinary least squares."""
    x = np.stack([np.ones(len(truth)), 1.0 / truth.size_on_sensor_mm], axis=1)
    fit = fit_linear(x, truth.depth_m, robust=robust, groups=truth.groups)
    b, std, cov = fit.coefficients, fit.std_errors, fit.covariance
    correlation = float(cov[0, 1] / (std[0] * std[1])) if std.min() > 0 else 0.0
    parameters = (
        Parameter("b0_m", float(b[0]), float(std[0])),
        Parameter("b1_m_mm", float(b[1]), float(std[1])),
        Parameter("b0_b1_correlation", correlation),
    )
    return DepthFit(parameters, fit, False, truth)


def _proportional(x: FloatArray, truth: Truth, robust: bool) -> Fit:
    weights = truth.depth_m**-2.0
    return fit_linear(x, truth.depth_m, weights, robust=robust, groups=truth.groups)


def _calibrate(
    truth: Truth,
    method: CalibratedMethod,
    robust: bool,
    folds: int,
    seed: int,
    k_bounds: tuple[float, float] | None,
) -> Calibration | None:
    """Return the calibration with its figures in and out of sample; None if not determined."""

    def fitter(t: Truth, robust: bool) -> DepthFit:
        if method is CalibratedMethod.APERTURE:
            return fit_k(t, robust, k_bounds)
        return fit_size(t, robust) if method is CalibratedMethod.SIZE else fit_inverse(t, robust)

    if method is CalibratedMethod.APERTURE:
        truth = truth.take(np.isfinite(truth.f_number))
    if len(truth) < MIN_ROWS:
        return None
    try:
        fitted = fitter(truth, robust)
    except ValueError:
        return None
    residual_m = truth.depth_m - fitted.depth_m(truth)
    parameters = fitted.parameters
    # What comes will have outliers too: the spread is that of all rows, also of a robust fit.
    widen = float(np.sqrt(len(truth) / fitted.fit.freedom)) if fitted.fit.freedom else np.nan
    spread_m = rmse(residual_m) * widen
    if fitted.relative:
        relative = rmse(residual_m / truth.depth_m) * widen
        parameters = (*parameters, Parameter("residual_relative", relative))
    sampled = len(np.unique(truth.groups))
    text = f"truth: {len(truth)} observations of {sampled} objects"
    return Calibration(
        method=method,
        object_class=truth.object_class,
        dimension=truth.dimension,
        parameters=tuple(p for p in parameters if np.isfinite(p.value)),
        camera=truth.camera,
        residual_std_m=spread_m,
        observation_count=len(truth),
        depth_min_m=float(truth.depth_m.min()),
        depth_max_m=float(truth.depth_m.max()),
        fit_rmse_m=rmse(residual_m),
        loo_rmse_m=_loo_rmse(fitter, truth, robust),
        kfold_rmse_m=_held_out_rmse(fitter, truth, robust, k_folds(truth.groups, folds, seed)),
        source="; ".join(s for s in (text, "bisquare" if robust else "", fitted.note) if s),
    )


def _loo_rmse(fitter: TruthFitter, truth: Truth, robust: bool) -> float:
    return _held_out_rmse(fitter, truth, robust, leave_one_out(truth.groups))


def _held_out_rmse(fitter: TruthFitter, truth: Truth, robust: bool, folds: IntArray) -> float:
    return rmse(predict_held_out(fitter, truth, robust, folds) - truth.depth_m)


def predict_held_out(
    fitter: TruthFitter, truth: Truth, robust: bool, folds: IntArray
) -> FloatArray:
    """Return the depth of every row by a fit to the other folds, (n,); NaN if undetermined."""

    def fit(rows: BoolArray) -> Callable[[BoolArray], FloatArray]:
        fitted = fitter(truth.take(rows), robust)
        return lambda left: fitted.depth_m(truth.take(left))

    return held_out(fit, folds)


def _by_class(table: pa.Table, dimension: Dimension | None) -> list[list[Truth]]:
    """Return, for each camera and class, its rows by each side of the box."""
    cameras, names, groups = _text(table, "camera"), _text(table, "class_name"), _groups(table)
    depth_m, focal_length_mm = _number(table, "true_depth_m"), _number(table, "focal_length_mm")
    v_mm = image_distance_mm(_number(table, "focus_distance_m"), focal_length_mm)
    result = []
    for camera, name in sorted(set(zip(cameras, names, strict=True))):
        sides = []
        for side in Dimension if dimension is None else (dimension,):
            o_mm = _number(table, f"{side}_on_sensor_mm")
            rows = (cameras == camera) & (names == name) & (depth_m > 0) & (o_mm > 0) & (v_mm > 0)
            truth = Truth(
                camera,
                name,
                side,
                o_mm,
                _number(table, "f_number"),
                focal_length_mm,
                v_mm,
                depth_m,
                groups,
            )
            sides.append(truth.take(rows))
        result.append(sides)
    return result


def _number(table: pa.Table, name: str) -> FloatArray:
    """Return a column as numbers; NaN where it is null, or if there is none."""
    if name not in table.column_names:
        return np.full(table.num_rows, np.nan)
    return np.asarray(table[name].to_numpy(), dtype=np.float64)


def _text(table: pa.Table, name: str) -> npt.NDArray[np.object_]:
    return np.array(table[name].to_pylist(), dtype=np.object_)


def _groups(table: pa.Table) -> IntArray:
    """Number the objects of each recording; a row without an object is one of its own."""
    key = "object_id" if "object_id" in table.column_names else "track_id"
    columns = [_text(table, n) for n in ("recording_id", "camera", key) if n in table.column_names]
    numbers: dict[tuple[object, ...], int] = {}
    rows = [
        (*parts, i if parts[-1] is None else None)
        for i, parts in enumerate(zip(*columns, strict=True))
    ]
    return np.array([numbers.setdefault(row, len(numbers)) for row in rows], dtype=np.int64)
