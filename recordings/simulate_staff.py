"""The recording `staff`: the paper's experiment, photographed again from its tables.

    python -m recordings.simulate_staff -o recordings/staff.mcap

A graduated levelling staff stands before a 50 mm lens on a 6000 x 4000 sensor of 3.9 um: the 35 rows
of Tables 3-7 (50-110 cm, f/1.8-f/4) and the 22 rows of Tables 9-10 (the part of the staff that the
picture holds is the true height). The pictures are stored at a fifth of the size, with the scale in
the calibration. The same bytes come out every time.

What the paper prints goes in as recorded detections: the width of its crop, and in Tables 9-10 the
height. What it does not print is derived, and said so:
- the width in Tables 9-10, from the depth column by Eq. 16 with the k that the paper used (where an
  erratum says that the height came from another depth, from that one);
- the height in Tables 3-7 (the staff fills the picture) is that of the picture.
The truth holds only what the paper states: the depth in Tables 3-7, the height in Tables 9-10.
"""

from __future__ import annotations

import argparse
import csv
import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt

from pipeline.ingest.mcap_writer import (
    RecordingWriter,
    calibration_message,
    image_message,
    timestamp,
)
from pipeline.optics.aperture_size import K_TABLE_8, equivalent_object_size_m, interpolate_k
from pipeline.optics.exposure import linear_to_srgb
from pipeline.records import Intrinsics
from schemas.stadimeter_pb2 import CameraExposure, Detections, GroundTruth

PAPER = Path(__file__).parent / "paper"
CAMERA = "nikon_d5300"
CLASS = "levelling_staff"
FOCAL_LENGTH_MM, PIXEL_PITCH_UM = 50.0, 3.9
SENSOR_PX = (6000, 4000)
SCALE = 0.2
PICTURE_PX = (round(SENSOR_PX[0] * SCALE), round(SENSOR_PX[1] * SCALE))
EXPOSURE_TIME_S, ISO_SPEED = 1 / 100, 1000.0  # Table 2
START_NS = 1_593_129_600_000_000_000  # 26 June 2020, when the paper was received
INTERVAL_NS = 1_000_000_000
JPEG_QUALITY = 80
# Linear light of a white surface at f/2.8, relative to a full pixel. At constant ISO and time a
# pixel's light goes with 1 / N^2 (Eq. 15): at f/1.8 white would be 1.9 of full, and clips.
WHITE_AT_F2_8 = 0.8
FULL_WELL_ELECTRONS, READ_NOISE_ELECTRONS = 4000.0, 8.0  # at ISO 1000
# A ruler on a desk is not cut out of paper: the lens blurs an edge by about a pixel.
EDGE_BLUR_PX = 0.7


@dataclass(frozen=True, slots=True)
class Photo:
    """One row of a table: sizes in pixels of the whole sensor, None where the paper states none."""

    object_id: str
    f_number: float
    width_px: float
    height_px: float
    depth_m: float  # at which the picture is drawn
    true_depth_m: float | None
    true_height_m: float | None
    erratum: str


def photos() -> list[Photo]:
    """Return the rows of Tables 3-7 and of Tables 9-10, in the order of the paper."""
    return [*_depth_rows(), *_height_rows()]


def _rows(name: str) -> Iterator[dict[str, str]]:
    with (PAPER / name).open(encoding="utf-8", newline="") as lines:
        yield from csv.DictReader(lines)


def _depth_rows() -> Iterator[Photo]:
    for row in _rows("depth_tables_3_to_7.csv"):
        depth_m = float(row["actual_depth_cm"]) / 100
        yield Photo(
            object_id=f"table{row['paper_table']}/row{row['row']}",
            f_number=float(row["f_number"]),
            width_px=float(row["object_width_px"]),
            height_px=float(SENSOR_PX[1]),
            depth_m=depth_m,
            true_depth_m=depth_m,
            true_height_m=None,
            erratum=row["erratum"],
        )


def _height_rows() -> Iterator[Photo]:
    implied_k = {
        float(r["f_number"]): float(r["k_implied"]) for r in _rows("depth_tables_3_to_7.csv")
    }
    for row in _rows("height_tables_9_10.csv"):
        f_number = float(row["f_number"])
        k = implied_k.get(f_number, float(interpolate_k(f_number, *K_TABLE_8)))
        depth_m = _depth_of_height_row(row)
        size_m = float(equivalent_object_size_m(k, FOCAL_LENGTH_MM, f_number))
        number = int(row["row"])
        yield Photo(
            object_id=f"table{9 if number <= 12 else 10}/row{number}",
            f_number=f_number,
            width_px=size_m * FOCAL_LENGTH_MM / depth_m / PIXEL_PITCH_UM * 1e3,
            height_px=float(row["image_height_px"]),
            depth_m=depth_m,
            true_depth_m=None,
            true_height_m=float(row["actual_height_cm"]) / 100,
            erratum=row["erratum"],
        )


