"""The recording `aperture_sweep`: a target on a rail before a 50 mm lens, photographed at many apertures.

    python -m recordings.simulate_sweep -o recordings/aperture_sweep.mcap

A board moves on a rail from 0.5 to 5 m; at each stop the aperture is closed from f/1.8 to f/16. A small
board stands at 1.1 m and a ball at 3.2 m all the while. The first stops are taken with the lens focused
at infinity (Eq. 10 of the paper), the others at 1.5 m, so that things are before and behind the plane of
focus. Exposure time and ISO follow the aperture, but not quite, as in a camera with steps of a third.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from pipeline.core.records import Intrinsics
from pipeline.mcap_file.writer import (
    RecordingWriter,
    calibration_message,
    image_message,
    timestamp,
)
from recordings.sweep_scene import Lens, Scene, Target, jpeg, photograph
from schemas.stadimeter_pb2 import BoundingBox, CameraExposure, Detections, GroundTruth

CAMERA = "sweep"
CLASS = "board"
START_NS = 1_790_000_000_000_000_000  # 21 September 2026
# Seven photographs, then time to move the board.
INTERVAL_NS, PAUSE_NS = 500_000_000, 15_000_000_000
F_NUMBERS = (1.8, 2.8, 4.0, 5.6, 8.0, 11.0, 16.0)
# Where the board stops, and what the lens is focused on.
STOPS = (
    (0.5, math.inf),
    (0.9, math.inf),
    (1.8, math.inf),
    (5.0, math.inf),
    (0.6, 1.5),
    (0.8, 1.5),
    (1.5, 1.5),
    (2.4, 1.5),
    (3.6, 1.5),
)
LENS = Lens(
    pixel_pitch_um=23.4e3 / 960,  # 6000 pixels of 3.9 um, stored as 960
    width_px=960,
    height_px=640,
    softness_px=0.35,
    jpeg_quality=85,
)
SENSOR_WIDTH_PX, SENSOR_HEIGHT_PX, SENSOR_PITCH_UM = 6000, 4000, 3.9


@dataclass(frozen=True, slots=True)
class Shot:
    """One photograph: the scene, the lens that takes it, and what the recording states of it."""

    scene: Scene
    lens: Lens
    stated: Lens


def shots() -> list[Shot]:
    """Return the photographs of the recording that is kept, in order."""
    result = []
    for depth_m, focus_m in STOPS:
        scene = _scene(depth_m)
        for f_number in F_NUMBERS:
            lens = replace(LENS, f_number=f_number, focus_distance_m=focus_m)
            lens = _exposed(lens, scene)
            result.append(Shot(scene, lens, lens))
    return result


def _scene(depth_m: float) -> Scene:
    board = Target(
        "board",
        depth_m,
        -0.06 * depth_m,
        0.01 * depth_m,
        0.10,
        0.13,
        pattern="blocks",
        pieces=2,
        turn_rad=0.03,
        colour=(0.70, 0.74, 0.76),
        other=(0.05, 0.05, 0.06),
        seed=7,
    )
    card = Target(
        "card", 1.1, 0.16, -0.10, 0.13, 0.09, pattern="bars", pieces=2, turn_rad=-0.05,
        colour=(0.18, 0.30, 0.72), other=(0.72, 0.74, 0.70),
    )  # fmt: skip
    ball = Target(
        "ball", 3.2, 0.44, 0.32, 0.36, 0.36, pattern="plain", outline="ellipse",
        colour=(0.25, 0.62, 0.70),
    )  # fmt: skip
    return Scene((board, card, ball), wall_depth_m=7.0, wall_contrast=0.12, seed=2021)


def _exposed(lens: Lens, scene: Scene) -> Lens:
    """Return the lens with the exposure time, in thirds of a stop, that puts white at 0.6 of full."""
    luminance = scene.illuminance_lux / math.pi
    time_s = 0.6 * 78 * lens.f_number**2 / (0.65 * lens.iso_speed * luminance)
    thirds = round(3 * math.log2(time_s))
    return replace(lens, exposure_time_s=2 ** (thirds / 3))


def write(path: Path, photographs: Sequence[Shot], *, camera: str = CAMERA) -> None:
    """Write photographs as a recording with truth."""
    with RecordingWriter(path, library="stadimeter simulate_sweep") as writer:
        for index, shot in enumerate(photographs):
            time_ns = START_NS + index * INTERVAL_NS + index // len(F_NUMBERS) * PAUSE_NS
            picture = jpeg(photograph(shot.scene, shot.lens, index), shot.lens.jpeg_quality)
            for name, message in (
                ("image", image_message(picture, "jpeg", time_ns, camera)),
                ("calibration", calibration_message(intrinsics(shot.stated), time_ns, camera)),
                ("exposure", _exposure(shot.stated, time_ns, camera)),
                ("detections", _detections(shot, time_ns, camera)),
                ("truth", _truth(shot, time_ns, camera)),
            ):
                writer.write(f"/{camera}/{name}", message, time_ns)
        writer.add_metadata(
            "provenance",
            {
                "what": "simulated: boards before a wall, through a thin lens; no place is real",
                "by": "recordings/simulate_sweep.py",
                "licence": "Apache-2.0",
                "truth": "depth, width and height of every target",
            },
        )


def intrinsics(lens: Lens) -> Intrinsics:
    """Return the camera of the stored pictures: the focal length in pixels, focused at infinity.

    A calibration is made once; the image distance grows with focus, and comes from the exposure.
    """
    focal_px = lens.focal_length_mm * 1e3 / lens.pixel_pitch_um
    width, height = lens.width_px, lens.height_px
    return Intrinsics(width, height, focal_px, focal_px, (width - 1) / 2, (height - 1) / 2)


def _exposure(lens: Lens, time_ns: int, camera: str) -> CameraExposure:
    return CameraExposure(
        timestamp=timestamp(time_ns),
        frame_id=camera,
        exposure_time_s=lens.exposure_time_s,
        f_number=lens.f_number,
        photographic_sensitivity=lens.iso_speed,
        focal_length_mm=lens.focal_length_mm,
        focus_distance_m=lens.focus_distance_m,
        pixel_pitch_x_um=lens.pixel_pitch_um,
        pixel_pitch_y_um=lens.pixel_pitch_um,
        sensor_width_px=lens.width_px,
        sensor_height_px=lens.height_px,
    )


def _detections(shot: Shot, time_ns: int, camera: str) -> Detections:
    found = Detections(timestamp=timestamp(time_ns), frame_id=camera, detector="true outlines")
    for target in shot.scene.targets:
        found.objects.add(
            box=_box(target, shot.lens),
            class_name=CLASS,
            object_id=target.object_id,
            box_std_px=0.5,
        )
    return found


def _truth(shot: Shot, time_ns: int, camera: str) -> GroundTruth:
    truth = GroundTruth(timestamp=timestamp(time_ns), frame_id=camera)
    for target in shot.scene.targets:
        truth.objects.add(
            object_id=target.object_id,
            class_name=CLASS,
            depth_m=target.depth_m,
            height_m=target.height_m,
            width_m=target.width_m,
            box=_box(target, shot.lens),
        )
    return truth


def _box(target: Target, lens: Lens) -> BoundingBox:
    x0, y0, x1, y1 = target.box_px(lens)
    return BoundingBox(x_min_px=x0, y_min_px=y0, x_max_px=x1, y_max_px=y1)


def main() -> None:
    """Write the recording that is kept."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("-o", "--output", type=Path, required=True)
    write(parser.parse_args().output, shots())


if __name__ == "__main__":
    main()
