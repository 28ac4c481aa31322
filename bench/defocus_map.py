"""A map of the depths at which defocus is more precise than a size prior, and at which it is useless.

    python -m bench.defocus_map -o docs/defocus.png

The deviations are those that `pipeline/estimate/methods/defocus.py` states, by its own constants, for
an object whose blur is measured to 1.2 %, the median of `python -m bench.defocus`; the floor is not
calibrated.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import altair as alt
import numpy as np
import pandas as pd

from pipeline.cli.console import out, print_rows
from pipeline.core.arrays import FloatArray
from pipeline.core.config import ADULT
from pipeline.estimate.methods.defocus import FOCUS_STD, FOCUS_ZERO_STD_PER_M, LENS_STD, RESOLVED
from pipeline.measure.blur.expected import FLOOR_PX, FLOOR_STD_PX
from pipeline.optics.defocus import diffraction_sigma_um, radius_per_dioptre_um

BLUR_STD = 0.012
STATURE_STD = ADULT.std_m / ADULT.mean_m
# Name, focal length in mm, f-number, pixel pitch in um.
LENSES = (
    ("50 mm f/1.8, 3.9 µm", 50.0, 1.8, 3.9),
    ("50 mm f/8, 3.9 µm", 50.0, 8.0, 3.9),
    ("25 mm f/1.4, 3.45 µm", 25.0, 1.4, 3.45),
    ("telephone 6 mm f/1.8, 1.4 µm", 6.0, 1.8, 1.4),
    ("surveillance 4 mm f/2, 2.9 µm", 4.0, 2.0, 2.9),
)
DEPTHS_M = np.geomspace(0.3, 100.0, 800)
FOCAL_LENGTHS_MM = np.geomspace(3.0, 200.0, 120)


def relative_std(
    depth_m: FloatArray, focal_mm: float, f_number: float, pitch_um: float, focus_m: float
) -> FloatArray:
    """Return the deviation of depth over depth; NaN where the blur is not resolved."""
    per_dioptre = float(radius_per_dioptre_um(focal_mm, f_number, focus_m)) / (2 * pitch_um)
    u = np.abs(1 / depth_m - 1 / focus_m)
    diffraction = (float(diffraction_sigma_um(f_number)) / pitch_um) ** 2
    excess = (per_dioptre * u) ** 2
    variance = excess + FLOOR_PX**2 + diffraction
    noise = 2 * BLUR_STD * variance
    floor = np.hypot(2 * FLOOR_PX * FLOOR_STD_PX, diffraction / 2)
    unsure = np.hypot(noise, floor)
    with np.errstate(divide="ignore", invalid="ignore"):
        of_u = np.hypot(unsure / (2 * excess) * u, u * LENS_STD)
    of_focus = np.hypot(FOCUS_STD / focus_m, FOCUS_ZERO_STD_PER_M)
    return np.where(excess > RESOLVED * unsure, depth_m * np.hypot(of_u, of_focus), np.nan)


def surer_m(focal_mm: float, f_number: float, pitch_um: float, focus_m: float) -> tuple[float, ...]:
    """Return the nearest and farthest depth at which defocus is surer than an adult's stature."""
    std = relative_std(DEPTHS_M, focal_mm, f_number, pitch_um, focus_m)
    better = DEPTHS_M[std < STATURE_STD]
    return (float(better.min()), float(better.max())) if len(better) else (np.nan, np.nan)


def figure() -> alt.HConcatChart:
    """Return the figure."""
    curves = alt.hconcat(_curves(np.inf, "focused at infinity"), _curves(2.0, "focused at 2 m"))
    both = alt.hconcat(curves, _reach()).resolve_scale(
        color="independent", strokeDash="independent"
    )
    return both.configure_axis(gridColor="#eee").configure_legend(
        orient="bottom", columns=2, labelLimit=220
    )