def _depth_of_height_row(row: dict[str, str]) -> float:
    """Return the depth that the printed height came from: Eq. 14 solved for it, if an erratum says."""
    if not row["erratum"]:
        return float(row["estimated_depth_cm"]) / 100
    size_mm = float(row["image_height_px"]) * PIXEL_PITCH_UM * 1e-3
    return float(row["estimated_height_cm"]) / 100 * FOCAL_LENGTH_MM / size_mm


def render(photo: Photo, noise: np.random.Generator) -> npt.NDArray[np.uint8]:
    """Return a picture of the staff, (h, w, 3) BGR, as the sensor would see it."""
    scene = _scene(photo, noise)
    exposure = WHITE_AT_F2_8 * (2.8 / photo.f_number) ** 2
    electrons = scene * exposure * FULL_WELL_ELECTRONS
    electrons = noise.poisson(electrons) + noise.normal(0, READ_NOISE_ELECTRONS, scene.shape)
    linear = np.clip(electrons / FULL_WELL_ELECTRONS, 0, 1)
    return np.rint(linear_to_srgb(linear) * 255).astype(np.uint8)


def _scene(photo: Photo, noise: np.random.Generator) -> npt.NDArray[np.float64]:
    """Return the scene's reflectance times illumination, (h, w, 3) BGR, 0..1.

    Drawn at twice the stored size, so that edges fall between pixels where they should.
    """
    fine = 2
    width, height = PICTURE_PX[0] * fine, PICTURE_PX[1] * fine
    image = _background(width, height, noise)
    staff_px = photo.width_px * SCALE * fine
    left = width / 2 - staff_px / 2
    per_cm = 0.01 / photo.depth_m * FOCAL_LENGTH_MM / PIXEL_PITCH_UM * 1e3 * SCALE * fine
    _draw_staff(image, left, staff_px, per_cm)
    sigma = EDGE_BLUR_PX * fine
    image = cv2.GaussianBlur(image, (0, 0), sigma)
    small = cv2.resize(image, PICTURE_PX, interpolation=cv2.INTER_AREA)
    across = np.linspace(-1, 1, PICTURE_PX[0])[None, :, None]
    down = np.linspace(-1, 1, PICTURE_PX[1])[:, None, None]
    vignette = 1 - 0.12 * (across**2 + down**2) * (1.8 / photo.f_number)
    return np.clip(small * vignette, 0, 1).astype(np.float64)


