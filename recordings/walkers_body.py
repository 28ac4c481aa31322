"""A walking body of known stature: spheres at the joints, whose hulls are the limbs.

Lengths are shares of the stature (Drillis and Contini 1966, as in Winter, Biomechanics and Motor
Control of Human Movement, fig. 4.1), thicknesses are chosen to look like a clothed person.

The feet are planted on the path and do not slip; the pelvis rides over them, the knees bend as far
as the legs need. Head and trunk rise and fall once a step and stay below standing height: 46 mm of
excursion at a usual step (Whittle, Gait Analysis), highest in midstance, a centimetre below standing
(Murray et al. 1964). The top of the skull's sphere is the stature of who stands upright.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]

ANKLE, KNEE, HIP, SHOULDER = 0.039, 0.285, 0.530, 0.800
UPPER_ARM, FOREARM = 0.186, 0.146
HIP_HALF, SHOULDER_HALF = 0.045, 0.098
STEP_HALF_WIDTH = 0.030  # of a foot beside the path
SEAT = 0.27  # height of the hips of who sits

USUAL_STEP_M = 0.73
BOB_M = 0.023  # of the head, either side of its mean, at a usual step
BELOW_STANDING_M = 0.010  # of the head at its highest

# name: (radius, grows with girth)
SPHERES: dict[str, tuple[float, bool]] = {
    "skull": (0.050, False),
    "hair": (0.047, False),
    "face": (0.041, False),
    "neck": (0.030, False),
    "chest": (0.062, True),
    "waist": (0.058, True),
    **{
        f"{side}_{joint}": radius
        for side in ("left", "right")
        for joint, radius in {
            "shoulder": (0.034, True),
            "elbow": (0.025, True),
            "wrist": (0.019, False),
            "hand": (0.022, False),
            "pelvis": (0.052, True),
            "hip": (0.046, True),
            "knee": (0.034, True),
            "ankle": (0.024, False),
            "heel": (0.021, False),
            "toe": (0.017, False),
        }.items()
    },
    "pack_high": (0.066, False),
    "pack_low": (0.072, False),
    "bag": (0.062, False),
    "bag_strap": (0.012, False),
}
INDEX = {name: i for i, name in enumerate(SPHERES)}
LIMBS: tuple[tuple[str, tuple[str, ...]], ...] = (
    ("skin", ("skull", "face")),
    ("hair", ("skull", "hair")),
    ("skin", ("face", "neck")),
    ("top", ("left_shoulder", "right_shoulder", "chest", "waist")),
    ("top", ("chest", "waist", "left_pelvis", "right_pelvis")),
    *(
        (colour, tuple(f"{side}_{joint}" for joint in joints))
        for side in ("left", "right")
        for colour, joints in (
            ("sleeve", ("shoulder", "elbow")),
            ("forearm", ("elbow", "wrist")),
            ("skin", ("wrist", "hand")),
            ("legs", ("hip", "knee")),
            ("legs", ("knee", "ankle")),
            ("shoes", ("ankle", "heel", "toe")),
        )
    ),
    ("pack", ("pack_high", "pack_low")),
    ("bag", ("bag",)),
    ("bag", ("bag", "bag_strap")),
)


@dataclass(frozen=True, slots=True)
class Build:
    """Build of a body: the proportions in which one person differs from another."""

    height_m: float  # standing, in shoes
    girth: float = 1.0
    runs: bool = False
    has_pack: bool = False
    has_bag: bool = False
    head_share: float = 1.0  # a child's head is larger for its height

    @property
    def radii_m(self) -> Floats:
        """Radii of the spheres, (s,)."""
        share = np.array([r * (self.girth if grows else 1.0) for r, grows in SPHERES.values()])
        for name in ("skull", "hair", "face"):
            share[INDEX[name]] *= self.head_share
        return np.asarray(share * self.height_m)

    @property
    def limbs(self) -> list[tuple[str, list[int]]]:
        """Colour and spheres of each limb that this body has."""
        left_out = [n for n, has in (("pack", self.has_pack), ("bag", self.has_bag)) if not has]
        return [(c, [INDEX[n] for n in names]) for c, names in LIMBS if c not in left_out]

    @property
    def drawn(self) -> list[int]:
        """The spheres that belong to a limb."""
        return sorted({i for _, spheres in self.limbs for i in spheres})

    def step_m(self, speed_m_s: float) -> float:
        """Return the length of a step: it grows with the root of the speed (Grieve 1968)."""
        scale = self.height_m / 1.70
        return float(
            (0.36 if self.runs else 0.62) * speed_m_s ** (0.8 if self.runs else 0.5) * scale
        )


@dataclass(frozen=True, slots=True)
class Path:
    """A line on the ground, straight or an arc, by the distance along it."""

    x_m: float
    y_m: float
    heading_rad: float
    curvature_per_m: float = 0.0

    def at(self, along_m: Floats) -> tuple[Floats, Floats]:
        """Return positions, (..., 2), and unit directions, (..., 2)."""
        turned = self.heading_rad + self.curvature_per_m * along_m
        direction = np.stack([np.cos(turned), np.sin(turned)], axis=-1)
        # an arc is its chord: 2 sin(k s / 2) / k along the mean of the two directions
        half = self.curvature_per_m * along_m / 2
        chord_m = along_m * np.sinc(half / np.pi)
        middle = self.heading_rad + half
        x_m, y_m = self.x_m + chord_m * np.cos(middle), self.y_m + chord_m * np.sin(middle)
        return np.stack([x_m, y_m], axis=-1), direction


def pose(
    build: Build, path: Path, along_m: Floats, speed_m_s: Floats, step_m: float, sits: Floats
) -> Floats:
    """Return the centres of the spheres in the world, (t, s, 3): x right, y ahead, z up.

    Args:
        build: the body.
        path: where it walks.
        along_m: how far along the path it is, (t,).
        speed_m_s: how fast, (t,); below a stroll the feet come together.
        step_m: length of a step.
        sits: from 0, upright, to 1, seated, (t,).
    """
    tall_m = build.height_m
    moving = np.clip(speed_m_s / (1.2 if build.runs else 0.5), 0.0, 1.0)
    ground, forward = path.at(along_m)
    frame = _Frame(ground, forward)
    bob_m = _bob(build, along_m, step_m, moving)
    lean = (0.16 if build.runs else 0.03) * moving + 0.12 * sits
    back_m = -0.24 * tall_m * sits
    pelvis_m = (HIP * (1 - sits) + SEAT * sits) * tall_m + bob_m

    centres = np.empty((len(along_m), len(SPHERES), 3))

    def trunk(share_up: float, ahead: float = 0.0, left: float = 0.0) -> Floats:
        """Return a point of the leaning trunk, this share of the stature above the ground."""
        up_m = (share_up - HIP) * tall_m
        ahead_m = back_m + up_m * np.sin(lean) + ahead * tall_m
        return frame.point(ahead_m, left * tall_m, pelvis_m + up_m * np.cos(lean))

    def put(name: str, point: Floats) -> None:
        centres[:, INDEX[name]] = point

    skull = SPHERES["skull"][0] * build.head_share
    put("skull", trunk(1 - skull))
    put("hair", trunk(1 - skull - 0.014, ahead=-0.012))
    put("face", trunk(1 - 2.05 * skull, ahead=0.012))
    put("neck", trunk(0.838))
    put("chest", trunk(0.735, ahead=0.004))
    put("waist", trunk(0.620))
    put("pack_high", trunk(0.755, ahead=-0.085))
    put("pack_low", trunk(0.665, ahead=-0.090))
    for side, left, offset in (("left", 1.0, 0.0), ("right", -1.0, 0.5)):
        foot, pitch, lead = _foot(build, path, along_m, step_m, offset, left, moving)
        hip = trunk(HIP, left=left * HIP_HALF)
        ankle = _put_foot(put, side, foot, pitch, tall_m)
        put(f"{side}_pelvis", trunk(0.550, left=left * HIP_HALF))
        put(f"{side}_hip", hip)
        put(f"{side}_knee", _knee(hip, ankle, frame, tall_m))
        shoulder = trunk(SHOULDER, left=left * SHOULDER_HALF)
        put(f"{side}_shoulder", shoulder)
        swing = -(0.75 if build.runs else 0.55) * lead + 0.03 + 0.5 * sits
        bend = (1.5 if build.runs else 0.25) + 0.3 * np.maximum(swing, 0) + 0.9 * sits
        elbow = shoulder + UPPER_ARM * tall_m * frame.direction(swing, 0.14 * left)
        wrist = elbow + FOREARM * tall_m * frame.direction(swing + bend, -0.05 * left)
        put(f"{side}_elbow", elbow)
        put(f"{side}_wrist", wrist)
        put(f"{side}_hand", wrist + 0.045 * tall_m * frame.direction(swing + bend, 0.0))
    hand = centres[:, INDEX["left_hand"]]
    put("bag_strap", hand)
    put("bag", hand - np.array([0, 0, 0.11 * tall_m]))
    return centres


@dataclass(frozen=True, slots=True)
class _Frame:
    """The walker's own axes: ahead, left and up from a place on the ground."""

    ground: Floats  # (t, 2)
    forward: Floats  # (t, 2)

    def point(self, ahead_m: Floats | float, left_m: Floats | float, up_m: Floats) -> Floats:
        across = np.stack([-self.forward[:, 1], self.forward[:, 0]], axis=1)
        flat = (
            self.ground
            + self.forward * np.reshape(ahead_m, (-1, 1))
            + across * np.reshape(left_m, (-1, 1))
        )
        return np.concatenate([flat, np.reshape(up_m, (-1, 1))], axis=1)

    def direction(self, angle: Floats, left: float) -> Floats:
        """Return unit vectors that hang down at 0 and point ahead at a right angle."""
        across = np.stack([-self.forward[:, 1], self.forward[:, 0]], axis=1)
        flat = self.forward * np.sin(angle)[:, None] + left * across
        vector = np.concatenate([flat, -np.cos(angle)[:, None]], axis=1)
        return np.asarray(vector / np.linalg.norm(vector, axis=1, keepdims=True))


