"""The region of interest on the recording `staff`: the width that the paper cropped by hand."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pipeline.core.config import CameraConfig, Config, DetectConfig
from pipeline.core.diagnostics import Notes
from pipeline.core.errors import UsageError
from pipeline.detect import make_detector
from pipeline.detect.roi import RoiDetector
from pipeline.images.decode import decode
from pipeline.ingest.frames import FrameAssembler
from pipeline.mcap_file.reader import McapFile

STAFF = Path(__file__).resolve().parents[2] / "recordings" / "staff.mcap"


def staff_frames() -> list:
    config, notes = Config(), Notes()
    return list(FrameAssembler(McapFile(STAFF, config.limits, notes.add), config.ingest, notes))


def test_it_finds_the_staffs_edges_to_a_fraction_of_a_pixel() -> None:
    detector = RoiDetector(CameraConfig("c", roi_xyxy_px=(375.0, 75.0, 1125.0, 625.0)))
    errors = []
    for frame in staff_frames():
        picture = decode(frame.image, max_pixels=10**8, full_resolution=True)
        found = detector.detect(frame, picture)
        assert len(found) == 1
        width = found.bbox_xyxy_px[0, 2] - found.bbox_xyxy_px[0, 0]
        crop = frame.detections.bbox_xyxy_px[0]
        errors.append(width - (crop[2] - crop[0]))
    assert np.abs(np.median(errors)) < 0.3
    assert np.abs(errors).max() < 1.5


def test_a_plain_region_holds_nothing() -> None:
    detector = RoiDetector(CameraConfig("c", roi_xyxy_px=(20.0, 60.0, 300.0, 300.0)))
    frame = staff_frames()[0]
    picture = decode(frame.image, max_pixels=10**8, full_resolution=True)
    assert len(detector.detect(frame, picture)) == 0
    assert len(detector.detect(frame, None)) == 0


def test_the_way_is_chosen_by_what_there_is() -> None:
    roi = CameraConfig("c", roi_xyxy_px=(0.0, 0.0, 9.0, 9.0))
    assert make_detector(DetectConfig(), roi, recorded=True).name == "recorded"
    assert make_detector(DetectConfig(), roi, recorded=False).name == "roi"
    assert make_detector(DetectConfig(), CameraConfig("c"), recorded=False).name == "motion"
    with pytest.raises(UsageError, match="roi_xyxy_px"):
        make_detector(DetectConfig(method="roi"), CameraConfig("c"), recorded=False)
    with pytest.raises(UsageError, match="guess"):
        make_detector(DetectConfig(method="guess"), CameraConfig("c"), recorded=False)
