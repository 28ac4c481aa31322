"""Quality of observations: what hides them, what cuts them, and what they cannot be.

Nothing is dropped. A bad end of a box gets a wider standard deviation, so that every method weighs it
less, and the reason is kept as a flag. Two looks, each over all observations of a camera at once:

1. `assess`: at the boxes alone. The box of a nearer object (its feet are lower in the picture) covers the
   feet or the head; the picture's edge cuts them; the shape is not that of one upright person; the box is
   shorter or taller than the rest of its track says (`pipeline.estimate.boxes.outliers`).
2. `against_track`: at the height that the ground gives in each frame, beside the height of its track.
   Too small, and the feet are hidden behind something that has no box (a wall, a car); too tall, and
   somebody else is in the box.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
import pyarrow as pa

from pipeline.core.arrays import FloatArray
from pipeline.core.robust import MAD_TO_STD, MEDIAN_EFFICIENCY
from pipeline.core.tables import OBSERVATION_QUALITY
from pipeline.estimate.boxes.error_correlation import independent_share
from pipeline.estimate.boxes.gait_phase import stride_phase_rad
from pipeline.estimate.boxes.outliers import goes_with_track, height_off_px
from pipeline.estimate.by_track import median_by
from pipeline.estimate.gait import GAIT_STD_M, WALKER
from pipeline.estimate.types import BoolArray, Measured

# The feet, and the head, are somewhere in the middle half of the box's width.
SPAN = 0.5
# Feet that are level within this share of the box's height belong to people side by side: the feet of a
# stride are as far apart.
LEVEL = 0.05
BEHIND = 0.15  # of a box's height, reached behind a nearer one: not drawn around what is seen
COVERED = 0.5  # of that span: the end cannot be seen
# The end of somebody hidden is anywhere between what is seen and what hides it: uniform on one side.
ONE_SIDED = 3**-0.5
# The gait alone moves a box's ends by about this share of its height, so no box is better than that.
BEST_STD = 0.01
# An upright person is 2 to 4.5 times as tall as wide; a stride, a bag or a bicycle makes it less.
PERSON_ASPECT = (1.25, 6.0)
# Feet together and feet apart change the width of one walker by up to a factor of two.
ASPECT_CHANGE = 2.0
# A frame's height is compared with its track's only if so many frames show the track whole.
MIN_WHOLE = 8
HIDDEN, NOT_ALONE = -3.0, 3.0  # standard deviations of a frame's height from its track's
TAILS = 2.5  # farther from the median than this, a frame is not asked for it again
REJECTIONS = 2
CLEAR_OCCLUSION = 0.05  # of a box, by other boxes


@dataclass(frozen=True, slots=True)
class Quality:
    """Quality of each observation, (n,) each.

    `quality` is the weight that the worse end of the box has, beside that of the same box with nothing
    wrong: 1 for that, 0 where an end is cut off.
    """

    quality: FloatArray
    contact_visible: BoolArray
    head_visible: BoolArray
    aspect_plausible: BoolArray
    alone: BoolArray
    stride_phase_rad: FloatArray
    std_xyxy_px: FloatArray  # (n, 4) of the box's sides, widened

    @property
    def ends_visible(self) -> BoolArray:
        """True for a box whose head and feet are seen, and are of one and the same, (n,)."""
        return np.asarray(self.contact_visible & self.head_visible & self.alone)

    def applied(self, measured: Measured) -> Measured:
        """Return the observations with the deviations that they deserve."""
        return replace(measured, std_xyxy_px=self.std_xyxy_px)

    def table(self, measured: Measured) -> pa.Table:
        """Return the rows of the table `observation_quality`."""
        columns = {name: getattr(self, name) for name in OBSERVATION_QUALITY.names[1:]}
        columns["observation_index"] = measured.observation_index
        arrays = [
            pa.array(columns[f.name], type=f.type, from_pandas=True) for f in OBSERVATION_QUALITY
        ]
        return pa.Table.from_arrays(arrays, schema=OBSERVATION_QUALITY)


@dataclass(frozen=True, slots=True)
class AgainstTrack:
    """Each observation beside its own track, (n,) each."""

    height_m: FloatArray  # of the track, as it is seen; NaN where too few frames show it whole
    height_std_m: FloatArray
    off: FloatArray  # the frame's height from the track's, in standard deviations; NaN unknown

    @property
    def hidden(self) -> BoolArray:
        """True for a box whose feet are hidden, (n,)."""
        return np.asarray(self.off < HIDDEN)

    @property
    def crowded(self) -> BoolArray:
        """True for a box that holds another person too, (n,)."""
        return np.asarray(self.off > NOT_ALONE)


def assess(m: Measured) -> Quality:
    """Return what the boxes alone tell."""
    box = m.bbox_xyxy_px
    tall_px = np.maximum(box[:, 3] - box[:, 1], 0.0)
    cover, reach_px = _covered(m, tall_px)
    cover = np.where(_drawn_whole(m, cover, reach_px, tall_px)[:, None], 0.0, cover)
    visible = cover < COVERED
    whole: BoolArray = np.asarray(~m.truncated.any(axis=1) & visible.all(axis=1))
    odd = _odd_aspect(m, whole)
    # As much as the shape is off, so much of the height may belong to something else.
    odd_px = tall_px * (1 - np.exp(-odd))
    off_px = height_off_px(m, whole)
    # Feet are missing from a box that is too short; what is too much may be at either end.
    off_ends_px = np.stack([np.abs(off_px), np.maximum(off_px, 0.0)], axis=1)
    extra_px = np.hypot(ONE_SIDED * np.hypot(cover * reach_px, odd_px[:, None]), off_ends_px)
    std_px = m.std_xyxy_px.copy()
    std_px[:, [3, 1]] = np.hypot(std_px[:, [3, 1]], extra_px)
    best_px = np.hypot(m.std_xyxy_px[:, [3, 1]], BEST_STD * tall_px[:, None])
    cut = m.truncated[:, [3, 1]]
    with np.errstate(invalid="ignore", divide="ignore"):
        weight = np.where(cut, 0.0, 1.0 / (1.0 + (extra_px / best_px) ** 2))
    return Quality(
        quality=np.nan_to_num(weight, nan=1.0).min(axis=1, initial=1.0),
        contact_visible=np.asarray(visible[:, 0] & ~cut[:, 0] & (off_px >= 0)),
        head_visible=np.asarray(visible[:, 1] & ~cut[:, 1]),
        aspect_plausible=np.asarray(odd == 0),
        alone=np.asarray(off_px <= 0),
        stride_phase_rad=stride_phase_rad(m),
        std_xyxy_px=std_px,
    )


def against_track(
    m: Measured,
    height_m: FloatArray,
    height_noise_m: FloatArray,
    quality: Quality | None = None,
    correlation_s: FloatArray | None = None,
) -> AgainstTrack:
    """Compare the height in each frame with the median of the frames that show the track whole.

    Args:
        m: the observations.
        height_m: by the ground, as it is seen in each frame, (n,).
        height_noise_m: standard deviation of what differs from frame to frame, (n,).
        quality: what the boxes alone tell; `assess(m)` where it is left out.
        correlation_s: how long errors last, (n,), where their tracks tell it.
    """
    found = assess(m) if quality is None else quality
    whole = np.isfinite(height_m) & (m.occlusion < CLEAR_OCCLUSION)
    whole &= found.ends_visible & found.aspect_plausible
    noise_m = np.hypot(height_noise_m, GAIT_STD_M)
    off = np.zeros(len(m))
    for _ in range(REJECTIONS):
        # What is off is all on one side, and draws the median there.
        chosen = pd.Series(np.where(whole & (np.abs(off) < TAILS), height_m, np.nan))
        by_track = chosen.groupby(m.track_id)
        count = by_track.transform("count").to_numpy(dtype=np.float64)
        middle_m = by_track.transform("median").to_numpy(dtype=np.float64)
        with np.errstate(invalid="ignore"):
            off = np.nan_to_num((height_m - middle_m) / noise_m)
    spread_m = MAD_TO_STD * median_by(m.track_id, np.abs(chosen.to_numpy() - middle_m))
    independent = np.maximum(count * independent_share(m, correlation_s), 1.0)
    std_m = np.sqrt(MEDIAN_EFFICIENCY) * np.maximum(spread_m, GAIT_STD_M) / np.sqrt(independent)
    middle_m = np.where(count >= MIN_WHOLE, middle_m, np.nan)
    with np.errstate(invalid="ignore"):
        off = (height_m - middle_m) / noise_m
    return AgainstTrack(middle_m, std_m, off)


def with_track(quality: Quality, track: AgainstTrack) -> Quality:
    """Return the quality with what the track's height tells as well."""
    bad = track.hidden | track.crowded
    off = np.where(bad, np.abs(track.off), NOT_ALONE)
    return replace(
        quality,
        quality=quality.quality * (NOT_ALONE / off) ** 2,
        contact_visible=quality.contact_visible & ~track.hidden,
        alone=quality.alone & ~track.crowded,
    )


