"""The recording `staff`: the paper's experiment, photographed again from its tables.

    python -m recordings.simulate_staff -o recordings/staff.mcap

A graduated levelling staff stands before a 50 mm lens on a 6000 x 4000 sensor of 3.9 um: the 35
rows of Tables 3-7 (50-110 cm, f/1.8-f/4) and the 22 rows of Tables 9-10. The pictures are stored at
a quarter of the size, with the scale in the calibration. The same bytes come out every time.

What the paper prints goes in as recorded detections: the width of its crop, and in Tables 9-10 the
height. What it does not print is derived; `staff_table.py` says how. The truth holds only what the
paper states: the depth in Tables 3-7, the height in Tables 9-10.
"""

from __future__ import annotations

import argparse
import csv
import io
import math
from pathlib import Path

import cv2

from pipeline.core.records import Intrinsics
from pipeline.mcap_file.writer import (
    RecordingWriter,
    calibration_message,
    image_message,
    timestamp,
)
from recordings.staff_scene import HEIGHT_PX, ILLUMINANCE_LUX, SCALE, WIDTH_PX, photograph
from recordings.staff_table import (
    EXPOSURE_TIME_S,
    FOCAL_LENGTH_MM,
    ISO_SPEED,
    PIXEL_PITCH_UM,
    SENSOR_HEIGHT_PX,
    SENSOR_WIDTH_PX,
    Photo,
    photos,
)
from schemas.stadimeter_pb2 import BoundingBox, CameraExposure, Detections, GroundTruth

CAMERA = "nikon_d5300"
CLASS = "levelling_staff"
DETECTOR = "paper crop"
START_NS = 1_593_129_600_000_000_000  # 26 June 2020, when the paper was received
INTERVAL_NS = 1_000_000_000
JPEG_QUALITY = 80


def write(path: Path) -> None:
    """Write the recording."""
    rows = photos()
    with RecordingWriter(path, library="stadimeter simulate_staff") as writer:
        for index, photo in enumerate(rows):
            _write_photo(writer, photo, index)
        writer.add_attachment("errata.csv", "text/csv", _errata(rows), START_NS)
        writer.add_metadata(
            "provenance",
            {
                "what": "simulated from the tables of SN Applied Sciences (2021) 3:595",
                "by": "recordings/simulate_staff.py",
                "licence": "Apache-2.0; the tables CC BY 4.0",
                "scale": f"{SCALE:g} of the sensor's size",
                "illuminance_lux": f"{ILLUMINANCE_LUX:g}",
                "truth": "depth in Tables 3-7, height in Tables 9-10; nothing else is stated",
                "derived": "widths in Tables 9-10 and heights in Tables 3-7 are not printed",
                "focus": "infinity by the captions of the tables, automatic by the text",
            },
        )


def intrinsics() -> Intrinsics:
    """Return the camera of the stored pictures; the centre of the first pixel is (0, 0)."""
    focal_px = FOCAL_LENGTH_MM * 1e3 / PIXEL_PITCH_UM * SCALE
    return Intrinsics(
        WIDTH_PX, HEIGHT_PX, focal_px, focal_px, (WIDTH_PX - 1) / 2, (HEIGHT_PX - 1) / 2
    )


def _write_photo(writer: RecordingWriter, photo: Photo, index: int) -> None:
    time_ns = START_NS + index * INTERVAL_NS
    quality = [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY]
    _, jpeg = cv2.imencode(".jpg", photograph(photo, index), quality)
    image = image_message(jpeg.tobytes(), "jpeg", time_ns, CAMERA)
    for name, message in (
        ("image", image),
        ("calibration", calibration_message(intrinsics(), time_ns, CAMERA)),
        ("exposure", _exposure(photo, time_ns)),
        ("detections", _detections(photo, time_ns)),
        ("truth", _truth(photo, time_ns)),
    ):
        writer.write(f"/{CAMERA}/{name}", message, time_ns)


def _exposure(photo: Photo, time_ns: int) -> CameraExposure:
    return CameraExposure(
        timestamp=timestamp(time_ns),
        frame_id=CAMERA,
        exposure_time_s=EXPOSURE_TIME_S,
        f_number=photo.f_number,
        photographic_sensitivity=ISO_SPEED,
        focal_length_mm=FOCAL_LENGTH_MM,
        focus_distance_m=math.inf,  # as the tables' captions say; the text says autofocus
        pixel_pitch_x_um=PIXEL_PITCH_UM,
        pixel_pitch_y_um=PIXEL_PITCH_UM,
        sensor_width_px=SENSOR_WIDTH_PX,
        sensor_height_px=SENSOR_HEIGHT_PX,
    )


def _detections(photo: Photo, time_ns: int) -> Detections:
    found = Detections(timestamp=timestamp(time_ns), frame_id=CAMERA, detector=DETECTOR)
    # The crop is by hand: the paper prints hundredths of a sensor pixel, one is what we believe.
    found.objects.add(
        box=_box(photo), class_name=CLASS, object_id=photo.object_id, box_std_px=SCALE
    )
    return found


def _truth(photo: Photo, time_ns: int) -> GroundTruth:
    truth = GroundTruth(timestamp=timestamp(time_ns), frame_id=CAMERA)
    truth.objects.add(
        object_id=photo.object_id,
        class_name=CLASS,
        depth_m=photo.true_depth_m,
        height_m=photo.true_height_m,
    )
    return truth


def _box(photo: Photo) -> BoundingBox:
    """Return the crop in pixels of the stored picture, in its middle."""
    width, height = photo.width_px * SCALE, photo.height_px * SCALE
    centre_x, centre_y = (WIDTH_PX - 1) / 2, (HEIGHT_PX - 1) / 2
    return BoundingBox(
        x_min_px=centre_x - width / 2,
        y_min_px=centre_y - height / 2,
        x_max_px=centre_x + width / 2,
        y_max_px=centre_y + height / 2,
    )


def _errata(rows: list[Photo]) -> bytes:
    """Return the rows that contradict themselves, as CSV."""
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(["object_id", "erratum"])
    table.writerows([p.object_id, p.erratum] for p in rows if p.erratum)
    return text.getvalue().encode()


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("-o", "--output", type=Path, required=True)
    write(parser.parse_args().output)
