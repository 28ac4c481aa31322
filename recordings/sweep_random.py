"""Random scenes for depth from defocus: a target somewhere between 0.5 and 5 m, before a wall.

The lens that draws is not quite the one that the recording states: apertures, focal lengths and focus
scales are engraved with tolerances, and `TOLERANCES` draws an error for each camera.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from recordings.sweep_scene import Lens, Scene, Target

F_NUMBERS = (1.8, 2.0, 2.8, 4.0, 5.6, 8.0)
DEPTHS_M = (0.5, 5.0)
PITCHES_UM = (8.0, 12.0, 20.0, 26.0)
FOCUS_M = (math.inf, 0.7, 1.5, 3.0)
# One sigma: of aperture and focal length together, of the focus scale, and of its zero in 1/m.
APERTURE_TOLERANCE, FOCUS_TOLERANCE, FOCUS_ZERO_PER_M = 0.02, 0.01, 0.003
WIDTH_PX, HEIGHT_PX = 640, 480


@dataclass(frozen=True, slots=True)
class Shot:
    """A scene, the lens that drew it and the lens that the recording states."""

    scene: Scene
    lens: Lens
    stated: Lens

    @property
    def target(self) -> Target:
        """The target whose depth is measured."""
        return self.scene.targets[0]


def random_shot(seed: int, f_number: float | None = None) -> Shot:
    """Return one shot; the same for the same seed."""
    chance = np.random.default_rng((595, 2021, seed))
    stated = Lens(
        f_number=f_number or float(chance.choice(F_NUMBERS)),
        focus_distance_m=float(chance.choice(FOCUS_M)),
        pixel_pitch_um=float(chance.choice(PITCHES_UM)),
        width_px=WIDTH_PX,
        height_px=HEIGHT_PX,
        softness_px=float(chance.uniform(0.25, 0.6)),
        mosaic=bool(chance.random() < 0.5),
        jpeg_quality=int(chance.integers(75, 96)),
    )
    target = random_target(chance, stated, "target")
    scene = Scene(
        (target,),
        wall_depth_m=target.depth_m * float(chance.uniform(1.3, 3.0)),
        wall_colour=tuple(chance.uniform(0.1, 0.5) * chance.uniform(0.8, 1.2, 3)),
        wall_contrast=float(chance.uniform(0.02, 0.3)),
        wall_grain_m=float(chance.uniform(0.005, 0.05)),
        illuminance_lux=300.0,
        seed=seed,
    )
    # Exposed so that white is at 0.5-0.9 of full: 78 N^2 / (0.65 t ISO) = lux / pi / share.
    white = float(chance.uniform(0.5, 0.9))
    iso = white * 78 * stated.f_number**2 * math.pi / (0.65 * 300.0 * stated.exposure_time_s)
    stated = replace(stated, iso_speed=iso)
    return Shot(scene, off(stated, chance), stated)


def off(stated: Lens, chance: np.random.Generator) -> Lens:
    """Return a lens as its maker's tolerances may have it."""
    dioptres = (
        1 / stated.focus_distance_m * (1 + FOCUS_TOLERANCE * chance.standard_normal())
        + FOCUS_ZERO_PER_M * chance.standard_normal()
    )
    return replace(
        stated,
        f_number=stated.f_number * (1 + APERTURE_TOLERANCE * chance.standard_normal()),
        focus_distance_m=1 / dioptres if dioptres > 1e-4 else math.inf,
    )


def random_target(chance: np.random.Generator, lens: Lens, object_id: str) -> Target:
    """Return a target that fills a fifth to a half of the picture, away from its borders."""
    low, high = DEPTHS_M
    depth_m = float(1 / chance.uniform(1 / high, 1 / low))
    if chance.random() < 0.5:
        depth_m = float(chance.uniform(low, high))
    scale = lens.focal_px / depth_m
    width_m = float(chance.uniform(0.2, 0.45)) * lens.width_px / scale
    height_m = float(chance.uniform(0.3, 0.6)) * lens.height_px / scale
    light, dark = chance.uniform(0.45, 0.85), chance.uniform(0.03, 0.12)
    tint = chance.uniform(0.8, 1.2, 3)
    colour, other = tuple(np.minimum(light * tint, 0.9)), tuple(dark * tint)
    if chance.random() < 0.5:
        colour, other = other, colour
    plain = chance.random() < 0.4
    pattern = "plain" if plain else str(chance.choice(["bars", "checks", "blocks"]))
    return Target(
        object_id,
        depth_m,
        float(chance.uniform(-0.12, 0.12)) * lens.width_px / scale,
        float(chance.uniform(-0.1, 0.1)) * lens.height_px / scale,
        width_m,
        height_m,
        pattern=pattern,
        pieces=int(chance.integers(2, 5)),
        outline="ellipse" if chance.random() < 0.25 else "rectangle",
        turn_rad=float(chance.normal(0, 0.1)),
        colour=colour,
        other=other,
        seed=int(chance.integers(1 << 30)),
    )
