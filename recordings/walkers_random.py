"""Random scenes, one for each seed: camera, place, crowd.

The camera is at 2.5-8 m, tilted by 5-45 degrees, with a lens of 4-12 mm; people walk at 4-45 m,
alone and side by side, straight and on arcs; some stop, some are children, some run, and one sits
until it gets up and goes. Things stand about: poles, signs, trees, bollards, parked cars.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipeline.core.records import GroundPlane, Intrinsics
from recordings.crowd import CHILD_M, Crowd
from recordings.walkers_body import Build, Floats, Path
from recordings.walkers_scene import Person, Scene, Settings, Walk, ends_m
from recordings.walkers_things import Thing, bench, car, pole, sign, tree
from recordings.walkers_view import View

NEAREST_M, FARTHEST_M = 4.0, 45.0  # depths at which people pass
CHILDREN, RUNNERS, STOPPERS, CURVED, IN_GROUPS = 0.08, 0.05, 0.15, 0.35, 0.3
APART_M = 0.55  # of people's axes, unless they walk together
TRIES = 60  # at a path for one person, before the camera is drawn again
SEEN_FRAMES = 12  # for which a person must be wholly in the picture


def make_scene(settings: Settings) -> Scene:
    """Return the scene of a seed; a camera without room for a person to walk is drawn again."""
    random = np.random.default_rng((4595, settings.seed))
    while True:
        view = random_view(random, settings.width_px, settings.height_px)
        main_rad = random.uniform(-0.5, 0.5) + random.choice([0.0, 0.0, np.pi / 2])
        things = _random_things(random, view, main_rad)
        people = _random_people(random, settings, view, things, main_rad)
        if len(people) == settings.people:
            break
    sun = None
    if random.uniform() < 0.7:
        up, about = np.deg2rad(random.uniform(28, 65)), random.uniform(0, 2 * np.pi)
        sun = np.array([np.cos(up) * np.cos(about), np.cos(up) * np.sin(about), np.sin(up)])
    numbered = [replace(p, object_id=f"person{i + 1}") for i, p in enumerate(people)]
    return Scene(settings, view, tuple(numbered), tuple(things), sun, int(random.integers(1 << 31)))


def random_view(random: np.random.Generator, width_px: int, height_px: int) -> View:
    """Return a camera as they are put up: sensors of 4.6-6.1 mm, lenses with barrel distortion."""
    pitch_um, sensor_px = random.uniform(2.4, 3.2), (1920, round(1920 * height_px / width_px))
    focal_mm = random.uniform(4.0, 12.0)
    focal_px = focal_mm * 1e3 / pitch_um * width_px / sensor_px[0]
    middle_px = np.array([width_px - 1, height_px - 1]) / 2
    centre_px = middle_px + random.normal(0, 0.008 * width_px, 2)
    # k2 = k1^2 keeps the radius rising everywhere: 1 + 3 k1 u + 5 k1^2 u^2 has no real root
    k1 = -random.uniform(0.0, 0.35)
    p1, p2 = random.normal(0, 4e-4, 2)
    intrinsics = Intrinsics(
        width_px,
        height_px,
        focal_px,
        focal_px,
        float(centre_px[0]),
        float(centre_px[1]),
        "plumb_bob",
        (k1, k1 * k1, float(p1), float(p2), 0.0),
    )
    plane = GroundPlane(
        random.uniform(2.5, 8.0),
        float(np.deg2rad(random.uniform(5, 45))),
        float(np.deg2rad(random.normal(0, 2))),
        source="truth",
    )
    return View(focal_mm, pitch_um, *sensor_px, intrinsics, plane)


def _seen_ground(
    random: np.random.Generator, view: View, lowest: float = 1.0
) -> tuple[float, float] | None:
    """Return a place on the ground in view, by chance over the picture, or None if too far or near."""
    pixel = random.uniform(
        [0, 0.1 * view.height_px], [view.width_px - 1.0, lowest * (view.height_px - 1)]
    )
    x_m, y_m, depth_m = view.ground(pixel)
    if not NEAREST_M < depth_m < FARTHEST_M:
        return None
    return float(x_m), float(y_m)


def _random_things(random: np.random.Generator, view: View, main_rad: float) -> list[Thing]:
    things: list[Thing] = []
    for _ in range(12):
        if len(things) >= random.integers(2, 7):
            break
        place = _seen_ground(random, view)
        if place is None:
            continue
        make = random.choice(["pole", "sign", "tree", "bollard", "car"])
        distance_m = np.hypot(place[0], place[1])
        if make == "car":
            # end on, a car is no line that people are before or behind
            across = np.arctan2(place[0], place[1])
            thing = car(random, place, -across + random.normal(0, 0.15))
        elif make == "tree":
            thing = tree(random, place)
        elif make == "sign":
            thing = sign(random, place)
        else:
            thing = pole(random, place, bollard=make == "bollard")
        if distance_m < (12.0 if make in ("car", "tree") else 6.0):
            continue
        if all(np.hypot(*(np.array(thing.place) - t.place)) > 4.0 for t in things):
            things.append(thing)
    return things


def _seat(person: Person) -> Thing:
    """Return the bench of a person who sits: behind the feet, which are the person's position."""
    path = person.walk.path
    back_m = 0.27 * person.build.height_m
    x_m = path.x_m - back_m * np.cos(path.heading_rad)
    y_m = path.y_m - back_m * np.sin(path.heading_rad)
    return bench((float(x_m), float(y_m)), path.heading_rad)


