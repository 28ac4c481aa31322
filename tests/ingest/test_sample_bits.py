"""Pictures of 12 bits in 16: a PNG is read as bare samples are."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from pipeline.core.config import Config
from pipeline.core.diagnostics import Notes
from pipeline.core.records import Frame
from pipeline.images.decode import decode
from pipeline.ingest.frames import FrameAssembler
from pipeline.mcap_file.reader import McapFile
from pipeline.mcap_file.writer import RecordingWriter, image_message

START_NS, STEP_NS = 1_700_000_000_000_000_000, 100_000_000
LIGHT = np.linspace(0, 255, 64 * 48).reshape(48, 64).astype(np.uint16)


def read(path: Path, pictures: list[np.ndarray]) -> tuple[list[Frame], Notes]:
    with RecordingWriter(path) as writer:
        for index, picture in enumerate(pictures):
            at_ns = START_NS + index * STEP_NS
            data = cv2.imencode(".png", picture)[1].tobytes()
            writer.write("/i", image_message(data, "png", at_ns, "cam"), at_ns)
    notes, config = Notes(), Config()
    file = McapFile(path, config.limits, notes.add)
    return list(FrameAssembler(file, config.ingest, notes)), notes


def mean(frame: Frame) -> float:
    found = decode(frame.image, max_pixels=10**6, full_resolution=True, layout=frame.layout)
    return float(found.bgr.mean())


@pytest.mark.parametrize("bits", [10, 12, 14])
@pytest.mark.parametrize("channels", [1, 3, 4])
def test_a_png_of_few_bits_in_16_is_as_bright_as_one_of_8(
    bits: int, channels: int, tmp_path: Path
) -> None:
    wide = LIGHT << (bits - 8)
    picture = wide if channels == 1 else np.dstack([wide] * channels)
    frames, notes = read(tmp_path / "x.mcap", [picture, picture])
    assert [mean(f) for f in frames] == pytest.approx([LIGHT.mean()] * 2, abs=0.5)
    assert [n.code for n in notes] == ["assumed_bit_depth"]


def test_a_png_that_fills_16_bits_and_one_of_8_are_read_as_before(tmp_path: Path) -> None:
    frames, notes = read(tmp_path / "x.mcap", [LIGHT << 8, LIGHT.astype(np.uint8)])
    assert [mean(f) for f in frames] == pytest.approx([LIGHT.mean()] * 2, abs=0.5)
    assert frames[1].layout is None
    assert len(notes) == 0


def test_a_damaged_png_of_16_bits_waits_for_its_turn(tmp_path: Path) -> None:
    path = tmp_path / "x.mcap"
    data = cv2.imencode(".png", LIGHT << 4)[1].tobytes()[:60]
    with RecordingWriter(path) as writer:
        writer.write("/i", image_message(data, "png", START_NS, "cam"), START_NS)
    config = Config()
    file = McapFile(path, config.limits, Notes().add)
    (frame,) = FrameAssembler(file, config.ingest, Notes())
    assert (frame.image, frame.layout) == (data, None)
