"""Names of classes as recordings write them, and the one that the rest of the program knows.

Detectors write `person`, `Person`, `pedestrian`, `human` or `person 0.87`; sizes, tracks and truth go
by one name. A number is a class of a list that only the detector has: the camera file can name it.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import replace

from pipeline.core.config import Config
from pipeline.core.records import Frame

PERSON = "person"
# The class in the words of COCO, Open Images, Objects365, KITTI, Cityscapes, VisDrone, CrowdHuman, MOT.
PEOPLE = frozenset(
    (
        *("person", "persons", "people", "human", "humans", "pedestrian", "pedestrians", "walker"),
        *(
            "adult",
            "human person",
            "full body",
            "human body",
            "human full body",
            "person full body",
        ),
        *("adult pedestrian", "human pedestrian adult", "man", "woman"),
    )
)
# What drawings put behind a name: a score or the number of a track.
_BEHIND = re.compile(r"[\s:#(\[_-]*\d+(?:[.,]\d+)?\s*%?[)\]]?$")
_GAPS = re.compile(r"[\s_./-]+")


class ClassNames:
    """Translation of the names of one recording; each is translated once."""

    def __init__(self, config: Config) -> None:
        self._stated = {_plain(row.stated): row.object_class for row in config.class_name}
        classes = [*(p.object_class for p in config.size_prior), *config.detect.classes]
        classes += [c.object_class for c in config.calibration]
        self._known = {_plain(name): name for name in classes}
        self._found: dict[str, str] = {}
        self._untold: list[tuple[str, str]] = []

    def of(self, name: str) -> str:
        """Return the name that is used for a class."""
        if name not in self._found:
            self._found[name] = self._translated(name)
            if self._found[name] != name:
                self._untold.append((name, self._found[name]))
        return self._found[name]

    def in_frame(self, frame: Frame) -> Frame:
        """Return a frame whose boxes and truth have the names that are used."""
        found = frame.detections
        if found is not None and any(self.of(name) != name for name in set(found.class_name)):
            found = replace(found, class_name=tuple(map(self.of, found.class_name)))
            frame = replace(frame, detections=found)
        if any(self.of(true.class_name) != true.class_name for true in frame.truth):
            truth = tuple(replace(t, class_name=self.of(t.class_name)) for t in frame.truth)
            frame = replace(frame, truth=truth)
        return frame

    def told(self) -> Iterable[tuple[str, str]]:
        """Return the names that were translated since this was last asked, with what they became."""
        untold, self._untold = self._untold, []
        return untold

    def _translated(self, name: str) -> str:
        plain = _plain(name)
        bare = _plain(_BEHIND.sub("", name)) or plain
        for table in (self._stated, self._known):
            for candidate in (plain, bare):
                if candidate in table:
                    return table[candidate]
        return PERSON if {plain, bare} & PEOPLE else name


def _plain(name: str) -> str:
    return _GAPS.sub(" ", name).strip().casefold()
