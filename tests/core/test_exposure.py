"""The table of exposure fields, and everything that follows from it."""

from __future__ import annotations

import math
import re
from dataclasses import fields
from pathlib import Path

import pytest

from pipeline.core.config import ExposureFields
from pipeline.core.exposure import FIELDS, Exposure, check_exposure
from pipeline.core.tables import FRAMES
from pipeline.images.exif import _EXIF_TAGS
from pipeline.messages.exposure import camera_exposure, names_exposure
from schemas.stadimeter_pb2 import CameraExposure

SQL = Path(__file__).parents[2] / "schemas" / "sql" / "tables.sql"
UINT32 = 13


def test_the_table_and_the_message_have_the_same_fields() -> None:
    message = {
        f.name: f.type == UINT32
        for f in CameraExposure.DESCRIPTOR.fields
        if f.name not in ("timestamp", "frame_id")
    }
    assert message == {row.message_name: row.whole for row in FIELDS.values()}


def test_the_table_and_the_columns_of_frames_have_the_same_fields() -> None:
    created = re.search(r"CREATE TABLE IF NOT EXISTS frames \((.*?)\);", SQL.read_text(), re.DOTALL)
    assert created is not None
    columns = re.findall(r"^    (\w+) ", created[1], re.MULTILINE)
    stored = [row.name for row in FIELDS.values() if row.stored]
    assert [name for name in columns if name in FIELDS] == stored
    assert [name for name in FRAMES.names if name in FIELDS] == stored


def test_a_camera_file_may_name_every_field() -> None:
    assert [f.name for f in fields(ExposureFields)] == list(FIELDS)


def test_tags_of_the_table_are_tags_that_are_read() -> None:
    tags = {row.exif for row in FIELDS.values() if row.exif}
    assert tags <= set(_EXIF_TAGS.values())


@pytest.mark.parametrize("row", FIELDS.values(), ids=lambda row: row.name)
def test_every_field_of_a_message_is_read_and_bounded(row) -> None:  # type: ignore[no-untyped-def]
    value = max(row.low, 1.0)
    read = camera_exposure({row.message_name: value})
    assert getattr(read.payload, row.name) == value
    assert names_exposure([row.message_name])
    refused = camera_exposure({row.message_name: row.low - 1.0})
    assert math.isnan(getattr(refused.payload, row.name)) or row.low - 1.0 == 0
    assert len(refused.refused) == (0 if row.zero_is_unknown and row.low == 1.0 else 1)


@pytest.mark.parametrize("row", FIELDS.values(), ids=lambda row: row.name)
def test_the_first_unit_is_that_of_the_name(row) -> None:  # type: ignore[no-untyped-def]
    unit, convert = next(iter(row.units.items()))
    assert convert(3.0) == 3.0
    assert unit == "1" or row.name.endswith(f"_{unit}")


def test_zero_is_a_claim_but_where_exif_writes_it_for_unknown() -> None:
    exposure, refused = check_exposure(dict.fromkeys(FIELDS, 0.0))
    known = {f.name for f in fields(Exposure) if not math.isnan(getattr(exposure, f.name))}
    assert known == {"exposure_bias_ev", "brightness_ev", "gain_db"}
    silent = len(FIELDS) - len(known) - len(refused)
    assert silent == sum(row.zero_is_unknown for row in FIELDS.values()) == 3
