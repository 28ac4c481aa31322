"""Decimals of measured numbers that are kept.

A double that ends after a few decimals is packed as a small whole number (DuckDB's ALP): 2.3 bytes
instead of 7, and fewer than a 32-bit float takes, which has digits that mean nothing too. What is cut off
is a hundredth, or less, of the smallest error that the number itself can have:

    lengths in the scene        0.1 mm     a box that ends 0.1 px off at 2 m is 0.2 mm
    their deviations            0.01 mm    two digits of the smallest that there is
    sides of boxes              0.001 px   ends are found to 0.05 px at best
    their deviations, blur      0.0001 px
    shares, scores, luminance   0.00001    an 8-bit picture's darkest step is 0.0003 of linear light

Only columns that come once an observation or once an estimate are cut; truth, calibrations and frames
are kept as they came. A column that is not named here is kept whole.
"""

from __future__ import annotations

DECIMALS: dict[str, dict[str, int]] = {
    "observations": {
        **dict.fromkeys(("x_min_px", "y_min_px", "x_max_px", "y_max_px"), 3),
        **dict.fromkeys(("raw_x_min_px", "raw_y_min_px", "raw_x_max_px", "raw_y_max_px"), 3),
        **dict.fromkeys(("x_min_std_px", "y_min_std_px", "x_max_std_px", "y_max_std_px"), 4),
        **dict.fromkeys(("blur_sigma_px", "blur_std_px"), 4),
        **dict.fromkeys(("score", "occlusion", "luminance"), 5),
    },
    "observation_quality": {"quality": 5, "stride_phase_rad": 4},
    "track_cadences": {"cadence_hz": 4, "cadence_std_hz": 5, "speed_m_s": 4},
    "estimates": {
        **dict.fromkeys(("depth_m", "height_m", "range_m", "x_m", "y_m"), 4),
        **dict.fromkeys(("depth_std_m", "height_std_m"), 5),
    },
}


def kept(table: str, column: str, value: str) -> str:
    """Return SQL for a value as it is stored in a column of a table."""
    decimals = DECIMALS.get(table, {}).get(column)
    return value if decimals is None else f"round({value}, {decimals})"
