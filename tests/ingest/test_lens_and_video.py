"""Lens data from recording and camera file, and a video that becomes a recording."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from pipeline.core.config import CameraConfig, Config, ExposureFields
from pipeline.core.errors import UsageError
from pipeline.core.exposure import UNKNOWN_EXPOSURE
from pipeline.core.lens import (
    Lens,
    fit_to_picture,
    intrinsics_of,
    lens_of,
    lens_sources,
    overridden,
)
from pipeline.core.records import Intrinsics
from pipeline.importing.video_file import UnreadableVideo, VideoImport, import_video
from pipeline.ingest.survey import survey

NO_DATA = Lens(np.nan, np.nan, np.nan, np.nan, np.nan)
RECORDED = Intrinsics(640, 480, 500.0, 510.0, 319.5, 239.5, "plumb_bob", (0.1, 0, 0, 0, 0))


def test_a_calibration_follows_the_pictures_size() -> None:
    fitted = fit_to_picture(RECORDED, 320, 240)
    assert fitted is not None
    assert (fitted.fx_px, fitted.fy_px, fitted.cx_px, fitted.cy_px) == (250, 255, 159.5, 119.5)
    assert fitted.distortion == RECORDED.distortion
    assert fit_to_picture(RECORDED, 520, 360) is None  # another shape: cropped, one cannot know how


def test_a_calibration_of_another_shape_is_not_used_silently() -> None:
    camera = CameraConfig("c", fx_px=700.0)
    lens = lens_of(UNKNOWN_EXPOSURE, camera, None, 520, 360)
    found, source, complaint = intrinsics_of(RECORDED, camera, lens, 520, 360)
    assert found is not None
    assert (found.fx_px, source) == (700.0, "camera_file")
    assert "640x480" in (complaint or "")


def test_a_calibration_that_was_scaled_is_told() -> None:
    camera = CameraConfig("c")
    for width_px, height_px, word in ((320, 240, "scaled"), (640, 480, None)):
        lens = lens_of(UNKNOWN_EXPOSURE, camera, RECORDED, width_px, height_px)
        found, source, complaint = intrinsics_of(RECORDED, camera, lens, width_px, height_px)
        assert found is not None
        assert (found.width_px, source) == (width_px, "recording")
        assert (word or "") in (complaint or "")
        assert (complaint is None) == (word is None)


def test_pixel_pitch_is_that_of_the_stored_picture() -> None:
    exposure = replace(
        UNKNOWN_EXPOSURE,
        focal_length_mm=50.0,
        pixel_pitch_x_um=3.9,
        pixel_pitch_y_um=3.9,
        sensor_width_px=6000.0,
        sensor_height_px=4000.0,
    )
    lens = lens_of(exposure, CameraConfig("c"), None, 1500, 1000)
    assert lens.pixel_pitch_x_um == pytest.approx(15.6)
    found, source, _ = intrinsics_of(None, CameraConfig("c"), lens, 1500, 1000)
    assert found is not None
    assert found.fx_px == pytest.approx(50e3 / 15.6)
    assert (found.cx_px, source) == (749.5, "lens_data")


@pytest.mark.parametrize("focal_length_mm", [4.3, np.nan])
def test_the_focal_length_for_35_mm_film_gives_the_angles(focal_length_mm: float) -> None:
    """The same angle across the diagonal (43.27 mm) as before film; a phone's 26 mm sees 79.5 degrees."""
    exposure = replace(UNKNOWN_EXPOSURE, focal_length_mm=focal_length_mm, focal_length_35mm_mm=26.0)
    lens = lens_of(exposure, CameraConfig("c"), None, 4000, 3000)
    assert lens.by_equivalent
    # The sensor's diagonal, of 5000 pixels, is 43.27 mm * 4.3 / 26 = 7.156 mm.
    expected_um = 1.4312 if focal_length_mm == 4.3 else np.nan
    assert lens.pixel_pitch_x_um == pytest.approx(expected_um, rel=1e-4, nan_ok=True)
    found, source, _ = intrinsics_of(None, CameraConfig("c"), lens, 4000, 3000)
    assert found is not None
    assert source == "lens_data"
    assert np.degrees(2 * np.arctan(2500 / found.fx_px)) == pytest.approx(79.5, abs=0.1)


def test_camera_file_stated_pitch_and_calibration_go_before_the_equivalent() -> None:
    exposure = replace(UNKNOWN_EXPOSURE, focal_length_mm=4.3, focal_length_35mm_mm=26.0)
    file = CameraConfig("c", pixel_pitch_x_um=9.0, pixel_pitch_y_um=9.0)
    assert lens_of(exposure, file, None, 4000, 3000).pixel_pitch_x_um == 9.0
    alone = lens_of(exposure, CameraConfig("c"), None, 4000, 3000)
    assert alone.pixel_pitch_x_um == pytest.approx(1.431, abs=1e-3)
    calibrated = lens_of(exposure, CameraConfig("c"), RECORDED, 640, 480)
    assert calibrated.pixel_pitch_x_um == pytest.approx(4.3e3 / RECORDED.fx_px)
    stated = lens_of(replace(exposure, pixel_pitch_x_um=1.4), CameraConfig("c"), None, 4000, 3000)
    assert stated.pixel_pitch_x_um == 1.4
    assert not calibrated.by_equivalent
    assert not stated.by_equivalent


def test_an_impossible_pitch_by_the_equivalent_is_not_used() -> None:
    exposure = replace(UNKNOWN_EXPOSURE, focal_length_mm=5000.0, focal_length_35mm_mm=1.0)
    assert np.isnan(lens_of(exposure, CameraConfig("c"), None, 640, 480).pixel_pitch_x_um)


