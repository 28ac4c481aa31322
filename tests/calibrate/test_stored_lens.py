"""The lens of a stored camera: of several sources, the one that is used."""

from __future__ import annotations

from dataclasses import replace

import pytest

from pipeline.calibrate.stored_lens import known_lens, with_found
from pipeline.core.camera_row import CameraRow
from pipeline.core.config import CameraConfig
from pipeline.core.records import FoundLens, Intrinsics

BARE = CameraRow("a", width_px=640, height_px=480)
FOUND = FoundLens(Intrinsics(640, 480, 700.0, 700.0, 319.5, 239.5), 30.0)


def test_what_was_found_is_looked_for_again() -> None:
    row = with_found(BARE, FOUND)
    assert (row.fx_px, row.focal_std_px) == (700.0, 30.0)
    assert row.intrinsics_source == "walkers"
    assert known_lens(row, CameraConfig("a")) == BARE


def test_the_recordings_lens_stays_where_the_camera_file_states_none() -> None:
    row = replace(BARE, fx_px=800.0, intrinsics_source="recording")
    assert known_lens(row, CameraConfig("a", f_number=2.0)) == row


def test_a_focal_length_of_the_camera_file_goes_before_the_recordings() -> None:
    """As in pass 1: the centre is kept only of a calibration that agrees."""
    lens = Intrinsics(640, 480, 800.0, 800.0, 300.0, 250.0)
    row = BARE.with_lens(lens, "recording")
    known = known_lens(row, CameraConfig("a", fx_px=900.0))
    assert (known.fx_px, known.cx_px) == (900.0, 319.5)
    assert (known.intrinsics_source, known.centre_source) == ("camera_file", "assumed")
    near = known_lens(row, CameraConfig("a", fx_px=805.0))
    assert (near.fx_px, near.cx_px, near.centre_source) == (805.0, 300.0, "recording")


@pytest.mark.parametrize("row", [BARE, with_found(BARE, FOUND)])
def test_the_camera_file_goes_before_walkers(row: CameraRow) -> None:
    known = known_lens(row, CameraConfig("a", fx_px=900.0))
    assert (known.fx_px, known.fy_px, known.cx_px) == (900.0, 900.0, 319.5)
    assert (known.intrinsics_source, known.focal_std_px) == ("camera_file", None)


UNSURE = CameraConfig("a", fx_px=700.0, focal_std_px=30.0)
POSED = replace(UNSURE, camera_height_m=3.0, tilt_deg=20.0)


@pytest.mark.parametrize("before", ["bare", "file"])
def test_a_found_lens_in_a_camera_file_counts_with_the_pose_it_was_found_with(before: str) -> None:
    of_file = known_lens(BARE, replace(POSED, focal_std_px=0.0))
    row = BARE if before == "bare" else of_file
    known = known_lens(row, POSED)
    assert (known.fx_px, known.focal_std_px) == (700.0, 30.0)
    assert known.intrinsics_source == "camera_file"
    assert known_lens(row, UNSURE) == BARE
