"""Cameras as typed rows, to and from the table."""

from __future__ import annotations

from dataclasses import fields, replace

import pyarrow as pa

from pipeline.core.camera_row import CameraRow, camera_rows, camera_table
from pipeline.core.records import Intrinsics
from pipeline.core.tables import CAMERAS

LENS = Intrinsics(640, 480, 700.0, 710.0, 319.5, 239.5, "plumb_bob", (0.1, -0.02, 0.0, 0.0, 0.0))
BARE = CameraRow("a", topic="/a/image", width_px=640, height_px=480)


def test_a_row_has_the_columns_of_the_table() -> None:
    assert [f.name for f in fields(CameraRow)] == CAMERAS.names


def test_rows_come_back_from_the_table_as_they_were() -> None:
    rows = [
        CameraRow("no picture"),
        BARE,
        BARE.with_lens(LENS, "recording"),
        replace(BARE.with_lens(LENS, "walkers", 12.0), recorded_tilt_rad=0.2, pose_source="given"),
    ]
    table = camera_table(rows)
    assert table.schema == CAMERAS
    assert camera_rows(table) == rows
    more = table.append_column("recording_id", pa.array(["r"] * len(rows)))
    assert camera_rows(more) == rows


def test_a_lens_is_put_in_and_taken_out() -> None:
    row = BARE.with_lens(LENS, "recording", 3.0)
    assert row.intrinsics == LENS
    assert (row.intrinsics_source, row.focal_std_px) == ("recording", 3.0)
    assert row.with_lens(None, None) == BARE
    assert BARE.intrinsics is None
    assert BARE.size_px == (640, 480)
    assert CameraRow("no picture").size_px is None
