"""Test of whether the tracks that a pose was fitted to are of people who walk.

A motion detector calls every upright box a person, and cars on a road fit a plane with one common height
as well as people do: the fit alone cannot tell. Two things do, and neither needs the scale:

- speed, in statures a second: nobody walks faster than 2.5 m/s, which cars and bicycles exceed;
- proportions: the box of a body that walks is at most 0.6 of its height wide, seen from the side.

And somebody must walk: things that never move (bottles on a belt that stands, poles, a hedge in the wind)
are not people because they are upright. Those who stand are welcome beside those who walk.

A track is unlike a walker by either. The pose is refused if most tracks that move are: a few cyclists do
not spoil it, and walkers among more cars than people cannot be told apart here.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import pandas as pd

from pipeline.core.arrays import FloatArray
from pipeline.core.errors import CalibrationUndetermined
from pipeline.core.records import GroundPlane
from pipeline.estimate.boxes.geometry import Geometry
from pipeline.estimate.types import Measured
from pipeline.optics.ground_plane import foot_depth_m, ground_position_m, remove_roll

# The fastest walk is about 2.5 m/s; people prefer to run from 2.1 m/s on (Hreljac 1993, Med. Sci. Sports
# Exerc. 25, 1158), and walk freely at 1.34 +- 0.26 m/s (Weidmann 1993, Transporttechnik der Fussgaenger).
FASTEST_WALK_M_S = 2.5
# Adults of all countries are 1.49 to 1.83 m tall in the mean (NCD-RisC 2016, eLife 5:e13410); the speeds
# are of Europeans.
STATURE_M = 1.7
FASTEST_WALK = FASTEST_WALK_M_S / STATURE_M  # statures a second
# Old people who are ill walk at 0.5 m/s (Studenski et al. 2011, JAMA 305, 50: the slowest group is below
# 0.4); what is slower stands. Of those who stand it is not known that they are people.
SLOWEST_WALK = 0.5 / STATURE_M
MIN_WALKERS = 2
# A step at free speed is 0.42 of the stature (Whittle, Gait Analysis: stride of men 1.46 m), a foot 0.152
# (Drillis and Contini 1966, NYU report 1166-03): the feet reach over 0.57 when farthest apart. The
# median over a track is below it; arms and a bag may add what the half-open stride leaves.
WIDEST = 0.6  # of the stature
# From above a body is less tall in the picture, at least by its depth: 0.15 of the stature (the same).
BODY_DEPTH = 0.15
MIN_OBSERVATIONS = 8
MIN_SPAN_S = 0.4  # a speed over less is that of the boxes' noise
REMEDY = (
    "No pose is made of them. Give camera_height_m and tilt_deg in a camera file, or detect people with "
    "a network"
)
MOST = 0.5  # of the tracks that move
MIN_TRACKS = 4


class NotWalkers(CalibrationUndetermined):
    """The tracks that a pose would rest on are not of people who walk."""


@dataclass(frozen=True, slots=True)
class Likeness:
    """Likeness of tracks to walkers, (k,) each; speed in statures a second, NaN is unknown."""

    speed: FloatArray
    aspect: FloatArray  # width over height of the box
    widest: FloatArray  # that a walker seen from there may have
    of_ground: bool  # whether speeds are those on the ground, and not only in the picture

    @property
    def too_fast(self) -> npt.NDArray[np.bool_]:
        """True for tracks that are faster than anybody walks, (k,)."""
        return np.asarray(self.speed > FASTEST_WALK)

    @property
    def too_wide(self) -> npt.NDArray[np.bool_]:
        """True for tracks that are wider than a body, (k,)."""
        return np.asarray(self.aspect > self.widest)

    def check(self) -> None:
        """Refuse tracks most of which are not of people who walk.

        Raises:
            NotWalkers: they are faster or wider than people are, or nobody walks.
        """
        count = len(self.speed)
        if (
            self.of_ground
            and count >= MIN_TRACKS
            and (self.speed > SLOWEST_WALK).sum() < MIN_WALKERS
        ):
            raise NotWalkers(
                f"of {count} tracks that the camera's pose would rest on, fewer than {MIN_WALKERS} "
                f"move as fast as a slow walk, {SLOWEST_WALK:.1f} body heights a second",
                remedy=REMEDY,
            )
        fast, wide = self.too_fast, self.too_wide
        unlike = fast | wide
        # What stands speaks for nobody: neither for cars at a light nor for people at a stop.
        speak = (self.speed > SLOWEST_WALK) | wide
        if unlike.sum() < MIN_TRACKS or unlike.sum() <= MOST * speak.sum():
            return
        raise NotWalkers(
            f"{unlike.sum()} of the {speak.sum()} moving tracks that the camera's pose would rest on are "
            f"not of people who walk: {fast.sum()} are faster than {FASTEST_WALK:.1f} body heights a "
            f"second (half of all exceed {np.nanmedian(self.speed):.1f}), {wide.sum()} are wider than a "
            f"person (half of all are wider than {np.nanmedian(self.aspect):.2f} of their height)",
            remedy=REMEDY,
        )


def likeness_of(
    measured: Measured, object_class: str, plane: GroundPlane | None = None
) -> Likeness:
    """Return how much the tracks of a class are like walkers.

    Without a pose, or without a lens, the speed is that in the picture in box heights, which is a lower
    limit of the true one, and nothing is said of widths: how steeply the camera looks is unknown.

    Args:
        measured: observations of one camera.
        object_class: those that are taken for people.
        plane: the pose, if there is one.
    """
    box = measured.bbox_xyxy_px
    tall_px, wide_px = box[:, 3] - box[:, 1], box[:, 2] - box[:, 0]
    use = (measured.class_name == object_class) & ~measured.truncated.any(axis=1) & (tall_px > 0)
    use &= measured.occlusion < 0.05  # as for the fit (`sample_of`)
    posed = plane is not None and measured.intrinsics is not None
    right, ahead, below_rad = (
        _on_the_ground(measured, plane) if posed else _in_the_picture(measured)
    )
    error = np.hypot(measured.std_xyxy_px[:, 0], measured.std_xyxy_px[:, 2]) / tall_px
    shorter = np.cos(below_rad) + BODY_DEPTH * np.sin(below_rad)
    columns = {
        "track": measured.track_id,
        "time_s": (measured.capture_time_ns - measured.capture_time_ns.min()) / 1e9,
        "right": right,
        "ahead": ahead,
        "aspect": wide_px / tall_px,
        "widest": WIDEST / shorter + error if posed else np.full(len(measured), np.inf),
    }
    rows = pd.DataFrame(columns)[use & np.isfinite(right) & np.isfinite(ahead)]
    groups = rows.groupby("track")
    span_s = groups["time_s"].max() - groups["time_s"].min()
    enough = (groups.size() >= MIN_OBSERVATIONS) & (span_s > MIN_SPAN_S)
    rows = rows[rows["track"].isin(enough.index[enough])]
    middle = rows.groupby("track")[["aspect", "widest"]].median()
    return Likeness(_speeds(rows), middle["aspect"].to_numpy(), middle["widest"].to_numpy(), posed)


def check_walkers(measured: Measured, object_class: str, plane: GroundPlane | None = None) -> None:
    """Refuse tracks most of which are not of people who walk, as `Likeness.check` does."""
    if len(measured):
        likeness_of(measured, object_class, plane).check()


def _in_the_picture(measured: Measured) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the places of boxes in units of their own track's height, and no angle."""
    box = measured.bbox_xyxy_px
    typical = pd.Series(box[:, 3] - box[:, 1]).groupby(measured.track_id).transform("median")
    tall = np.where(typical > 0, typical, np.nan)
    return (box[:, 0] + box[:, 2]) / 2 / tall, box[:, 3] / tall, np.zeros(len(measured))


def _on_the_ground(
    measured: Measured, plane: GroundPlane | None
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the places of feet in statures, and how far below the horizon they are seen."""
    assert plane is not None  # noqa: S101  (narrowing)
    foot = remove_roll(Geometry.of(measured).foot, plane.roll_rad)
    depth_m = foot_depth_m(plane.camera_height_m, plane.tilt_rad, foot[:, 1])
    right_m, ahead_m = ground_position_m(depth_m, foot[:, 0], foot[:, 1], plane.tilt_rad)
    below_rad = np.clip(plane.tilt_rad + np.arctan(foot[:, 1]), 0.0, np.pi / 2)
    return right_m / STATURE_M, ahead_m / STATURE_M, below_rad


def _speeds(rows: pd.DataFrame) -> FloatArray:
    """Return the speed of each track along the straight line through its places, (k,)."""
    groups = rows.groupby("track")
    time_s = rows["time_s"] - groups["time_s"].transform("mean")
    spread = (time_s**2).groupby(rows["track"]).sum()
    along = [
        ((rows[axis] - groups[axis].transform("mean")) * time_s).groupby(rows["track"]).sum()
        / spread
        for axis in ("right", "ahead")
    ]
    return np.hypot(along[0].to_numpy(), along[1].to_numpy())