def _bob(build: Build, along_m: Floats, step_m: float, moving: Floats) -> Floats:
    """Return the height of the trunk above that of a standing person: negative, except when running."""
    usual = USUAL_STEP_M * build.height_m / 1.70
    high_m = BOB_M * build.height_m / 1.70 * min((step_m / usual) ** 2, 2.0)
    phase = np.cos(2 * np.pi * along_m / step_m)  # 1 in midstance
    if build.runs:
        return moving * (-0.045 - 0.040 * phase) * build.height_m / 1.70
    return np.asarray(moving * (high_m * (phase - 1) - BELOW_STANDING_M))


def _foot(
    build: Build,
    path: Path,
    along_m: Floats,
    step_m: float,
    offset: float,
    left: float,
    moving: Floats,
) -> tuple[_Frame, tuple[Floats, Floats], Floats]:
    """Return where a foot is, its pitch and lift, and how far it leads the body, in steps."""
    duty = 0.36 if build.runs else 0.62
    cycle = along_m / (2 * step_m) - offset + duty / 2
    planted, phase = np.floor(cycle), cycle % 1.0
    swing = np.clip((phase - duty) / (1 - duty), 0.0, 1.0)
    gone = swing - np.sin(2 * np.pi * swing) / (2 * np.pi)
    foot_m = (planted + offset + gone) * 2 * step_m
    foot_m = moving * foot_m + (1 - moving) * (along_m + 0.015 * left * build.height_m)
    stance = np.clip(phase / duty, 0.0, 1.0)
    push = 0.75 * np.clip((stance - 0.6) / 0.4, 0, 1) ** 2
    strike = -0.30 * np.clip(1 - stance / 0.15, 0, 1)
    back = 0.75 + (-0.30 - 0.75) * (1 - np.cos(np.pi * swing)) / 2
    pitch = np.where(swing > 0, back, push + strike) * moving
    lift_m = (0.22 if build.runs else 0.035) * build.height_m * np.sin(np.pi * swing) ** 2 * moving
    ground, forward = path.at(foot_m)
    across = np.stack([-forward[:, 1], forward[:, 0]], axis=1)
    beside = ground + left * STEP_HALF_WIDTH * (2 - moving)[:, None] * build.height_m * across
    return _Frame(beside, forward), (pitch, lift_m), (foot_m - along_m) / step_m


