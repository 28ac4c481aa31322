"""One family of errors: each says what is wrong, where, and what to do about it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True, slots=True)
class Where:
    """The place in the input that an error or a diagnostic speaks of; None is unknown."""

    path: Path | None = None
    topic: str | None = None
    byte_offset: int | None = None
    log_time_ns: int | None = None

    def __str__(self) -> str:
        parts = []
        if self.path is not None:
            parts.append(str(self.path))
        if self.topic is not None:
            parts.append(f"topic {self.topic!r}")
        if self.byte_offset is not None:
            parts.append(f"byte {self.byte_offset}")
        if self.log_time_ns is not None:
            parts.append(f"time {self.log_time_ns / 1e9:.6f} s")
        return ", ".join(parts)


NOWHERE = Where()


class StadimeterError(Exception):
    """Something a user can understand and act on.

    Args:
        problem: what is wrong, as a sentence without a full stop.
        where: file, topic, offset and time, as far as they are known.
        remedy: what the user can do, as a sentence without a full stop.
    """

    def __init__(self, problem: str, *, where: Where = NOWHERE, remedy: str = "") -> None:
        self.problem = problem
        self.where = where
        self.remedy = remedy
        super().__init__(str(self))

    def __str__(self) -> str:
        place = str(self.where)
        text = f"{place}: {self.problem}" if place else self.problem
        return f"{text}. {self.remedy}." if self.remedy else f"{text}."

    def __reduce__(self) -> tuple[object, ...]:
        # Errors cross process boundaries; keyword arguments do not survive the default pickling.
        return (_rebuild, (type(self), self.problem, self.where, self.remedy))


def _rebuild(
    kind: type[StadimeterError], problem: str, where: Where, remedy: str
) -> StadimeterError:
    return kind(problem, where=where, remedy=remedy)


class UsageError(StadimeterError):
    """The command line or a configuration file asks for something that does not exist."""


class UnusableModel(UsageError):
    """A network's file is no model, or not one whose answers can be understood."""


class NotARecording(StadimeterError):
    """The file is empty or no MCAP."""


class DamagedRecording(StadimeterError):
    """The file is an MCAP, but nothing of it can be read."""


class RecordingFailed(StadimeterError):
    """A recording cannot be processed, for an unexpected reason."""


class UnsupportedChannel(StadimeterError):
    """A channel holds the right kind of data in an encoding that is not read."""


class CalibrationUndetermined(StadimeterError):
    """The data do not determine the requested calibration."""


class StoreError(StadimeterError):
    """The database cannot be opened, read or written."""


class RowsRefused(StoreError):
    """The rows of one recording cannot be stored; other recordings can."""


class DiskRefused(StoreError):
    """The disk takes nothing more, or refuses; all other recordings would meet the same."""


class UndecodableImage(StadimeterError):
    """The bytes of a picture cannot be decoded, or claim more pixels than are allowed."""


class MissingLibrary(StadimeterError):
    """A library of an extra is not installed."""
