"""Things in a scene that never move: hulls of spheres, as the people are."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from recordings.walkers_body import Floats

Colour = tuple[int, int, int]


@dataclass(frozen=True, slots=True)
class Part:
    """One hull of spheres, in one colour."""

    colour: Colour
    centres_m: Floats  # (s, 3)
    radii_m: Floats  # (s,)


@dataclass(frozen=True, slots=True)
class Thing:
    """A fixed thing that hides people behind it."""

    kind: str
    place: tuple[float, float]
    parts: tuple[Part, ...]
    radius_m: float  # of its foot; nobody walks there
    axis: Floats | None = None  # (2, 2) ends of a long thing

    def near(self, ground_m: Floats) -> np.ndarray:
        """Return which positions, (n, 2), are too close to it to walk there."""
        return np.asarray(self._distance_m(ground_m) < self.radius_m + 0.35)

    def hides(self, ground_m: Floats) -> bool:
        """Return whether it stands between the camera, at the origin, and a position, (2,)."""
        if self.axis is None:
            return bool(np.hypot(*ground_m) > np.hypot(*self.place))
        first, second = self.axis
        along = second - first

        def side(point: Floats) -> float:
            away = point - first
            return float(along[0] * away[1] - along[1] * away[0])

        return side(np.asarray(ground_m)) * side(np.zeros(2)) < 0

    def _distance_m(self, ground_m: Floats) -> Floats:
        if self.axis is None:
            return np.asarray(np.hypot(*(ground_m - self.place).T))
        first, second = self.axis
        along = second - first
        share = np.clip((ground_m - first) @ along / (along @ along), 0, 1)
        return np.asarray(np.hypot(*(ground_m - first - share[:, None] * along).T))


def _upright(place: tuple[float, float], low_m: float, high_m: float, radius_m: float) -> Floats:
    x, y = place
    return np.array([[x, y, low_m + radius_m], [x, y, high_m - radius_m]])


def pole(random: np.random.Generator, place: tuple[float, float], *, bollard: bool) -> Thing:
    """Return a lamp post or a bollard."""
    radius_m = random.uniform(0.06, 0.13)
    high_m = random.uniform(0.8, 1.0) if bollard else random.uniform(3.5, 7.0)
    shade = int(random.integers(50, 130))
    part = Part(
        (shade, shade, shade - 4), _upright(place, 0.0, high_m, radius_m), np.full(2, radius_m)
    )
    return Thing("bollard" if bollard else "pole", place, (part,), radius_m)


def sign(random: np.random.Generator, place: tuple[float, float]) -> Thing:
    """Return a road sign on a thin pole, or a board on two legs at the height of a person."""
    x, y = place
    low_m = random.choice([0.5, 1.9])
    half_m = random.uniform(0.25, 0.4) if low_m > 1 else random.uniform(0.35, 0.6)
    high_m = low_m + random.uniform(0.5, 0.8)
    leg = Part((120, 120, 118), _upright(place, 0.0, high_m, 0.03), np.full(2, 0.03))
    corners = np.array([[x + s * half_m, y, z] for s in (-1, 1) for z in (low_m, high_m)])
    colour = [(150, 70, 30), (40, 40, 170), (200, 200, 200), (50, 160, 190)][random.integers(4)]
    board = Part(colour, corners, np.full(4, 0.02))
    return Thing("sign", place, (leg, board), half_m)


def tree(random: np.random.Generator, place: tuple[float, float]) -> Thing:
    """Return a trunk under a crown that people walk below."""
    x, y = place
    radius_m = random.uniform(0.12, 0.25)
    trunk_m = random.uniform(2.6, 3.6)
    trunk = Part((52, 62, 72), _upright(place, 0.0, trunk_m + 1, radius_m), np.full(2, radius_m))
    crown = []
    for _ in range(14):
        away = random.normal(0, 0.75, 3) * [1, 1, 0.7]
        green = np.array([46, 84, 66]) * random.uniform(0.6, 1.25)
        centre = np.array([[x, y, trunk_m + 1.7]]) + away
        crown.append(Part(tuple(map(int, green)), centre, random.uniform(0.5, 0.9, 1)))  # type: ignore[arg-type]
    return Thing("tree", place, (trunk, *crown), radius_m)


def bench(place: tuple[float, float], heading_rad: float) -> Thing:
    """Return a bench without a back, to sit on facing `heading_rad`; `place` is its middle."""
    left = np.array([-np.sin(heading_rad), np.cos(heading_rad)])
    ahead = np.array([np.cos(heading_rad), np.sin(heading_rad)])

    def plank(along_m: float, deep_m: float, low_m: float, high_m: float, middle_m: float) -> Part:
        corners = [
            [*(np.array(place) + left * (middle_m + a * along_m) + ahead * b * deep_m), z]
            for a in (-1, 1)
            for b in (-1, 1)
            for z in (low_m, high_m)
        ]
        return Part((58, 84, 110), np.array(corners), np.full(8, 0.02))

    parts = [plank(0.04, 0.15, 0.02, 0.34, side) for side in (-0.65, 0.65)]
    parts.append(plank(0.80, 0.19, 0.35, 0.36, 0.0))
    axis = np.array([np.array(place) - 0.8 * left, np.array(place) + 0.8 * left])
    return Thing("bench", place, tuple(parts), 0.25, axis)


def car(random: np.random.Generator, place: tuple[float, float], heading_rad: float) -> Thing:
    """Return a parked car."""
    forward = np.array([np.cos(heading_rad), np.sin(heading_rad)])
    left = np.array([-forward[1], forward[0]])

    def hull(points: list[tuple[float, float, float]], radius_m: float, colour: Colour) -> Part:
        world = [[*(np.array(place) + a * forward + b * left), z] for a, b, z in points]
        return Part(colour, np.array(world), np.full(len(points), radius_m))

    def both(points: list[tuple[float, float]], half_m: float) -> list[tuple[float, float, float]]:
        return [(a, side * half_m, z) for a, z in points for side in (-1, 1)]

    paint = [(60, 58, 56), (190, 190, 190), (120, 80, 50), (50, 45, 120), (225, 225, 225)]
    chosen = np.array(paint[random.integers(len(paint))])
    body: Colour = tuple(int(c) for c in chosen)  # type: ignore[assignment]
    roof: Colour = tuple(int(c) for c in chosen * 0.9)  # type: ignore[assignment]
    parts = [
        hull(both([(1.25, 0.32), (-1.25, 0.32)], 0.7), 0.31, (30, 30, 30)),
        hull(both([(1.9, 0.45), (-1.9, 0.45), (1.8, 0.7), (-1.9, 0.78)], 0.72), 0.14, body),
        hull(
            both([(0.55, 0.85), (-1.4, 0.85), (0.05, 1.32), (-1.0, 1.32)], 0.62), 0.08, (70, 62, 56)
        ),
        hull(both([(0.0, 1.36), (-0.95, 1.36)], 0.58), 0.08, roof),
    ]
    near = min((-1, 1), key=lambda s: float(np.hypot(*(np.array(place) + s * 0.85 * left))))
    for a in (1.25, -1.25):
        parts.append(hull([(a, near * 0.62, 0.32)], 0.32, (28, 28, 28)))
        parts.append(hull([(a, near * 0.80, 0.32)], 0.17, (140, 140, 140)))
    axis = np.array([np.array(place) - 2.0 * forward, np.array(place) + 2.0 * forward])
    return Thing("car", place, tuple(parts), 1.1, axis)