def test_lens_data_that_contradict_the_calibration_are_told() -> None:
    exposure = replace(UNKNOWN_EXPOSURE, focal_length_mm=50.0, pixel_pitch_x_um=3.9)
    lens = lens_of(exposure, CameraConfig("c"), RECORDED, 640, 480)
    _, source, complaint = intrinsics_of(RECORDED, CameraConfig("c"), lens, 640, 480)
    assert source == "recording"
    assert "12821 px" in (complaint or "")


def test_the_camera_file_goes_before_the_recording_value_by_value() -> None:
    """Focal length by the file; centre and distortion of a calibration that agrees are kept."""
    near = CameraConfig("c", fx_px=505.0)
    found, source, complaint = intrinsics_of(RECORDED, near, NO_DATA, 640, 480)
    assert found is not None
    assert (found.fx_px, found.fy_px, source, complaint) == (505.0, 505.0, "camera_file", None)
    assert (found.cx_px, found.distortion) == (RECORDED.cx_px, RECORDED.distortion)
    assert lens_sources(found, near, source) == ("assumed", "recording")  # the middle to the pixel

    far = CameraConfig("c", fx_px=800.0, cx_px=310.0, cy_px=250.0)
    found, source, complaint = intrinsics_of(RECORDED, far, NO_DATA, 640, 480)
    assert found is not None
    assert (found.fx_px, found.cx_px, found.distortion) == (800.0, 310.0, ())
    assert source == "camera_file"
    assert "500 px" in (complaint or "")
    assert lens_sources(found, far, source) == ("camera_file", "assumed")

    centre = CameraConfig("c", cx_px=310.0, cy_px=250.0)
    found, source, _ = intrinsics_of(RECORDED, centre, NO_DATA, 640, 480)
    assert found is not None
    assert (found.fx_px, found.cx_px, source) == (500.0, 310.0, "recording")


def test_focal_length_and_pitch_of_the_file_replace_a_calibration_that_they_contradict() -> None:
    file = CameraConfig("c", focal_length_mm=4.0, pixel_pitch_x_um=2.0, pixel_pitch_y_um=2.0)
    lens = lens_of(UNKNOWN_EXPOSURE, file, RECORDED, 640, 480)
    found, source, complaint = intrinsics_of(RECORDED, file, lens, 640, 480)
    assert found is not None
    assert (found.fx_px, source) == (2000.0, "lens_data")
    assert "not used" in (complaint or "")


def test_values_of_the_file_that_a_recording_contradicts_are_told() -> None:
    exposure = replace(UNKNOWN_EXPOSURE, f_number=2.8, focal_length_mm=4.0)
    file = CameraConfig("c", f_number=4.0, focal_length_mm=4.1)
    assert lens_of(exposure, file, None, 640, 480).f_number == 4.0
    assert "f_number 4" in (overridden(exposure, file) or "")
    assert "focal_length_mm" not in (overridden(exposure, file) or "")
    named = replace(file, exposure=ExposureFields(f_number="/diag.f"))
    assert lens_of(exposure, named, None, 640, 480).f_number == 2.8
    assert overridden(exposure, named) is None


@pytest.fixture
def video(tmp_path: Path) -> Path:
    path = tmp_path / "clip.avi"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"MJPG"), 10.0, (160, 120))
    for index in range(30):
        writer.write(np.full((120, 160, 3), 8 * index, np.uint8))
    writer.release()
    return path


def test_a_video_becomes_a_recording(video: Path, tmp_path: Path) -> None:
    recording = tmp_path / "r.mcap"
    camera = CameraConfig(
        "yard", focal_length_mm=4.0, pixel_pitch_x_um=3.0, pixel_pitch_y_um=3.0, f_number=2.0
    )
    options = VideoImport(1_000_000_000, "yard", from_s=1.0, duration_s=1.0, scale=0.5)
    assert import_video(video, recording, options, camera) == 10
    found = survey(recording, Config())
    seen = found.cameras[0]
    assert (seen.camera, seen.frame_count) == ("yard", 10)
    assert seen.first_time_ns == 2_000_000_000  # a second into the video
    assert seen.frame_rate == pytest.approx(10.0)
    assert seen.intrinsics is not None
    assert seen.intrinsics.width_px == 80
    assert seen.intrinsics.fx_px == pytest.approx(4e3 / 3 / 2)
    assert seen.exposure_ranges["f_number"] == (2.0, 2.0)
    assert len(found.notes) == 0
    assert not list(tmp_path.glob("*.part"))


def test_what_is_no_video_leaves_nothing_behind(tmp_path: Path) -> None:
    bad, recording = tmp_path / "no.avi", tmp_path / "r.mcap"
    bad.write_bytes(b"not a video")
    options = VideoImport(0, "c")
    with pytest.raises(UnreadableVideo, match=r"no\.avi"):
        import_video(bad, recording, options, CameraConfig("c"))
    with pytest.raises(UnreadableVideo, match="no such file"):
        import_video(tmp_path / "absent.avi", recording, options, CameraConfig("c"))
    assert [p.name for p in tmp_path.iterdir()] == ["no.avi"]


def test_an_excerpt_outside_the_video_is_an_error(video: Path, tmp_path: Path) -> None:
    options = VideoImport(0, "c", from_s=99.0)
    with pytest.raises(UnreadableVideo, match="no frame"):
        import_video(video, tmp_path / "r.mcap", options, CameraConfig("c"))
    assert not (tmp_path / "r.mcap").exists()


def test_a_frame_rate_that_makes_no_sense_is_asked_for(video: Path, tmp_path: Path) -> None:
    options = VideoImport(0, "c", frame_rate=1e9)
    with pytest.raises(UsageError, match="--fps"):
        import_video(video, tmp_path / "r.mcap", options, CameraConfig("c"))
