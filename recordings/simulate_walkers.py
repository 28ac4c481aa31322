"""Recordings of walking people, simulated: a camera of known pose, people of known height.

    python -m recordings.simulate_walkers --seed 7 -o FILE.mcap
    python -m recordings.simulate_walkers --kept -o recordings/walkers.mcap

Every seed is another camera, place and crowd. The pictures hold what makes boxes hard: limbs that
move, shadows, people who hide each other or walk side by side, poles and cars before them, clothes
like the ground, noise and JPEG. Of the camera the recording says what a lens says, never the pose; the
pose is in the metadata, and the truth of every person in `stadimeter.GroundTruth`, where only the
accuracy views look. The attachment `silhouettes.csv` says of each person in each frame how much is
seen, and where the whole silhouette is.
"""

from __future__ import annotations

import argparse
import csv
import io
import math
from pathlib import Path

import cv2

from pipeline.mcap_file.writer import (
    RecordingWriter,
    calibration_message,
    image_message,
    timestamp,
)
from recordings.walkers_random import make_scene
from recordings.walkers_render import Renderer, Seen
from recordings.walkers_scene import Scene, Settings
from recordings.walkers_view import View
from schemas.stadimeter_pb2 import BoundingBox, CameraExposure, Detections, GroundTruth

START_NS = 1_790_000_000_000_000_000  # invented: 21 September 2026
JPEG_QUALITY = 80
EXPOSURE_TIME_S, F_NUMBER, ISO_SPEED = 0.005, 2.0, 200.0
CLASS = "person"
# The recording that is kept: small enough for the source, long enough for a pose.
KEPT = Settings(seed=90, duration_s=25.0, frame_rate=8.0, width_px=512, height_px=384, people=14)
KEPT_QUALITY = 60


def write(
    path: Path,
    settings: Settings,
    *,
    camera: str = "walkers",
    quality: int = JPEG_QUALITY,
    with_detections: bool = False,
) -> Scene:
    """Write the recording of a scene, and return the scene.

    `with_detections` adds the true boxes of whole silhouettes as recorded detections, with the
    identity of whom they show: a perfect detector and tracker.
    """
    scene = make_scene(settings)
    renderer = Renderer(scene)
    rows: list[tuple[object, ...]] = []
    with RecordingWriter(path, library="stadimeter simulate_walkers") as writer:
        for index, time_s in enumerate(settings.times_s):
            time_ns = START_NS + round(time_s * 1e9)
            picture, seen = renderer.frame(index)
            _, jpeg = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, quality])
            messages = {
                "image": image_message(jpeg.tobytes(), "jpeg", time_ns, camera),
                "exposure": _exposure(scene.view, time_ns, camera),
                "truth": _truth(seen, time_ns, camera),
            }
            if index % math.ceil(settings.frame_rate) == 0:
                lens = calibration_message(scene.view.intrinsics, time_ns, camera)
                messages = {"calibration": lens} | messages
            if with_detections:
                messages["detections"] = _detections(seen, scene.view, time_ns, camera)
            for name, message in messages.items():
                writer.write(f"/{camera}/{name}", message, time_ns)
            rows += [(index, s.true.person.object_id, *_rounded(s)) for s in seen]
        writer.add_attachment("silhouettes.csv", "text/csv", _silhouettes(rows), START_NS)
        writer.add_metadata("provenance", _provenance(settings))
        writer.add_metadata("true_camera", _pose(scene.view))
    return scene


def _exposure(view: View, time_ns: int, camera: str) -> CameraExposure:
    return CameraExposure(
        timestamp=timestamp(time_ns),
        frame_id=camera,
        exposure_time_s=EXPOSURE_TIME_S,
        f_number=F_NUMBER,
        photographic_sensitivity=ISO_SPEED,
        focal_length_mm=view.focal_length_mm,
        focus_distance_m=math.inf,
        pixel_pitch_x_um=view.pixel_pitch_um,
        pixel_pitch_y_um=view.pixel_pitch_um,
        sensor_width_px=view.sensor_width_px,
        sensor_height_px=view.sensor_height_px,
    )


