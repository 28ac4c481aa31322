"""OpenCV's thread count has one owner, which leaves it as it was."""

import os
from pathlib import Path

import cv2
import pytest

from pipeline.parallel.opencv_threads import OpenCvThreads

ROOT = Path(__file__).parents[2]


def test_one_thread_inside_all_cores_when_asked_and_as_before_afterwards() -> None:
    before = cv2.getNumThreads()
    try:
        cv2.setNumThreads(3)
        with OpenCvThreads() as threads:
            assert cv2.getNumThreads() == 1
            threads.use_all_cores()
            assert cv2.getNumThreads() == (os.cpu_count() or 1)
        assert cv2.getNumThreads() == 3
        with pytest.raises(ValueError, match="inside"), OpenCvThreads():
            raise ValueError("inside")
        assert cv2.getNumThreads() == 3
    finally:
        cv2.setNumThreads(before)


def test_nothing_else_in_the_pipeline_sets_it() -> None:
    setting = [
        path.name
        for path in (ROOT / "pipeline").rglob("*.py")
        if "setNumThreads" in path.read_text()
    ]
    assert setting == ["opencv_threads.py"]
