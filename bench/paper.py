"""The paper's figures beside ours, on the paper's own rows; docs/paper.md holds what this prints.

python -m bench.paper
"""

from __future__ import annotations

import csv
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt
from scipy.stats import f as f_distribution

from bench.lens_models import MODELS, ONE_SIZE
from pipeline.calibrate.truth.fit import (
    Truth,
    TruthFitter,
    fit_inverse,
    fit_k,
    fit_size,
    predict_held_out,
)
from pipeline.calibrate.truth.regression import k_folds, rmse
from pipeline.core.calibration import Dimension
from pipeline.optics.aperture_size import TABLE_8, depth_eq16_m
from pipeline.optics.object_size import depth_inverse_model_m, height_eq14_m, height_exact_m

Floats = npt.NDArray[np.float64]

PAPER = Path(__file__).parents[1] / "recordings" / "paper"
F_MM, PITCH_MM = 50.0, 3.9e-3
CM = 100.0
SEEDS = range(20)  # of the 5-fold figure


@dataclass(frozen=True, slots=True)
class Rows:
    """Rows of the paper's tables as columns."""

    number: dict[str, Floats]
    consistent: npt.NDArray[np.bool_]  # no erratum

    def __getitem__(self, name: str) -> Floats:
        return self.number[name]


def read(name: str) -> Rows:
    """Read a table of the paper; what is not a number is NaN."""
    with (PAPER / name).open(encoding="utf-8", newline="") as lines:
        rows = list(csv.DictReader(lines))
    number = {key: np.array([_number(r[key]) for r in rows]) for key in rows[0]}
    return Rows(number, np.array([not r.get("erratum") for r in rows]))


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return float("nan")


def depth_rows() -> tuple[Rows, Truth, Floats]:
    """Return Tables 3-7 without row 4 of Table 4, whose width is misprinted: 34 rows.

    And, of these, the depths that the paper printed, in metres.
    """
    rows = read("depth_tables_3_to_7.csv")
    keep = ~((rows["paper_table"] == 4) & (rows["row"] == 4))
    kept = Rows({k: v[keep] for k, v in rows.number.items()}, rows.consistent[keep])
    n = int(keep.sum())
    truth = Truth(
        "nikon_d5300",
        "levelling_staff",
        Dimension.WIDTH,
        kept["object_width_px"] * PITCH_MM,
        kept["f_number"],
        np.full(n, F_MM),
        np.full(n, F_MM),
        kept["actual_depth_cm"] / CM,
        np.arange(n),
    )
    return kept, truth, kept["estimated_depth_cm"] / CM


def reproduction() -> list[str]:
    """Return the table of how well the paper's formulas give the paper's printed figures."""
    rows = read("depth_tables_3_to_7.csv")
    o_mm = rows["object_width_px"] * PITCH_MM
    printed = rows["estimated_depth_cm"]
    lines = [
        "| formula | rows | largest difference |",
        "|---|---|---|",
    ]
    k8 = dict(TABLE_8)
    for label, k in (
        ("Eq. 16, k that the rows imply", rows["k_implied"]),
        ("Eq. 16, k of Table 8", np.array([k8[n] for n in rows["f_number"]])),
    ):
        cm = depth_eq16_m(o_mm, F_MM, rows["f_number"], k) * CM
        off = np.abs(cm - printed)[rows.consistent]
        percent = 100 * np.max(off / printed[rows.consistent])
        lines.append(
            f"| {label} | Tables 3-7, {len(off)} consistent | {off.max():.3f} cm, {percent:.1f} % |"
        )
    heights = read("height_tables_9_10.csv")
    o_mm = heights["image_height_px"] * PITCH_MM
    cm = height_eq14_m(o_mm, heights["estimated_depth_cm"] / CM, F_MM) * CM
    off = np.abs(cm - heights["estimated_height_cm"])[heights.consistent]
    return [*lines, f"| Eq. 14 | Tables 9-10, {len(off)} consistent | {off.max():.2f} cm |"]


