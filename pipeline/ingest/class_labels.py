"""Class names that a recording states for the numbers in its boxes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from pipeline.core.records import Boxes
from pipeline.ingest.lanes import shared_namespace
from pipeline.messages.content import ClassLabels


class StatedLabels:
    """Latest list of class names of each topic; a topic of boxes goes by the nearest one.

    Args:
        most: how many topics are kept.
    """

    def __init__(self, most: int) -> None:
        self._most = most
        self._of_topic: dict[str, Mapping[str, str]] = {}

    def add(self, topic: str, labels: ClassLabels) -> None:
        """Keep a list; a later one of the same topic replaces it."""
        if topic in self._of_topic or len(self._of_topic) < self._most:
            self._of_topic[topic] = labels.name_of

    def named(self, boxes: Boxes, topic: str) -> Boxes:
        """Return boxes whose numbers are replaced by the names that are stated for them."""
        if not self._of_topic or not boxes.class_name:
            return boxes
        nearest = max(self._of_topic, key=lambda other: shared_namespace(other, topic))
        names = self._of_topic[nearest]
        found = tuple(names.get(_number(stated), stated) for stated in boxes.class_name)
        return boxes if found == boxes.class_name else replace(boxes, class_name=found)


def _number(stated: str) -> str:
    """Return a class as lists write it: "0" for "00", " 0" and "0.0"."""
    plain = stated.strip().removesuffix(".0")
    return str(int(plain)) if plain.isdecimal() and len(plain) < 9 else plain