def _random_people(
    random: np.random.Generator,
    settings: Settings,
    view: View,
    things: list[Thing],
    main_rad: float,
) -> list[Person]:
    """Return the people of a scene; a bench for those who sit is added to the things."""
    people: list[Person] = []
    crowd = Crowd.drawn(random)
    sits = random.uniform() < 0.4
    while len(people) < settings.people:
        # Who walks here must not depend on who fits into the picture: the body first, then a path.
        build, colours = _random_build(random, crowd), _random_colours(random)
        sits = sits and not build.runs
        for _ in range(TRIES):
            first = _random_person(random, settings, view, main_rad, build, colours, sits=sits)
            if first is None or not _free(first, people, things):
                continue
            if _wholly_seen(view, first.walk, build.height_m):
                break
        else:
            return []
        if sits:
            seat = _seat(first)
            if any(seat.near(p.ground_m).any() for p in people):
                continue
            things.append(seat)
        people.append(first)
        if not sits and random.uniform() < IN_GROUPS and len(people) < settings.people:
            beside = _beside(random, first, crowd)
            if _free(beside, [p for p in people if p is not first], things):
                people.append(beside)
        sits = False
    return people


def _random_person(
    random: np.random.Generator,
    settings: Settings,
    view: View,
    main_rad: float,
    build: Build,
    colours: dict[str, tuple[int, int, int]],
    *,
    sits: bool,
) -> Person | None:
    place = _seen_ground(random, view)
    if place is None:
        return None
    heading = main_rad + random.normal(0, 0.12) + random.choice([0, np.pi])
    if random.uniform() < 0.4:
        heading = random.uniform(0, 2 * np.pi)
    curvature = 0.0
    if random.uniform() < CURVED:
        curvature = random.choice([-1, 1]) / random.uniform(6, 30)
    path = Path(*place, heading, curvature)
    cruise = random.uniform(2.4, 3.6) if build.runs else random.normal(1.35, 0.18)
    cruise = float(np.clip(cruise * (build.height_m / 1.70) ** 0.5, 0.7, 4.0))
    times_s = settings.times_s
    speed = cruise * (
        1 + 0.06 * np.sin(2 * np.pi * times_s / random.uniform(5, 9) + random.uniform(0, 6))
    )
    seated = np.zeros_like(times_s)
    passes_s = random.uniform(-1, settings.duration_s + 1)
    if sits:
        # sits on a bench of its own, and gets up and goes
        rises_s = random.uniform(0.4, 0.9) * settings.duration_s
        seated = 1 - _smooth((times_s - rises_s) / 1.5)
        speed = speed * _smooth((times_s - rises_s - 1.3) / 1.0)
        passes_s = 0.0
    elif random.uniform() < STOPPERS and not build.runs:
        stops_s, stays_s = passes_s + random.uniform(-1, 1), random.uniform(2, 7)
        halt = _smooth((times_s - stops_s) / 0.8) * (
            1 - _smooth((times_s - stops_s - stays_s) / 0.8)
        )
        speed = speed * (1 - halt)
    along_m = np.concatenate([[0.0], np.cumsum((speed[1:] + speed[:-1]) / 2)]) / settings.frame_rate
    along_m -= np.interp(passes_s, times_s, along_m)
    if not 0 <= passes_s <= settings.duration_s:  # passes just before or after the recording
        along_m -= cruise * (passes_s - np.clip(passes_s, 0, times_s[-1]))
    return Person("", build, Walk(path, along_m, speed, seated), cruise, colours)


