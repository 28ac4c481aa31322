"""The table of detectors: each row can be made, told and chosen."""

import subprocess
import sys

import pytest

from pipeline.cli.main import build_parser
from pipeline.core.config import CameraConfig, DetectConfig
from pipeline.core.errors import UsageError
from pipeline.detect import CHOICES, DETECTORS, DetectorRow, check_detector, make_detector

ROI = CameraConfig("c", roi_xyxy_px=(1.0, 2.0, 3.0, 4.0))


@pytest.mark.parametrize("row", [r for r in DETECTORS if not r.tried_first], ids=lambda r: r.name)
def test_a_row_is_made_by_its_name(row: DetectorRow) -> None:
    detector = make_detector(DetectConfig(method=row.name), ROI, recorded=False)
    assert detector.name == row.name
    assert not detector.runs_on_opencv


@pytest.mark.parametrize("row", [r for r in DETECTORS if r.tried_first], ids=lambda r: r.name)
def test_a_row_that_is_tried_first_says_what_it_lacks(row: DetectorRow) -> None:
    assert row.needs
    with pytest.raises(UsageError, match="needs") as caught:
        check_detector(DetectConfig(method=row.name))
    assert caught.value.remedy


def test_auto_prefers_the_recording_then_the_region_then_motion() -> None:
    made = [
        make_detector(DetectConfig(), camera, recorded).name
        for camera, recorded in ((ROI, True), (ROI, False), (CameraConfig("c"), False))
    ]
    assert made == ["recorded", "roi", "motion"]


def test_an_unknown_method_is_told_before_any_footage() -> None:
    with pytest.raises(UsageError, match="guess") as caught:
        check_detector(DetectConfig(method="guess"))
    assert all(name in str(caught.value) for name in CHOICES)
    with pytest.raises(UsageError, match="needs a model"):
        check_detector(DetectConfig(method="onnx"))
    check_detector(DetectConfig(method="roi"))  # a question of each camera


def test_the_command_line_offers_the_table() -> None:
    for name in CHOICES:
        arguments = build_parser().parse_args(["run", "a.mcap", "--detector", name])
        assert arguments.detector == name


def test_the_table_is_read_without_opencv() -> None:
    code = "import sys, pipeline.detect; print('cv2' in sys.modules, 'numpy' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["False", "False"]
