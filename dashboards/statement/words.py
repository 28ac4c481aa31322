"""Sentences of a statement: method, limits, and the points of guidelines that it meets."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple


class Point(NamedTuple):
    """A point of a guideline, and how the statement meets it."""

    point: str
    met: str  # "yes", "partly", "no"
    how: str


METHOD = (
    "The camera does not move. A point on the ground that is seen in a given row and column of "
    "the picture "
    "has one distance from the camera, which follows from the camera's height above the "
    "ground, its tilt "
    "and its roll (its pose), and from its lens. The feet give the distance; the row of the "
    "head then "
    "gives the height. Lens distortion is taken out first.",
    "Every frame in which the person is seen gives one estimate. They are combined along the "
    "track: "
    "errors that differ from frame to frame average out, errors that all frames share do not, "
    "and are "
    "kept in full. People who walk are lower in the picture than when they stand; the height "
    "stated is "
    "that of the person standing, with shoes, as the top of the head (with hair or a cap) "
    "shows it.",
    "Intervals of 95 %: if all assumptions hold, the true value lies inside in 95 of 100 such "
    "cases.",
)
UNPOSED = (
    "The pose of the camera is not known. The distance follows from how large the person is in "
    "the picture, "
    "and from how tall people are: it is off by as much as this person differs from the mean."
)
POSES: Mapping[str, str] = {
    "walkers": "The pose was not measured. It was found from the people who walk through the picture: "
    "each of them is as tall far away as near by, which gives the tilt and the ratio of all "
    "heights to the "
    "camera's. The absolute scale rests on the mean stature of these people, or on a length "
    "that is known. "
    "If these people are on average taller or shorter than assumed, all heights and distances "
    "are off "
    "by the same share.",
    "given": "The pose was given by the user, as surveyed or measured on the spot. This statement does "
    "not check that survey, but for people of impossible stature.",
    "transforms": "The pose is what the recording itself states (its transforms). This statement does "
    "not check it, but for people of impossible stature.",
    "truth": "The pose was fitted to things whose size or distance is known.",
}
LIMITS = (
    "The ground is taken for one plane. On a slope, a kerb or stairs the interval does not hold.",
    "Posture counts: a bent neck or knee makes the measured height lower by centimetres. What "
    "is worn on "
    "the head and under the feet is part of the height.",
    "The boxes were set by a program, or by whoever made the recording. Look at the pictures "
    "above: the "
    "lines must lie on the top of the head and below the soles.",
    "The clock, the lens data and the identity of the track (that it is one person throughout) "
    "are as "
    "stated under Findings; nothing else speaks for them.",
    "A height does not identify a person. Many people are of one stature.",
)


def points(
    *,
    has_pictures: bool,
    pose: str,
    marked: bool,
    repeated: bool,
    references: int,
    file_checked: bool | None,
) -> list[Point]:
    """Return points that guidelines ask of a photogrammetric statement, and how this one meets them.

    The points follow SWGDE, Best Practices for the Forensic Use of Photogrammetry, and the ENFSI
    guidelines on evaluative reporting and on digital imaging, in our words.
    """
    checked = {True: "yes", False: "no", None: "partly"}[file_checked]
    return [
        Point("The question is stated", "yes", "Section 1"),
        Point(
            "The items examined are identified, and unaltered",
            checked,
            "Section 2: SHA-256 of the file as measured; "
            + (
                "the file was hashed again for this statement and is the same"
                if file_checked
                else "the file there now is another"
                if file_checked is False
                else "the file was not there to be hashed again"
            ),
        ),
        Point("The frames that were used are listed", "yes", "Section 8"),
        Point(
            "Pictures show the points that were measured",
            "yes" if has_pictures else "no",
            "Section 3" if has_pictures else "the recording could not be read",
        ),
        Point("Lens distortion is accounted for", "partly", "as far as the recording states it"),
        Point(
            "The scale rests on a measured length",
            "yes" if references or pose in ("given", "transforms", "truth") else "no",
            f"{references} reference marks of known length"
            if references
            else "the pose was given"
            if pose != "walkers"
            else "it rests on the mean stature of the people here; a known length replaces it",
        ),
        Point(
            "Measurements were repeated",
            "yes" if repeated or not marked else "no",
            "every frame is a measurement of its own" if not marked else "by the marks",
        ),
        Point("The uncertainty is stated, with its parts", "yes", "Sections 4 and 5"),
        Point("The method is published and its errors are known", "yes", "Section 9"),
        Point("It can be repeated", "yes", "Section 10: commands, version, settings"),
        Point("Another person has reviewed it", "no", "to be done by whoever hands it in"),
        Point(
            "The method was validated on this camera",
            "no",
            "compare with a person or thing of known height in the same place",
        ),
    ]