def _beside(random: np.random.Generator, first: Person, crowd: Crowd) -> Person:
    """Return a companion of a person: the same path and speed, with another stride."""
    build = replace(_random_build(random, crowd), runs=first.build.runs)
    side = random.choice([-1, 1]) * random.uniform(0.6, 0.85)
    path = first.walk.path
    x_m = path.x_m - side * np.sin(path.heading_rad)
    y_m = path.y_m + side * np.cos(path.heading_rad)
    bend = 1 - path.curvature_per_m * side  # the outer of two on an arc walks farther
    beside = Path(x_m, y_m, path.heading_rad, path.curvature_per_m / bend)
    walk = first.walk
    lag_m = random.uniform(-0.25, 0.25)
    moved = Walk(beside, walk.along_m * bend + lag_m, walk.speed_m_s * bend, walk.sits)
    return Person("", build, moved, first.cruise_m_s * bend, _random_colours(random))


def _random_build(random: np.random.Generator, crowd: Crowd) -> Build:
    if random.uniform() < CHILDREN:
        tall_m = random.uniform(*CHILD_M)
        return Build(tall_m, random.uniform(0.95, 1.15), head_share=1.7 / tall_m * 0.93)
    tall_m = crowd.stature_m(random)
    return Build(
        float(tall_m),
        girth=random.uniform(0.92, 1.2),
        runs=bool(random.uniform() < RUNNERS),
        has_pack=bool(random.uniform() < 0.22),
        has_bag=bool(random.uniform() < 0.22),
    )


# Clothes are what people wear in the street, blue, green, red: mostly dark, many alike.
_CLOTH = [
    (44, 40, 40),
    (70, 52, 42),
    (90, 88, 86),
    (120, 126, 130),
    (52, 62, 74),
    (78, 96, 108),
    (96, 104, 112),
    (60, 76, 62),
    (62, 48, 112),
    (150, 150, 148),
    (190, 192, 196),
    (120, 84, 60),
]
_SKIN = [(128, 150, 196), (98, 122, 170), (66, 86, 128), (48, 60, 92)]
_HAIR = [(24, 26, 32), (32, 40, 56), (48, 70, 96), (110, 122, 130)]


def _random_colours(random: np.random.Generator) -> dict[str, tuple[int, int, int]]:
    def one(choices: list[tuple[int, int, int]]) -> tuple[int, int, int]:
        chosen = np.array(choices[random.integers(len(choices))], float)
        return tuple(int(c) for c in np.clip(chosen * random.normal(1, 0.1), 8, 245))  # type: ignore[return-value]

    skin, top, legs = one(_SKIN), one(_CLOTH), one(_CLOTH[:8])
    sleeves = random.uniform()
    return {
        "skin": skin,
        "hair": one(_HAIR),
        "top": top,
        "sleeve": top if sleeves < 0.9 else skin,
        "forearm": top if sleeves < 0.6 else skin,
        "legs": legs,
        "shoes": one([(30, 30, 32), (60, 64, 70), (150, 150, 150)]),
        "pack": one(_CLOTH),
        "bag": one(_CLOTH),
    }


def _free(person: Person, others: list[Person], things: list[Thing]) -> bool:
    """Return whether a person's path meets no other person and no thing."""
    at = person.ground_m
    for other in others:
        if (np.hypot(*(at - other.ground_m).T) < APART_M).any():
            return False
    return not any(thing.near(at).any() for thing in things)


def _wholly_seen(view: View, walk: Walk, height_m: float) -> bool:
    """Return whether a person is wholly in the picture, at depths that count, for long enough."""
    foot_m, head_m = ends_m(walk, height_m)
    foot, head = view.project(foot_m), view.project(head_m)
    size = np.array([view.width_px, view.height_px])
    with np.errstate(invalid="ignore"):
        side = 0.25 * np.abs(foot[:, 1] - head[:, 1])
        inside = ((foot > 4) & (foot < size - 4) & (head > 4) & (head < size - 4)).all(axis=1)
        inside &= (foot[:, 0] > side) & (foot[:, 0] < view.width_px - side)
        inside &= foot[:, 1] - head[:, 1] > 0.045 * view.height_px
    depth_m = view.depth_m(foot_m)
    inside &= (depth_m > NEAREST_M) & (depth_m < FARTHEST_M)
    return int(inside.sum()) >= SEEN_FRAMES


def _smooth(x: Floats) -> Floats:
    """Return 0 before 0, 1 after 1, a smooth step between."""
    t = np.clip(x, 0, 1)
    return np.asarray(t * t * (3 - 2 * t))