def _truth(seen: list[Seen], time_ns: int, camera: str) -> GroundTruth:
    truth = GroundTruth(timestamp=timestamp(time_ns), frame_id=camera)
    for one in seen:
        true = one.true
        truth.objects.add(
            object_id=true.person.object_id,
            class_name=CLASS,
            depth_m=true.depth_m,
            range_m=true.range_m,
            height_m=true.person.build.height_m,
            x_m=true.x_m,
            y_m=true.y_m,
            box=_box(one.box_px),
        )
    return truth


def _detections(seen: list[Seen], view: View, time_ns: int, camera: str) -> Detections:
    found = Detections(timestamp=timestamp(time_ns), frame_id=camera, detector="true silhouettes")
    for one in seen:
        x0, y0, x1, y1 = one.true.full_box_px
        if x0 > 0 and y0 > 0 and x1 < view.width_px - 1 and y1 < view.height_px - 1:
            found.objects.add(
                box=_box(one.box_px), class_name=CLASS, object_id=one.true.person.object_id
            )
    return found


def _box(edges: tuple[float, float, float, float]) -> BoundingBox:
    x0, y0, x1, y1 = edges
    return BoundingBox(x_min_px=x0, y_min_px=y0, x_max_px=x1, y_max_px=y1)


_COLUMNS = ("frame", "object_id", "visible_share", "x_min_px", "y_min_px", "x_max_px", "y_max_px")


def _rounded(seen: Seen) -> list[str]:
    return [f"{seen.visible_share:.2f}", *(f"{v:.1f}" for v in seen.true.full_box_px)]


def _silhouettes(rows: list[tuple[object, ...]]) -> bytes:
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(_COLUMNS)
    table.writerows(rows)
    return text.getvalue().encode()


def _provenance(settings: Settings) -> dict[str, str]:
    return {
        "what": "simulated: people walk before a fixed camera; nobody and no place is real",
        "by": "recordings/simulate_walkers.py",
        "licence": "Apache-2.0",
        "seed": str(settings.seed),
        "truth": "depth and position of the body's axis on the ground, range to half of its height, "
        "standing height in shoes, box of the silhouette as if nobody and nothing hid it",
    }


def _pose(view: View) -> dict[str, str]:
    plane = view.plane
    return {
        "camera_height_m": f"{plane.camera_height_m:.4f}",
        "tilt_deg": f"{math.degrees(plane.tilt_rad):.4f}",
        "roll_deg": f"{math.degrees(plane.roll_rad):.4f}",
    }


def main() -> None:
    """Write a recording as the command line says."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("-o", "--output", type=Path, required=True)
    parser.add_argument("--kept", action="store_true", help="the recording that is kept")
    parser.add_argument("--seed", type=int, default=0, help="camera, place and crowd")
    parser.add_argument("--duration", type=float, default=40.0, help="seconds")
    parser.add_argument("--frame-rate", type=float, default=10.0, help="frames a second")
    parser.add_argument("--size", type=int, nargs=2, default=(960, 540), metavar=("W", "H"))
    parser.add_argument("--people", type=int, default=18)
    parser.add_argument("--quality", type=int, default=JPEG_QUALITY, help="of the JPEGs")
    parser.add_argument("--with-detections", action="store_true", help="add the true boxes")
    given = parser.parse_args()
    width_px, height_px = given.size
    settings = Settings(
        given.seed, given.duration, given.frame_rate, width_px, height_px, given.people
    )
    if given.kept:
        write(given.output, KEPT, quality=KEPT_QUALITY)
    else:
        write(given.output, settings, quality=given.quality, with_detections=given.with_detections)


if __name__ == "__main__":
    main()
