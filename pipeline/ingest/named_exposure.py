"""Exposure values from the fields of other channels that a camera file names."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

from pipeline.core.exposure import FIELDS, Exposure, check_exposure
from pipeline.ingest.pairing import Lane, Paired
from pipeline.ingest.sources import Source
from pipeline.mcap_file.reader import MAX_TIME_NS, RawMessage
from pipeline.messages.named_numbers import NamedNumber
from pipeline.messages.tree import time_of

Pair = Callable[[Lane[float]], Paired[float] | None]


class NamedExposure:
    """The values of named fields by time, a lane each; `limit` bounds what waits in one."""

    def __init__(self, limit: int) -> None:
        self._limit = limit
        self._lanes: dict[str, dict[NamedNumber, Lane[float]]] = {}

    @property
    def found(self) -> set[tuple[str, str]]:
        """Names of entries and of their fields of which a value was read."""
        return {(name, number.field) for name, lanes in self._lanes.items() for number in lanes}

    def add(self, source: Source, raw: RawMessage) -> list[str]:
        """Keep the numbers of a message; return a sentence for each that is not there.

        Raises:
            UndecodableMessage: the bytes are no message of the channel.
        """
        assert source.reader is not None  # noqa: S101  (narrowing)
        tree = source.reader(raw.data)
        time_ns = time_of(tree)
        if time_ns is not None and not 0 < time_ns <= MAX_TIME_NS:
            time_ns = None
        absent = []
        for named, topic in source.named:
            value = named.value(tree, topic)
            if math.isnan(value):
                absent.append(f"{named.spec!r} holds no number")
                continue
            lanes = self._lanes.setdefault(named.camera, {})
            if named not in lanes:
                lanes[named] = Lane(topic, "", limit=self._limit)
            lanes[named].add(raw.log_time_ns, time_ns, value)
        return absent

    def fill(
        self, names: tuple[str, str], pair: Pair, found: Paired[Exposure] | None
    ) -> tuple[Paired[Exposure] | None, list[str]]:
        """Put the named values before those of an exposure message; return what was refused.

        Args:
            names: of the camera in the camera file: its own, or its topic.
            pair: gives the value of a lane that belongs to the picture.
            found: the exposure by messages.
        """
        lanes = self._lanes.get(names[0]) or self._lanes.get(names[1]) or {}
        paired = {named.field: p for named, lane in lanes.items() if (p := pair(lane))}
        if not paired:
            return found, []
        exposure, refused = check_exposure({name: p.value for name, p in paired.items()})
        farthest = max(paired.values(), key=lambda p: abs(p.offset_ns))
        value = filled(exposure, found.value) if found else exposure
        return Paired(value, farthest.pairing, farthest.offset_ns), refused


def filled(first: Exposure, second: Exposure) -> Exposure:
    """Return the first with what it leaves open from the second."""
    unknown = [n for n in FIELDS if math.isnan(getattr(first, n))]
    return replace(first, **{n: getattr(second, n) for n in unknown}) if unknown else first