def _background(width: int, height: int, noise: np.random.Generator) -> npt.NDArray[np.float32]:
    """Return a painted wall above a wooden table."""
    rough = noise.normal(0, 1, (height // 32 + 1, width // 32 + 1)).astype(np.float32)
    plaster = cv2.resize(rough, (width, height), interpolation=cv2.INTER_CUBIC)
    wall = np.array([0.20, 0.23, 0.25], np.float32)
    image = wall * (1 + 0.04 * plaster[..., None])
    edge = round(height * 0.86)
    grain = noise.normal(0, 1, (height - edge, 1)).astype(np.float32)
    streaks = cv2.GaussianBlur(np.repeat(grain, width, axis=1), (1, 31), 0)
    image[edge:] = np.array([0.05, 0.10, 0.18], np.float32) * (1 + 0.6 * streaks[..., None])
    return image


def _draw_staff(image: npt.NDArray[np.float32], left: float, width: float, per_cm: float) -> None:
    """Draw an aluminium staff: bright edges, a white face, an E-pattern and a figure every 10 cm."""
    height = image.shape[0]
    right = left + width
    rim = 0.045 * width
    _fill(image, left, right, 0, height, (0.55, 0.55, 0.54))
    _fill(image, left + rim, right - rim, 0, height, (0.86, 0.87, 0.86))
    zero = height / 2
    face_left, face_width = left + 1.6 * rim, width - 3.2 * rim
    first = math.floor(-zero / per_cm) - 1
    for cm in range(first, -first + 1):
        top = zero + cm * per_cm
        wide = 0.55 if cm % 5 == 0 else 0.42
        if cm % 2 == 0:
            _fill(image, face_left, face_left + wide * face_width, top, top + per_cm, (0.03,) * 3)
        if cm % 10 == 0:
            _fill(
                image,
                face_left,
                face_left + 0.9 * face_width,
                top,
                top + 0.12 * per_cm,
                (0.03,) * 3,
            )
            text = str(abs(40 - cm // 10))
            at = (round(face_left + 0.62 * face_width), round(top - 0.6 * per_cm))
            _write_text(image, text, at, 0.28 * face_width)


def _write_text(
    image: npt.NDArray[np.float32], text: str, at: tuple[int, int], width: float
) -> None:
    """Write a figure in dark red; OpenCV writes on bytes only, so it goes through a mask."""
    mask = np.zeros(image.shape[:2], np.uint8)
    font = cv2.FONT_HERSHEY_SIMPLEX
    (unit_width, _), _ = cv2.getTextSize(text, font, 1.0, 2)
    size = width / unit_width
    cv2.putText(mask, text, at, font, size, (255,), max(1, round(2 * size)), cv2.LINE_AA)
    rows, columns = np.nonzero(mask)
    share = mask[rows, columns, None] / np.float32(255)
    image[rows, columns] += share * (
        np.array([0.05, 0.05, 0.45], np.float32) - image[rows, columns]
    )


def _fill(
    image: npt.NDArray[np.float32],
    left: float,
    right: float,
    top: float,
    bottom: float,
    colour: tuple[float, ...],
) -> None:
    """Fill a rectangle whose edges may fall within pixels (pixel edges are whole numbers)."""
    columns = _cover(image.shape[1], left, right)
    rows = _cover(image.shape[0], top, bottom)
    x0, x1 = _span(columns)
    y0, y1 = _span(rows)
    if x0 == x1 or y0 == y1:
        return
    share = (rows[y0:y1, None] * columns[None, x0:x1])[..., None]
    part = image[y0:y1, x0:x1]
    part += share * (np.array(colour, np.float32) - part)


def _cover(count: int, low: float, high: float) -> npt.NDArray[np.float32]:
    edges = np.arange(count + 1, dtype=np.float64)
    inside = np.clip(np.minimum(edges[1:], high) - np.maximum(edges[:-1], low), 0, 1)
    return inside.astype(np.float32)


def _span(share: npt.NDArray[np.float32]) -> tuple[int, int]:
    at = np.flatnonzero(share)
    return (int(at[0]), int(at[-1]) + 1) if len(at) else (0, 0)


def intrinsics() -> Intrinsics:
    """Return the camera of the stored pictures; the centre of the first pixel is (0, 0)."""
    focal_px = FOCAL_LENGTH_MM * 1e3 / PIXEL_PITCH_UM * SCALE
    width, height = PICTURE_PX
    return Intrinsics(width, height, focal_px, focal_px, (width - 1) / 2, (height - 1) / 2)


def write(path: Path) -> None:
    """Write the recording."""
    rows = photos()
    noise = np.random.default_rng(595)
    with RecordingWriter(path, library="stadimeter simulate_staff") as writer:
        for index, photo in enumerate(rows):
            _write_photo(writer, photo, START_NS + index * INTERVAL_NS, noise)
        errata = "object_id,erratum\n" + "".join(
            f'{p.object_id},"{p.erratum}"\n' for p in rows if p.erratum
        )
        writer.add_attachment("errata.csv", "text/csv", errata.encode(), START_NS)
        writer.add_metadata(
            "provenance",
            {
                "what": "simulated from the tables of SN Applied Sciences (2021) 3:595",
                "by": "recordings/simulate_staff.py",
                "licence": "Apache-2.0; the tables CC BY 4.0",
                "scale": f"{SCALE:g} of the sensor's size",
            },
        )


def _write_photo(
    writer: RecordingWriter, photo: Photo, time_ns: int, noise: np.random.Generator
) -> None:
    _, jpeg = cv2.imencode(".jpg", render(photo, noise), [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
    stamp, name = timestamp(time_ns), {"frame_id": CAMERA}
    topic = f"/{CAMERA}"
    writer.write(f"{topic}/image", image_message(jpeg.tobytes(), "jpeg", time_ns, CAMERA), time_ns)
    calibration = calibration_message(intrinsics(), time_ns, CAMERA)
    writer.write(f"{topic}/calibration", calibration, time_ns)
    exposure = CameraExposure(
        timestamp=stamp,
        exposure_time_s=EXPOSURE_TIME_S,
        f_number=photo.f_number,
        photographic_sensitivity=ISO_SPEED,
        focal_length_mm=FOCAL_LENGTH_MM,
        focus_distance_m=math.inf,  # as the tables' captions say; the text says autofocus
        pixel_pitch_x_um=PIXEL_PITCH_UM,
        pixel_pitch_y_um=PIXEL_PITCH_UM,
        sensor_width_px=SENSOR_PX[0],
        sensor_height_px=SENSOR_PX[1],
        **name,
    )
    writer.write(f"{topic}/exposure", exposure, time_ns)
    box = _box(photo)
    found = Detections(timestamp=stamp, detector="the paper's crop", **name)
    # The paper gives widths to a hundredth of a sensor pixel, but crops by hand: one pixel.
    found.objects.add(box=box, class_name=CLASS, object_id=photo.object_id, box_std_px=SCALE)
    writer.write(f"{topic}/detections", found, time_ns)
    truth = GroundTruth(timestamp=stamp, **name)
    truth.objects.add(
        object_id=photo.object_id,
        class_name=CLASS,
        depth_m=photo.true_depth_m,
        height_m=photo.true_height_m,
    )
    writer.write(f"{topic}/truth", truth, time_ns)


def _box(photo: Photo) -> dict[str, float]:
    """Return the crop in pixels of the stored picture, in its middle."""
    width, height = photo.width_px * SCALE, photo.height_px * SCALE
    centre_x, centre_y = (PICTURE_PX[0] - 1) / 2, (PICTURE_PX[1] - 1) / 2
    return {
        "x_min_px": centre_x - width / 2,
        "y_min_px": centre_y - height / 2,
        "x_max_px": centre_x + width / 2,
        "y_max_px": centre_y + height / 2,
    }


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("-o", "--output", type=Path, required=True)
    write(parser.parse_args().output)