def depths() -> list[str]:
    """Return the table of depth errors: the paper's estimates, and ours left out of the fit."""
    _, truth, printed_m = depth_rows()
    lines = [
        "| depth by | fitted | fit RMSE | leave-one-out RMSE | 5-fold RMSE | MAE | r |",
        "|---|---|---|---|---|---|---|",
        _depth_line("the paper's printed estimates", "the paper's k", truth, printed_m, printed_m),
    ]
    eq17_m = depth_inverse_model_m(truth.size_on_sensor_mm)
    lines.append(_depth_line("Eq. 17 as printed", "on f/1.8-f/16", truth, eq17_m, eq17_m))
    fitters: tuple[tuple[str, str, TruthFitter], ...] = (
        ("k by aperture, bounds 0.45-3.2", "5 k", fit_k),
        ("k by aperture, no bounds", "5 k", lambda t, robust: fit_k(t, robust, None)),
        ("Eq. 17, fitted here", "b0, b1", fit_inverse),
        ("Eq. 17, bisquare", "b0, b1", lambda t, robust: fit_inverse(t, True)),
        ("one size, bisquare", "W", lambda t, robust: fit_size(t, True)),
        ("**one size**", "W", fit_size),
    )
    for label, fitted, fitter in fitters:
        lines.append(_fitted_line(label, fitted, truth, fitter))
    return lines


def _fitted_line(label: str, fitted: str, truth: Truth, fitter: TruthFitter) -> str:
    whole = fitter(truth, False)
    out_m = predict_held_out(fitter, truth, False, np.arange(len(truth)))
    folded = [
        rmse(predict_held_out(fitter, truth, False, k_folds(truth.groups, 5, s)) - truth.depth_m)
        for s in SEEDS
    ]
    fold = f"{CM * float(np.mean(folded)):.2f}"
    return _depth_line(label, fitted, truth, whole.depth_m(truth), out_m, fold)


def _depth_line(
    label: str, fitted: str, truth: Truth, fit_m: Floats, out_m: Floats, fold: str = ""
) -> str:
    inside, error = rmse(fit_m - truth.depth_m), out_m - truth.depth_m
    figures = [f"{CM * inside:.2f}"] if fold else [""]
    figures += [f"{CM * rmse(error):.2f}", fold, f"{CM * float(np.abs(error).mean()):.2f}"]
    r = float(np.corrcoef(out_m, truth.depth_m)[0, 1])
    return f"| {label} | {fitted} | {' | '.join(figures)} | {r:.4f} |"


def explanations() -> list[str]:
    """Return the table of what might explain the rest, each left-out against one size.

    The gain is the mean difference of squared errors, in units of its standard error over the rows:
    below -1 a model would be kept, by the rule that a coefficient must earn its place.
    """
    _, truth, _ = depth_rows()
    o_mm, n, d_m = truth.size_on_sensor_mm, truth.f_number, truth.depth_m
    single = np.arange(len(truth), dtype=np.float64)
    lines = [
        "| model | coefficients | leave-one-out | -position-out | -aperture-out | gain / s.e. |",
        "|---|---|---|---|---|---|",
    ]
    base = (ONE_SIZE.held_out(o_mm, n, d_m, single) - d_m) ** 2
    for model in MODELS:
        out_m = model.held_out(o_mm, n, d_m, single)
        by_place = rmse(model.held_out(o_mm, n, d_m, d_m) - d_m)
        by_aperture = rmse(model.held_out(o_mm, n, d_m, n) - d_m)
        b = ", ".join(f"{v:.3g}" for v in model.fit(o_mm, n, d_m))
        lines.append(
            f"| {model.name} | {b} | {CM * rmse(out_m - d_m):.2f} | {CM * by_place:.2f} | "
            f"{CM * by_aperture:.2f} | {_gain((out_m - d_m) ** 2, base)} |"
        )
    return lines


def _gain(squares: Floats, base: Floats) -> str:
    difference = squares - base
    error = float(difference.std(ddof=1)) / np.sqrt(len(difference))
    return f"{difference.mean() / error:+.1f}" if error > 0 else ""


