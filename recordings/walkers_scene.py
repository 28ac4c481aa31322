"""A scene of walking people before a fixed camera, and its ground truth at each frame."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import numpy.typing as npt

from recordings.walkers_body import Build, Floats, Path, pose
from recordings.walkers_things import Thing
from recordings.walkers_view import View


@dataclass(frozen=True, slots=True)
class Settings:
    """Settings of a scene that is to be made."""

    seed: int = 0
    duration_s: float = 40.0
    frame_rate: float = 10.0
    width_px: int = 960
    height_px: int = 540
    people: int = 18

    @property
    def frames(self) -> int:
        """Number of frames."""
        return round(self.duration_s * self.frame_rate)

    @property
    def times_s(self) -> Floats:
        """Time of each frame since the first."""
        return np.asarray(np.arange(self.frames) / self.frame_rate)


@dataclass(frozen=True, slots=True)
class Walk:
    """A path and the position of a person along it at each frame."""

    path: Path
    along_m: Floats  # (t,)
    speed_m_s: Floats  # (t,)
    sits: Floats  # (t,)

    @property
    def ground_m(self) -> Floats:
        """Positions on the ground, (t, 2)."""
        return self.path.at(self.along_m)[0]


@dataclass(frozen=True)
class Person:
    """A person who walks here, and how they look."""

    object_id: str
    build: Build
    walk: Walk
    cruise_m_s: float
    colours: dict[str, tuple[int, int, int]] = field(repr=False)

    @cached_property
    def ground_m(self) -> Floats:
        """Positions on the ground, (t, 2): of the body's axis, midway between the feet."""
        return self.walk.ground_m

    @cached_property
    def spheres_m(self) -> Floats:
        """Centres of the body's spheres, (t, s, 3)."""
        walk = self.walk
        step_m = self.build.step_m(self.cruise_m_s)
        return pose(self.build, walk.path, walk.along_m, walk.speed_m_s, step_m, walk.sits)


@dataclass(frozen=True, slots=True)
class TruePerson:
    """Ground truth of one person in one frame."""

    person: Person
    x_m: float
    y_m: float
    depth_m: float
    range_m: float  # from the camera to half of the standing height
    full_box_px: tuple[float, float, float, float]  # of the silhouette, in the picture or not
    outlines_px: Floats = field(repr=False)  # (s, k, 2) of the body's spheres


@dataclass(frozen=True)
class Scene:
    """A camera, the people who walk before it, and the things that stand there."""

    settings: Settings
    view: View
    people: tuple[Person, ...]
    things: tuple[Thing, ...]
    sun: Floats | None  # towards it, (3,); None under clouds
    look_seed: int

    @cached_property
    def _in_view(self) -> npt.NDArray[np.bool_]:
        """In which frames, (p, t), each of the people may be seen."""
        return np.array([_roughly_seen(self.view, p.walk, p.build.height_m) for p in self.people])

    @cached_property
    def radii_m(self) -> Floats:
        """Radii of everybody's spheres, (p, s)."""
        return np.stack([p.build.radii_m for p in self.people])

    def present(self, frame: int) -> list[TruePerson]:
        """Return the people who may be seen in a frame, the farthest first."""
        chosen = np.flatnonzero(self._in_view[:, frame])
        if len(chosen) == 0:
            return []
        people = [self.people[i] for i in chosen]
        outlines = self.view.outlines(
            np.stack([p.spheres_m[frame] for p in people]), self.radii_m[chosen]
        )
        ground = np.array([p.ground_m[frame] for p in people])
        depth_m = self.view.depth_m(np.pad(ground, ((0, 0), (0, 1))))
        half_m = np.array([p.build.height_m / 2 for p in people])
        drop_m = self.view.plane.camera_height_m - half_m
        range_m = np.sqrt((ground**2).sum(axis=1) + drop_m**2)
        found = []
        for i in np.argsort(-(ground**2).sum(axis=1)):
            drawn = outlines[i, people[i].build.drawn]
            if np.isfinite(drawn).all():
                box = (*drawn.min(axis=(0, 1)).tolist(), *drawn.max(axis=(0, 1)).tolist())
                at = (float(ground[i, 0]), float(ground[i, 1]))
                away = (float(depth_m[i]), float(range_m[i]))
                found.append(TruePerson(people[i], *at, *away, box, outlines[i]))
        return found


def ends_m(walk: Walk, height_m: float) -> tuple[Floats, Floats]:
    """Return the place on the ground, (t, 3), and the point above it at standing height."""
    ground = walk.ground_m
    foot = np.concatenate([ground, np.zeros((len(ground), 1))], axis=1)
    return foot, foot + np.array([0.0, 0.0, height_m])


def _roughly_seen(view: View, walk: Walk, height_m: float) -> np.ndarray:
    """Return in which frames a body's middle is in or near the picture and before the camera."""
    foot_m, head_m = ends_m(walk, height_m)
    foot, head = view.project(foot_m), view.project(head_m)
    with np.errstate(invalid="ignore"):
        tall_px = np.linalg.norm(foot - head, axis=1)
        reach = 0.8 * tall_px
        size = np.array([view.width_px, view.height_px])
        near = np.fmin(foot, head) < size + reach[:, None]
        near &= np.fmax(foot, head) > -reach[:, None]
    before = view.depth_m(head_m) > 1.0
    return np.asarray(near.all(axis=1) & before)
