"""The rows of the paper's tables as photographs to be taken again."""

from __future__ import annotations

import csv
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from pipeline.optics.aperture_size import K_TABLE_8, equivalent_object_size_m, interpolate_k

PAPER = Path(__file__).parent / "paper"
# Tables 1 and 2.
FOCAL_LENGTH_MM, PIXEL_PITCH_UM = 50.0, 3.9
SENSOR_WIDTH_PX, SENSOR_HEIGHT_PX = 6000, 4000
EXPOSURE_TIME_S, ISO_SPEED = 1 / 100, 1000.0
# Its printed width contradicts its other columns: no fit may use it.
CONTRADICTORY = "table4/row4"


@dataclass(frozen=True, slots=True)
class Photo:
    """One row of a table: pixels are the sensor's own, None is what the paper does not state."""

    object_id: str
    f_number: float
    width_px: float
    height_px: float
    px_per_cm: float  # of the graduations
    drawn_depth_m: float  # the true depth, else the one that the row's figures come from
    true_depth_m: float | None
    true_height_m: float | None
    erratum: str


def photos() -> list[Photo]:
    """Return the rows of Tables 3-7 and of Tables 9-10, in the order of the paper."""
    return [*depth_rows(), *height_rows()]


def depth_rows() -> Iterator[Photo]:
    """Yield Tables 3-7: width printed, depth true; the staff leaves the picture at both ends."""
    for row in _rows("depth_tables_3_to_7.csv"):
        depth_m = float(row["actual_depth_cm"]) / 100
        yield Photo(
            object_id=f"table{row['paper_table']}/row{row['row']}",
            f_number=float(row["f_number"]),
            width_px=float(row["object_width_px"]),
            height_px=float(SENSOR_HEIGHT_PX),
            # Similar triangles, the image in the focal plane: 1 cm at that depth.
            px_per_cm=FOCAL_LENGTH_MM / (depth_m * 1e3) * 1e4 / PIXEL_PITCH_UM,
            drawn_depth_m=depth_m,
            true_depth_m=depth_m,
            true_height_m=None,
            erratum=row["erratum"],
        )


def height_rows() -> Iterator[Photo]:
    """Yield Tables 9-10: image height printed, height true, width derived from the depth column.

    The width is the one for which Eq. 16 gives the row's depth with the k that the paper used: the
    implied k of Tables 3-7 for their f-numbers, Table 8 for the others, interpolated at f/5.
    """
    used_k = {float(r["f_number"]): float(r["k_implied"]) for r in _rows("depth_tables_3_to_7.csv")}
    for row in _rows("height_tables_9_10.csv"):
        f_number, height_px = float(row["f_number"]), float(row["image_height_px"])
        height_cm = float(row["actual_height_cm"])
        k = used_k.get(f_number, float(interpolate_k(f_number, *K_TABLE_8)))
        depth_m = _depth_behind_height_m(row)
        size_m = float(equivalent_object_size_m(k, FOCAL_LENGTH_MM, f_number))
        number = int(row["row"])
        yield Photo(
            object_id=f"table{9 if number <= 12 else 10}/row{number}",
            f_number=f_number,
            width_px=size_m * FOCAL_LENGTH_MM / depth_m * 1e3 / PIXEL_PITCH_UM,
            height_px=height_px,
            # The crop holds as many centimetres of the staff as the paper says that it does.
            px_per_cm=height_px / height_cm,
            drawn_depth_m=depth_m,
            true_depth_m=None,
            true_height_m=height_cm / 100,
            erratum=row["erratum"],
        )


def _depth_behind_height_m(row: dict[str, str]) -> float:
    """Return the depth column, or Eq. 14 solved for depth where an erratum says to."""
    if not row["erratum"]:
        return float(row["estimated_depth_cm"]) / 100
    size_mm = float(row["image_height_px"]) * PIXEL_PITCH_UM * 1e-3
    return float(row["estimated_height_cm"]) / 100 * FOCAL_LENGTH_MM / size_mm


def _rows(name: str) -> Iterator[dict[str, str]]:
    with (PAPER / name).open(encoding="utf-8", newline="") as lines:
        yield from csv.DictReader(lines)