def _drawn_whole(
    m: Measured, cover: FloatArray, reach_px: FloatArray, tall_px: FloatArray
) -> BoolArray:
    """Return which covered boxes are of all of a person nevertheless, (n,).

    Such a box goes on behind the nearer one, and is as tall as its track says. Were its ends not seen,
    its height would change with what hides them; a box that is drawn around what is seen ends where the
    nearer one begins.
    """
    uncut = ~m.truncated[:, [1, 3]].any(axis=1)
    clear = (cover < COVERED).all(axis=1)
    behind = (cover[:, 0] == 0) | (reach_px[:, 0] > BEHIND * tall_px)
    covered = (cover > 0).any(axis=1) & behind
    return np.asarray(covered & goes_with_track(m, uncut & (clear | behind)))


def _covered(m: Measured, tall_px: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the share of feet and head that nearer boxes cover, (n, 2), and how far that reaches.

    Rows are sorted by frame and compared with the next, the next but one, and so on, as long as these are
    of the same frame: each step is one pass over all frames.
    """
    index, frame, box = m.observation_index, m.frame_index, m.bbox_xyxy_px
    if m.others is not None:
        index = np.concatenate([index, m.others.observation_index])
        frame = np.concatenate([frame, m.others.frame_index])
        box = np.concatenate([box, m.others.bbox_xyxy_px])
        tall_px = np.maximum(box[:, 3] - box[:, 1], 0.0)
    cover, reach_px = np.zeros((len(box), 2)), np.zeros((len(box), 2))
    order = np.lexsort((index, frame))
    frame, left, right = frame[order], box[:, 0], box[:, 2]
    for step in range(1, len(box)):
        same = np.flatnonzero(frame[step:] == frame[:-step])
        if not len(same):
            break
        one, other = order[same], order[same + step]
        beside = np.minimum(right[one], right[other]) > np.maximum(left[one], left[other])
        one, other = one[beside], other[beside]
        for behind, before in ((one, other), (other, one)):
            share, reach = _cover(box[behind], box[before], tall_px[behind])
            worse = share > cover[behind]
            cover[behind] = np.where(worse, share, cover[behind])
            reach_px[behind] = np.where(worse, reach, reach_px[behind])
    return cover[: len(m)], reach_px[: len(m)]


def _cover(
    behind: FloatArray, before: FloatArray, tall_px: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return what of feet and head a box covers of another, (n, 2), and how far in pixels."""
    x0, y0, x1, y1 = behind.T
    left, top, right, bottom = before.T
    middle, half = (x0 + x1) / 2, np.maximum(SPAN * (x1 - x0) / 2, 1e-9)
    shared = np.minimum(middle + half, right) - np.maximum(middle - half, left)
    share = np.clip(shared / (2 * half), 0.0, 1.0)
    level_px = LEVEL * tall_px
    nearer = bottom > y1 + level_px
    # A box drawn around what is seen ends where the nearer one begins; one drawn around all of a person
    # goes on behind it. Either way the feet are between there and the nearer one's.
    feet = nearer & (top <= y1 + level_px)
    head = nearer & (top <= y0 + level_px)
    feet_px = np.maximum(y1 - np.maximum(top, y0), bottom - y1)
    reach = np.stack([np.clip(feet_px, 0.0, tall_px), tall_px], axis=1)
    return np.stack([np.where(feet, share, 0.0), np.where(head, share, 0.0)], axis=1), reach


def _odd_aspect(m: Measured, whole: BoolArray) -> FloatArray:
    """Return by how much, on a log scale, each shape is outside what it can be, (n,); 0 if it is not."""
    width_px = m.bbox_xyxy_px[:, 2] - m.bbox_xyxy_px[:, 0]
    tall_px = m.bbox_xyxy_px[:, 3] - m.bbox_xyxy_px[:, 1]
    known = whole & (width_px > 0) & (tall_px > 0)
    aspect = np.full(len(m), np.nan)
    aspect[known] = np.log(tall_px[known] / width_px[known])
    usual = median_by(m.track_id, aspect)
    low, high = np.log(PERSON_ASPECT)
    person = m.class_name == WALKER
    with np.errstate(invalid="ignore"):
        changed = np.abs(aspect - usual) - np.log(ASPECT_CHANGE)
        unlike = np.where(person, np.maximum(low - aspect, aspect - high), 0.0)
    return np.maximum(np.nan_to_num(np.fmax(changed, unlike)), 0.0)