def _put_foot(
    put: object, side: str, foot: _Frame, motion: tuple[Floats, Floats], tall_m: float
) -> Floats:
    """Place ankle, heel and toe; heel up, the foot turns about the toe, toe up about the heel."""
    pitch, lift_m = motion
    heel_up, toe_up = SPHERES["left_heel"][0], SPHERES["left_toe"][0]
    pivot_ahead = np.where(pitch > 0, 0.100, -0.020) * tall_m
    pivot_up = np.where(pitch > 0, toe_up, heel_up) * tall_m
    cos, sin = np.cos(pitch), np.sin(pitch)
    ankle = None
    for name, ahead, up in (
        ("toe", 0.100, toe_up),
        ("heel", -0.020, heel_up),
        ("ankle", 0.0, ANKLE),
    ):
        a, b = ahead * tall_m - pivot_ahead, up * tall_m - pivot_up
        point = foot.point(
            pivot_ahead + a * cos + b * sin, 0.0, pivot_up - a * sin + b * cos + lift_m
        )
        put(f"{side}_{name}", point)  # type: ignore[operator]
        ankle = point
    assert ankle is not None  # noqa: S101  (narrowing)
    return ankle


def _knee(hip: Floats, ankle: Floats, frame: _Frame, tall_m: float) -> Floats:
    """Return the knee of a thigh and a shank that join hip and ankle, bent forward."""
    thigh, shank = (HIP - KNEE) * tall_m, (KNEE - ANKLE) * tall_m
    leg = ankle - hip
    far = np.linalg.norm(leg, axis=1, keepdims=True)
    reach = np.clip(far, 0.3 * (thigh + shank), None)
    down = (thigh**2 - shank**2 + reach**2) / (2 * reach)
    # a leg that cannot quite reach is straight, and divided as it is when it stands
    down = np.where(reach >= thigh + shank, reach * thigh / (thigh + shank), down)
    out = np.sqrt(np.clip(thigh**2 - down**2, 0.0, None))
    out = np.where(reach >= thigh + shank, 0.0, out)
    ahead = np.concatenate([frame.forward, np.zeros((len(hip), 1))], axis=1)
    along = leg / far
    ahead = ahead - along * (ahead * along).sum(axis=1, keepdims=True)
    ahead /= np.linalg.norm(ahead, axis=1, keepdims=True)
    return np.asarray(hip + along * down + ahead * out)