def _curves(focus_m: float, title: str) -> alt.LayerChart:
    rows = []
    for name, focal_mm, f_number, pitch_um in LENSES:
        std = relative_std(DEPTHS_M, focal_mm, f_number, pitch_um, focus_m)
        rows.append(pd.DataFrame({"lens": name, "depth": DEPTHS_M, "std": 100 * std}))
    frame = pd.concat(rows)
    frame["std"] = frame["std"].where(frame["std"] < 100)
    lines = (
        alt.Chart(frame)
        .mark_line(strokeWidth=2)
        .encode(
            x=alt.X(
                "depth:Q",
                scale=alt.Scale(type="log", domain=[0.3, 100], nice=False),
                title="depth, m",
            ),
            y=alt.Y(
                "std:Q",
                scale=alt.Scale(type="log", domain=[0.5, 100], nice=False),
                title="standard deviation of depth, %",
            ),
            color=alt.Color(
                "lens:N",
                sort=[lens[0] for lens in LENSES],
                title="defocus",
            ),
        )
    )
    rule = (
        alt.Chart(pd.DataFrame({"y": [100 * STATURE_STD]}))
        .mark_rule(strokeDash=[6, 4], color="black")
        .encode(y="y:Q")
    )
    text = (
        alt.Chart(
            pd.DataFrame({"x": [100.0], "y": [100 * STATURE_STD], "t": ["stature of adults"]})
        )
        .mark_text(align="right", dy=-7)
        .encode(x="x:Q", y="y:Q", text="t:N")
    )
    return alt.layer(lines, rule, text).properties(width=300, height=260, title=title)


def _reach() -> alt.Chart:
    rows = [
        {
            "focal": float(f),
            "depth": surer_m(float(f), f_number, pitch_um, np.inf)[1],
            "aperture": f"f/{f_number:g}",
            "pitch": f"{pitch_um:g} µm",
        }
        for f in FOCAL_LENGTHS_MM
        for f_number in (1.4, 2.8, 5.6)
        for pitch_um in (2.0, 4.0, 8.0)
    ]
    frame = pd.DataFrame(rows)
    frame = frame[frame["depth"] < 0.99 * DEPTHS_M.max()]
    return (
        alt.Chart(frame)
        .mark_line(strokeWidth=2)
        .encode(
            x=alt.X(
                "focal:Q",
                scale=alt.Scale(type="log", domain=[3, 200], nice=False),
                title="focal length, mm",
            ),
            y=alt.Y(
                "depth:Q",
                scale=alt.Scale(type="log", domain=[0.3, 30], nice=False),
                title="depth, m",
            ),
            color=alt.Color("aperture:N", title="aperture"),
            strokeDash=alt.StrokeDash("pitch:N", title="pixel pitch"),
        )
        .properties(
            width=300,
            height=260,
            title="defocus is surer than stature up to (focused at infinity)",
        )
    )


def main() -> None:
    """Write the figure, and print where each lens is surer."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("-o", "--output", type=Path)
    output = parser.parse_known_args()[0].output
    table = []
    for name, *lens in LENSES:
        for focus_m in (np.inf, 2.0):
            low, high = surer_m(*lens, focus_m)
            at = [float(relative_std(np.array([d]), *lens, focus_m)[0]) for d in (1.0, 5.0, 20.0)]
            table.append(
                [
                    name,
                    "infinity" if np.isinf(focus_m) else f"{focus_m:g} m",
                    f"{low:.1f}-{high:.1f} m" if np.isfinite(low) else "nowhere",
                    *("none" if np.isnan(v) else f"{100 * v:.1f}" for v in at),
                ]
            )
    header = ("lens", "focus", "surer than stature", "% at 1 m", "at 5 m", "at 20 m")
    print_rows("standard deviation of depth by defocus", header, table)
    if output:
        figure().save(output, scale_factor=1.3)
        out.print(f"figure    {output}")


if __name__ == "__main__":
    main()
