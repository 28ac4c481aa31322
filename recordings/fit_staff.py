"""The figures of `cameras.toml` that the paper does not print, computed from its Tables 3-7.

    python -m recordings.fit_staff

Table 4 row 4 is left out: its width contradicts its other columns.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from pipeline.optics.aperture_size import K_TABLE_8, depth_eq16_m, interpolate_k
from recordings.staff_table import CONTRADICTORY, FOCAL_LENGTH_MM, PIXEL_PITCH_UM, depth_rows

Floats = npt.NDArray[np.float64]

# Eq. 17, in metres and millimetres: 1.221 cm and 24.910 cm^2.
B0_M, B1_M_MM = 0.01221, 2.4910


def consistent_rows() -> tuple[Floats, Floats, Floats]:
    """Return size on the sensor in mm, f-number and true depth in m, (34,) each."""
    rows = [p for p in depth_rows() if p.object_id != CONTRADICTORY]
    size_mm = np.array([p.width_px for p in rows]) * PIXEL_PITCH_UM * 1e-3
    depth_m = np.array([p.drawn_depth_m for p in rows])
    return size_mm, np.array([p.f_number for p in rows]), depth_m


def figures() -> dict[str, float]:
    """Return residuals of Table 8 and of Eq. 17, and the least-squares width of the staff."""
    size_mm, f_number, depth_m = consistent_rows()
    by_table_8_m = depth_eq16_m(
        size_mm, FOCAL_LENGTH_MM, f_number, interpolate_k(f_number, *K_TABLE_8)
    )
    by_eq17_m = B0_M + B1_M_MM / size_mm
    return {
        "observation_count": len(depth_m),
        "aperture.rmse_m": _rmse(by_table_8_m - depth_m),
        "inverse.rmse_m": _rmse(by_eq17_m - depth_m),
        **{f"size.{name}": value for name, value in _size(size_mm, depth_m).items()},
    }


def _size(size_mm: Floats, depth_m: Floats) -> dict[str, float]:
    """Fit depth = W x with x = f / o: one constant for all apertures, each row weighing the same."""
    x = FOCAL_LENGTH_MM / size_mm
    width_m = _slope(x, depth_m)
    residual_m = width_m * x - depth_m
    spread_m = float(np.sqrt(residual_m @ residual_m / (len(x) - 1)))
    others = ~np.eye(len(x), dtype=bool)
    left_out_m = np.array([_slope(x[o], depth_m[o]) for o in others]) * x
    return {
        "object_size_m": width_m,
        "std_error": spread_m / float(np.sqrt(x @ x)),
        "residual_std_m": spread_m,
        "fit_rmse_m": _rmse(residual_m),
        "loo_rmse_m": _rmse(left_out_m - depth_m),
        "loo_mae_m": float(np.abs(left_out_m - depth_m).mean()),
        "loo_r": float(np.corrcoef(left_out_m, depth_m)[0, 1]),
    }


def _slope(x: Floats, y: Floats) -> float:
    return float(x @ y / (x @ x))


def _rmse(error_m: Floats) -> float:
    return float(np.sqrt(np.mean(error_m**2)))


if __name__ == "__main__":
    for name, value in figures().items():
        print(f"{name:24s} {value:.6g}")
