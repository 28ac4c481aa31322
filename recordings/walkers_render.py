"""Pictures of a scene: bodies drawn limb by limb over the painted ground, as a cheap camera sees it.

Colours are sRGB values throughout. What scales light (shadow, shading, the sun's drift) scales them
by a factor to the power of 1/2.2, which is the same.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
import numpy.typing as npt

from recordings.walkers_body import SPHERES, Floats
from recordings.walkers_ground import Image, paint_background
from recordings.walkers_scene import Person, Scene, TruePerson
from recordings.walkers_things import Thing

# Bodies are drawn this many times larger and averaged down, so that edges lie within a tenth of a
# pixel; those that are large anyway less so.
_FINE, _COARSE, _LARGE_PX = 4, 2, 260
_SHIFT = 4  # bits of a fraction of a pixel in OpenCV's drawing

SHADOW_LIGHT = (0.72, 0.67, 0.63)  # factor on blue, green, red: the sky is bluer than the sun
# At twice its radius from a leg's axis the leg hides a sixth of the sky's azimuths, at three times a
# ninth: (radius of the blob as a share of stature, level of 255), of the factor at full level.
CONTACT, CONTACT_LIGHT = ((0.085, 80), (0.05, 170)), 0.84
DRIFT = 0.03  # of the light, in a minute or so
READ_NOISE, PHOTON_NOISE = 1.6, 0.16  # grey levels: constant, and by the root of the level
NOISY = (0.5, 1.4)  # times that, from camera to camera
LENS_BLUR_PX = 0.55
VISIBLE_SHARE = 0.05  # below it, somebody hidden is not in the truth


@dataclass(frozen=True, slots=True)
class Seen:
    """Somebody in a picture: the truth, and how much of the silhouette shows."""

    true: TruePerson
    box_px: tuple[float, float, float, float]  # of the silhouette within the picture
    visible_share: float  # of the whole silhouette: the rest is hidden, or outside the picture


@dataclass(frozen=True, slots=True)
class _Patch:
    """Something drawn: colours and cover of a rectangle of the picture."""

    x0: int
    y0: int
    colour: Image  # (h, w, 3)
    cover: Image  # (h, w), 255 where it covers all of a pixel
    whole: float  # pixels of the silhouette, in the picture and outside

    @property
    def window(self) -> tuple[slice, slice]:
        height, width = self.cover.shape
        return slice(self.y0, self.y0 + height), slice(self.x0, self.x0 + width)


class Renderer:
    """Draws the frames of one scene, any of them, in any order."""

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self.view = scene.view
        random = np.random.default_rng((7, scene.look_seed))
        size = (self.view.height_px, self.view.width_px)
        self._light = self._light_from()
        # where things stand before the ground, and where besides no sun falls: known with the background
        self._things_cover, self._sunless = np.zeros(size, np.uint8), np.zeros(size, np.uint8)
        self._noisy = random.uniform(*NOISY)
        noise = random.standard_normal((size[0] + 97, size[1] + 131, 3)).astype(np.float32)
        self._noise = cv2.GaussianBlur(noise, (0, 0), 0.5)
        self._noise /= self._noise.std()
        self._cloth = cv2.GaussianBlur(
            random.standard_normal((64, 64)).astype(np.float32), (0, 0), 2.0
        )
        self._cloth *= 0.07 / self._cloth.std()
        self._drift = random.uniform(0, 2 * np.pi, 2)
        self._vignette = _vignette(*size)

    def _light_from(self) -> Floats:
        """Return where light comes from, (2,) in the picture, for shading."""
        if self.scene.sun is None:
            return np.array([0.0, -1.0])
        x, y = (self.view.camera_from_world @ self.scene.sun)[:2]
        return np.array([x, y]) / max(math.hypot(x, y), 0.3)

    @cached_property
    def _thing_patches(self) -> list[tuple[Thing, _Patch]]:
        patches = []
        for thing in self.scene.things:
            order = sorted(
                thing.parts,
                key=lambda p: (
                    -float(np.linalg.norm(self.view.in_camera(p.centres_m), axis=1).min())
                ),
            )
            if thing.kind == "car":
                order = list(thing.parts)  # from the wheels up to the roof
            hulls, colours = [], []
            for part in order:
                outline = self.view.outlines(part.centres_m, part.radii_m)
                if np.isfinite(outline).all():
                    hulls.append(outline)
                    colours.append(part.colour)
            patch = self._draw(hulls, colours, None)
            if patch is not None:
                patches.append((thing, patch))
        return patches

    @cached_property
    def background(self) -> Image:
        """The empty scene, without drift and noise, (h, w, 3)."""
        image = paint_background(self.view, self.scene.look_seed)
        shadow = np.zeros(image.shape[:2], np.uint8)
        if self.scene.sun is not None:
            for thing in self.scene.things:
                for part in thing.parts:
                    self._cast(
                        shadow, part.centres_m, part.radii_m, [list(range(len(part.radii_m)))]
                    )
        shadow = cv2.GaussianBlur(shadow, (0, 0), 1.2)
        _darken(image, shadow, SHADOW_LIGHT)
        far_first = sorted(self._thing_patches, key=lambda t: -float(np.hypot(*t[0].place)))
        for _, patch in far_first:
            _put(image, patch, patch.cover)
            over = self._things_cover[patch.window]
            cv2.max(over, patch.cover, dst=over)
        cv2.max(shadow, self._things_cover, dst=self._sunless)
        return image

    def frame(self, index: int, *, noise: bool = True) -> tuple[Image, list[Seen]]:
        """Return the picture of a frame, (h, w, 3), and the people in it."""
        present = self.scene.present(index)
        image = self.background.copy()
        self._shadows(image, [p.person for p in present], index)
        owner = np.zeros(image.shape[:2], np.uint8)
        drawn: list[tuple[TruePerson, _Patch]] = []
        for number, true in enumerate(present, start=1):
            patch = self._body(true, index)
            if patch is None:
                continue
            cover = patch.cover
            for thing, other in self._thing_patches:
                if thing.hides(true.person.ground_m[index]):
                    cover = _behind(patch, cover, other)
            _put(image, patch, cover)
            owner[patch.window][cover > 127] = number
            drawn.append((true, patch))
        seen = []
        numbers = {id(true): n for n, true in enumerate(present, start=1)}
        for true, patch in drawn:
            shows = int(np.count_nonzero(owner[patch.window] == numbers[id(true)]))
            share = shows / max(patch.whole, 1.0)
            if share >= VISIBLE_SHARE:
                seen.append(Seen(true, self._clipped(true.full_box_px), share))
        return self._develop(image, index, noise=noise), seen

    def _clipped(self, box: tuple[float, float, float, float]) -> tuple[float, float, float, float]:
        x0, y0, x1, y1 = box
        right, bottom = self.view.width_px - 0.5, self.view.height_px - 0.5
        return max(x0, -0.5), max(y0, -0.5), min(x1, right), min(y1, bottom)

    def _body(self, true: TruePerson, index: int) -> _Patch | None:
        person = true.person
        centres = self.view.in_camera(person.spheres_m[index])
        away = np.linalg.norm(centres, axis=1)
        limbs = sorted(person.build.limbs, key=lambda limb: -float(away[limb[1]].mean()))
        hulls = [true.outlines_px[spheres] for _, spheres in limbs]
        return self._draw(hulls, [person.colours[name] for name, _ in limbs], person)

    def _draw(
        self, hulls: list[Floats], colours: list[tuple[int, int, int]], person: Person | None
    ) -> _Patch | None:
        """Draw hulls of outlines (s, k, 2), the last on top; None if nothing is in the picture."""
        if not hulls:
            return None
        points = np.concatenate([h.reshape(-1, 2) for h in hulls])
        low, high = np.floor(points.min(axis=0)) - 1, np.ceil(points.max(axis=0)) + 2
        x0, y0 = (int(v) for v in np.maximum(low, 0))
        x1, y1 = (
            int(min(v, s))
            for v, s in zip(high, (self.view.width_px, self.view.height_px), strict=True)
        )
        if x1 - x0 < 1 or y1 - y0 < 1:
            return None
        fine = _FINE if y1 - y0 < _LARGE_PX else _COARSE
        size = ((y1 - y0) * fine, (x1 - x0) * fine)
        colour, cover = np.zeros((*size, 3), np.uint8), np.zeros(size, np.uint8)
        for hull, base in zip(hulls, colours, strict=True):
            at = (hull - [x0, y0] + 0.5) * fine - 0.5
            middles = at.mean(axis=1, keepdims=True)
            radius = np.linalg.norm(at - middles, axis=-1).max(axis=1)[:, None, None]
            # half a drawn pixel is what OpenCV adds to a polygon all round
            shape = _polygon(middles + (at - middles) * np.maximum(1 - 0.5 / radius, 0))
            tone = np.array(base, float)
            cv2.fillConvexPoly(cover, shape, (255,), cv2.LINE_8, _SHIFT)
            cv2.fillConvexPoly(colour, shape, tuple(tone * 0.74), cv2.LINE_8, _SHIFT)
            for share, bright in ((0.80, 0.90), (0.52, 1.06)):
                lit = middles + (at - middles) * share + self._light * radius * (1 - share) * 0.8
                tones = tuple(np.clip(tone * bright, 0, 255))
                cv2.fillConvexPoly(colour, _polygon(lit), tones, cv2.LINE_8, _SHIFT)
        colour = cv2.blur(colour, (fine + 1, fine + 1))
        whole = float(np.count_nonzero(cover)) / fine**2
        whole *= max(float(np.prod(high - low)) / ((x1 - x0) * (y1 - y0)), 1.0)
        small = (x1 - x0, y1 - y0)
        colour = cv2.resize(colour, small, interpolation=cv2.INTER_AREA)
        cover = cv2.resize(cover, small, interpolation=cv2.INTER_AREA)
        if person is not None:
            folds = cv2.resize(self._cloth, small, interpolation=cv2.INTER_LINEAR)
            colour = np.clip(colour * (1 + folds[..., None]), 0, 255).astype(np.uint8)
        return _Patch(x0, y0, colour, cover, whole)

    def _shadows(self, image: Image, people: list[Person], index: int) -> None:
        """Darken the ground: near the feet, where less sky is seen, and where the sun is hidden."""
        if not people:
            return
        spheres = np.stack([p.spheres_m[index] for p in people])
        tall_m = np.array([p.build.height_m for p in people])
        contact, shadow = (np.zeros(image.shape[:2], np.uint8) for _ in range(2))
        feet = spheres[:, _FEET].reshape(len(people), 2, 2, 3)
        low = np.maximum(feet * [1, 1, 0], [-np.inf, -np.inf, 0.005])
        for radius, level in CONTACT:
            radii_m = np.broadcast_to(radius * tall_m[:, None, None], low.shape[:3])
            blobs = self.view.outlines(low, radii_m)
            for foot in blobs.reshape(-1, 2, *blobs.shape[3:]):
                if np.isfinite(foot).all():
                    _fill(contact, foot, level)
        contact = cv2.subtract(cv2.GaussianBlur(contact, (0, 0), 1.5), self._things_cover)
        _darken(image, contact, (CONTACT_LIGHT,) * 3)
        if self.scene.sun is not None:
            for person, centres in zip(people, spheres, strict=True):
                hulls = [spheres for _, spheres in person.build.limbs]
                self._cast(shadow, centres, person.build.radii_m, hulls)
            shadow = cv2.subtract(cv2.GaussianBlur(shadow, (0, 0), 0.9), self._sunless)
            _darken(image, shadow, SHADOW_LIGHT)

    def _cast(self, mask: Image, centres: Floats, radii: Floats, hulls: list[list[int]]) -> None:
        """Fill where hulls of spheres (s, 3) keep the sun from the ground."""
        assert self.scene.sun is not None  # noqa: S101  (narrowing)
        outlines = self.view.shadows(centres, radii, self.scene.sun)
        for spheres in hulls:
            if np.isfinite(outlines[spheres]).all():
                _fill(mask, outlines[spheres])

    def _develop(self, image: Image, index: int, *, noise: bool) -> Image:
        """Return what lens, light and sensor make of a clean picture."""
        time_s = index / self.scene.settings.frame_rate
        waves = np.sin(2 * np.pi * time_s / np.array([41.0, 97.0]) + self._drift)
        gain = (1 + DRIFT * float(waves.mean())) ** (1 / 2.2)
        soft = cv2.GaussianBlur(image, (0, 0), LENS_BLUR_PX)
        if not noise:
            return np.asarray(cv2.multiply(soft, self._vignette, scale=1 / 255), np.uint8)
        level = cv2.multiply(soft, self._vignette, scale=gain / 255, dtype=cv2.CV_32F)
        random = np.random.default_rng((11, self.scene.look_seed, index))
        dy, dx = int(random.integers(97)), int(random.integers(131))
        grain = self._noise[dy : dy + image.shape[0], dx : dx + image.shape[1]]
        if random.integers(2):
            grain = grain[:, ::-1]
        spread = cv2.LUT(soft, _NOISE_BY_LEVEL)
        noisy = cv2.max(level + grain * (spread * np.float32(self._noisy)), 0)
        return np.asarray(cv2.convertScaleAbs(noisy), np.uint8)


_FEET = [i for i, name in enumerate(SPHERES) if name.endswith(("heel", "toe"))]
_NOISE_BY_LEVEL = np.sqrt(READ_NOISE**2 + PHOTON_NOISE**2 * np.arange(256)).astype(np.float32)


def _polygon(outlines: Floats) -> npt.NDArray[np.int32]:
    """Return the convex hull of points (s, k, 2) in OpenCV's fractions of a pixel."""
    points = np.clip(outlines.reshape(-1, 2), -2000, 20000) * (1 << _SHIFT)
    return np.asarray(cv2.convexHull(np.rint(points).astype(np.int32)), np.int32)