def spread() -> list[str]:
    """Return the analysis of variance of log(d o) by position and by aperture (two ways)."""
    _, truth, _ = depth_rows()
    y = np.log(truth.depth_m * truth.size_on_sensor_mm)
    place = (truth.depth_m[:, None] == np.unique(truth.depth_m)[1:]).astype(float)
    stop = (truth.f_number[:, None] == np.unique(truth.f_number)[1:]).astype(float)
    one = np.ones((len(y), 1))

    def left(*columns: Floats) -> float:
        x = np.hstack([one, *columns])
        residual = y - x @ np.linalg.lstsq(x, y, rcond=None)[0]
        return float(residual @ residual)

    both = left(place, stop)
    freedom = len(y) - 1 - place.shape[1] - stop.shape[1]
    lines = ["| spread of the size by | F | df | p |", "|---|---|---|---|"]
    for label, columns, without in (("position", place, stop), ("aperture", stop, place)):
        df = columns.shape[1]
        ratio = (left(without) - both) / df / (both / freedom)
        p = float(f_distribution.sf(ratio, df, freedom))
        lines.append(f"| {label} | {ratio:.2f} | {df}, {freedom} | {p:.3f} |")
    total = 100 * float(np.std(y, ddof=1))
    rest = 100 * float(np.sqrt(both / freedom))
    return [*lines, f"| (all: {total:.1f} %; neither: {rest:.1f} %) | | | |"]


def heights() -> list[str]:
    """Return the table of height errors on the consistent rows of Tables 9-10."""
    rows = read("height_tables_9_10.csv")
    o_mm, d_m, true_m, paper_m = (
        rows[name][rows.consistent] * scale
        for name, scale in (
            ("image_height_px", PITCH_MM),
            ("estimated_depth_cm", 1 / CM),
            ("actual_height_cm", 1 / CM),
            ("estimated_height_cm", 1 / CM),
        )
    )
    _, truth, printed_m = depth_rows()
    # How far the paper's depths are off, from Tables 3-7 alone: no height is used.
    weights = truth.depth_m**-2.0
    factor = float((weights * printed_m * truth.depth_m).sum() / (weights * printed_m**2).sum())
    exact_m = height_exact_m(o_mm, d_m, F_MM)
    lines = ["| height by | fitted on | RMSE | mean error | bias |", "|---|---|---|---|---|"]
    for label, source, found_m in (
        ("the paper's printed estimates", "", paper_m),
        ("Eq. 14, m = f / d", "", height_eq14_m(o_mm, d_m, F_MM)),
        ("**exact magnification, m = f / (d - f)**", "", exact_m),
        (
            f"exact, depths times {factor:.3f}",
            "depths of Tables 3-7",
            height_exact_m(o_mm, d_m * factor, F_MM),
        ),
        ("exact, depths less a constant", "other heights", _without_offset(o_mm, d_m, true_m)),
        ("exact, times a constant", "other heights", _scaled(exact_m, true_m)),
    ):
        error = found_m - true_m
        mape = 100 * float(np.mean(np.abs(error) / true_m))
        lines.append(
            f"| {label} | {source} | {CM * rmse(error):.2f} | {mape:.1f} % | "
            f"{CM * float(error.mean()):+.2f} |"
        )
    return lines


def _without_offset(o_mm: Floats, d_m: Floats, true_m: Floats) -> Floats:
    """Return o (d - f - c) / f, with c of a row fitted on the other rows."""
    per_m = o_mm / F_MM
    gap_m = height_exact_m(o_mm, d_m, F_MM) - true_m
    c_m = ((per_m * gap_m).sum() - per_m * gap_m) / ((per_m**2).sum() - per_m**2)
    return np.asarray(height_exact_m(o_mm, d_m - c_m, F_MM))


def _scaled(found_m: Floats, true_m: Floats) -> Floats:
    """Return heights times a constant, that of a row fitted on the other rows."""
    cross, square = found_m * true_m, found_m**2
    return np.asarray(found_m * (cross.sum() - cross) / (square.sum() - square))


SECTIONS = {
    "The paper's formulas give the paper's figures": reproduction,
    "Depth on 34 rows of Tables 3-7 (cm)": depths,
    "What might explain the rest (cm)": explanations,
    "Where the rest lies": spread,
    "Height on 17 rows of Tables 9-10 (cm)": heights,
}


def main() -> None:
    """Print all tables."""
    for title, make in SECTIONS.items():
        print(f"## {title}\n", *make(), "", sep="\n")


if __name__ == "__main__":
    main()
