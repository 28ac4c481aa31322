"""OpenCV's own thread count: one number for the whole process, set here and nowhere else.

Pass 1 decodes pictures in several Python threads, which keep the cores busy; OpenCV's threads inside of
each call would only get in their way, so the count is 1. A network that OpenCV itself runs is the
exception: all wait for its one picture at a time, so it has every core. Afterwards the count is as it was
found, as a program that calls this one may use OpenCV too.
"""

from __future__ import annotations

import os
from types import TracebackType

import cv2


class OpenCvThreads:
    """OpenCV held to one thread within a `with` block, unless its user asks for all cores."""

    def __enter__(self) -> OpenCvThreads:
        self._before = cv2.getNumThreads()
        cv2.setNumThreads(1)
        return self

    def use_all_cores(self) -> None:
        """Let OpenCV use every core until the block ends."""
        cv2.setNumThreads(os.cpu_count() or 1)

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        cv2.setNumThreads(self._before)