def _fill(mask: Image, outlines: Floats, level: int = 255) -> None:
    cv2.fillConvexPoly(mask, _polygon(outlines), (level,), cv2.LINE_AA, _SHIFT)


def _darken(image: Image, mask: Image, light: tuple[float, float, float]) -> None:
    """Scale the light where a mask is, in place."""
    x, y, width, height = cv2.boundingRect(mask)
    if width == 0:
        return
    part = image[y : y + height, x : x + width]
    cover = mask[y : y + height, x : x + width].astype(np.float32)[..., None] / 255
    part[...] = part * (1 - cover * (1 - np.array(light, np.float32)))


def _put(image: Image, patch: _Patch, cover: Image) -> None:
    """Lay a patch over the picture, in place."""
    part = image[patch.window]
    share = cover.astype(np.float32)[..., None] / 255
    part[...] = part + (patch.colour - part.astype(np.float32)) * share + 0.5


def _behind(patch: _Patch, cover: Image, other: _Patch) -> Image:
    """Return a patch's cover less what another patch, before it, covers."""
    height, width = cover.shape
    x0, y0 = max(patch.x0, other.x0), max(patch.y0, other.y0)
    x1 = min(patch.x0 + width, other.x0 + other.cover.shape[1])
    y1 = min(patch.y0 + height, other.y0 + other.cover.shape[0])
    if x0 >= x1 or y0 >= y1:
        return cover
    cut = cover.copy()
    mine = cut[y0 - patch.y0 : y1 - patch.y0, x0 - patch.x0 : x1 - patch.x0]
    front = other.cover[y0 - other.y0 : y1 - other.y0, x0 - other.x0 : x1 - other.x0]
    mine[...] = cv2.multiply(mine, cv2.bitwise_not(front), scale=1 / 255)
    return cut


def _vignette(height: int, width: int) -> Image:
    down, across = np.mgrid[-1 : 1 : height * 1j, -1 : 1 : width * 1j]
    light = 255 * (1 - 0.06 * (across**2 + down**2))
    return np.repeat(light[..., None], 3, axis=2).astype(np.uint8)
