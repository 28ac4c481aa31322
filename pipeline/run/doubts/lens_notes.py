"""Diagnostics of lenses whose distortion has no meaning in a part of the picture."""

from __future__ import annotations

import numpy as np

from pipeline.core.records import Diagnostic, Intrinsics, Severity
from pipeline.optics.distortion import undistort

# Fits to the middle of the picture fold over in its very corners; beyond this share they are no fits.
MOST_SHARE = 0.05
GRID = 40


def lens_notes(camera: str, lens: Intrinsics | None) -> list[Diagnostic]:
    """Return a note if a part of the picture has no directions, as the distortion folds over there.

    Args:
        camera: its name.
        lens: as it is used; None if unknown.
    """
    if lens is None or not any(lens.distortion) or min(lens.width_px, lens.height_px) < 1:
        return []
    share = share_without_directions(lens)
    if share <= MOST_SHARE:
        return []
    return [
        Diagnostic(
            Severity.WARNING,
            "doubtful_lens",
            f"{share:.0%} of the picture has no directions by the distortion "
            f"{lens.distortion_model!r} {tuple(round(c, 4) for c in lens.distortion)}: the polynomial "
            "folds over there, and what is seen there gets no numbers. Check the order of the "
            "coefficients and the model, or give distortion in a camera file (none if the pictures "
            "are rectified)",
            camera=camera,
        )
    ]


def share_without_directions(lens: Intrinsics) -> float:
    """Return the share of a picture, 0 to 1, whose pixels no direction is mapped to."""
    x_px, y_px = np.meshgrid(
        np.linspace(0, lens.width_px - 1, GRID), np.linspace(0, lens.height_px - 1, GRID)
    )
    bent = np.stack([(x_px - lens.cx_px) / lens.fx_px, (y_px - lens.cy_px) / lens.fy_px], axis=-1)
    found = undistort(bent.reshape(-1, 2), lens.distortion_model, lens.distortion)
    return float(np.mean(~np.isfinite(found).all(axis=-1)))
