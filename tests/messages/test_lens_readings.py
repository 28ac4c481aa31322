"""Readings of calibrations: of the sensor, binned, cut, of another size, transposed, in shares, dummies.

Each true lens is one of a small scene; what a driver states is made from it by its own mistake, and
the lens that comes back must be the true one, told unless the driver kept to the definition.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from pipeline.core.config import Config
from pipeline.core.diagnostics import Notes
from pipeline.core.records import Intrinsics, LensClaim
from pipeline.ingest.frames import FrameAssembler
from pipeline.mcap_file.reader import McapFile
from pipeline.mcap_file.writer import RecordingWriter, calibration_message, image_message
from pipeline.messages.lens_readings import Found, lens_of_claim
from tests.run.test_recordings import jpeg

HD = (1280, 720)
TOPIC = "/cam/image/compressed"
FX, FY, CX, CY = 1000.0, 1002.0, 650.5, 349.5  # a little off the middle, as real ones are


def matrix(fx: float = FX, fy: float = FY, cx: float = CX, cy: float = CY) -> tuple[float, ...]:
    return (fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0)


def projection(fx: float, cx: float = 639.5, cy: float = 359.5) -> tuple[float, ...]:
    return (fx, 0.0, cx, 0.0, 0.0, fx, cy, 0.0, 0.0, 0.0, 1.0, 0.0)


def of(found: Found) -> tuple[float, float, float, float]:
    assert found.lens is not None
    k = found.lens
    return k.fx_px, k.fy_px, k.cx_px, k.cy_px


@pytest.mark.parametrize(
    "claim",
    [
        LensClaim(*HD, matrix()),
        LensClaim(0, 0, matrix()),  # no size: that of the pictures
        LensClaim(2560, 1440, matrix(2000, 2004, 1301.5, 699.5), binning=(2, 2)),
        # a region of 1280 x 720 at (400, 300) of a sensor of 2000 x 1300
        LensClaim(2000, 1300, matrix(cx=CX + 400, cy=CY + 300), region=(400, 300, *HD)),
        LensClaim(
            3000,
            2000,
            matrix(2000, 2004, 1401.5, 949.5),
            (),
            "",
            (),
            (2, 2),
            (100, 250, 2560, 1440),
        ),
    ],
)
def test_the_definition_is_taken_and_not_told(claim: LensClaim) -> None:
    found = lens_of_claim(claim, HD, TOPIC)
    assert of(found) == pytest.approx((FX, FY, CX, CY))
    assert found.code == ""


@pytest.mark.parametrize(
    ("claim", "words"),
    [
        (LensClaim(2560, 1440, matrix(), binning=(2, 2)), "binned"),
        (LensClaim(5120, 2880, matrix(), binning=(4, 4)), "binned"),
        (LensClaim(2000, 1300, matrix(), region=(30, 500, *HD)), "region of interest"),
        (LensClaim(2560, 1440, matrix()), "of the pictures as they are"),  # the size of the sensor
        (
            LensClaim(*HD, matrix(2000, 2004, 1301.5, 699.5)),
            "2560 x 1440",
        ),  # the picture was halved
        (LensClaim(*HD, matrix(500, 501, 325, 174.5)), "640 x 360"),
        (LensClaim(*HD, (FX, 0, 0, 0, FY, 0, CX, CY, 1)), "transposed"),
        (
            LensClaim(*HD, matrix(FX / 1280, FY / 720, (CX + 0.5) / 1280, (CY + 0.5) / 720)),
            "shares",
        ),
        (
            LensClaim(*HD, matrix(FX / 1280, FY / 1280, (CX + 0.5) / 1280, (CY + 0.5) / 1280)),
            "shares",
        ),
        (LensClaim(720, 1280, matrix(FY, FX, CY, CX)), "x and y exchanged"),
    ],
)
def test_the_only_possible_reading_is_taken_and_told(claim: LensClaim, words: str) -> None:
    found = lens_of_claim(claim, HD, TOPIC)
    assert of(found) == pytest.approx((FX, FY, CX, CY), abs=1.5)
    assert found.code == "lens_reading"
    assert words in found.sentence


@pytest.mark.parametrize(
    "claim",
    [
        LensClaim(*HD, (1.0, 0, 0, 0, 1, 0, 0, 0, 1)),
        LensClaim(*HD, matrix(1, 1, 640, 360)),
        LensClaim(*HD, (1.0,) * 9),
        LensClaim(*HD, matrix(640, 360, 640, 360)),  # the map of -1..1 onto the picture
        LensClaim(*HD, matrix(1, 1, 0.5, 0.5)),  # the same in shares
        LensClaim(640, 480, matrix(1000, 1000, 640, 360)),  # a default for another camera
        LensClaim(*HD, matrix(FX, FY, 0, 0)),
        LensClaim(*HD, matrix(-1000, -1000)),
        LensClaim(*HD, matrix(1e30, 1e30)),
        LensClaim(*HD, matrix(20, 5000)),
        LensClaim(1280, 960, matrix(cy=479.5)),  # cut: by how much on which side is not known
    ],
)
def test_what_no_lens_can_have_is_refused_and_told(claim: LensClaim) -> None:
    picture = (640, 480) if claim.width_px == 640 else HD
    found = lens_of_claim(claim, picture, TOPIC)
    assert found.lens is None
    assert found.code == "impossible_lens"
    assert "camera file" in found.sentence


def test_a_picture_that_was_cut_on_one_side_and_one_that_was_squeezed_are_doubtful() -> None:
    """The cameras at Waymo's sides have their centre at a quarter of the height."""
    cut = lens_of_claim(LensClaim(1920, 886, matrix(2056, 2056, 939.7, 242.0)), (1920, 886), TOPIC)
    assert of(cut)[3] == 242.0
    squeezed = lens_of_claim(LensClaim(704, 576, matrix(700, 640, 351.5, 287.5)), (704, 576), TOPIC)
    assert squeezed.code == ""
    squeezed = lens_of_claim(
        LensClaim(1440, 1080, matrix(1050, 1400, 719.5, 539.5)), (1440, 1080), TOPIC
    )
    assert of(squeezed)[0] == 1050
    assert (cut.code, squeezed.code) == ("doubtful_lens", "doubtful_lens")


@pytest.mark.parametrize(
    ("topic", "focal_px", "code"),
    [
        ("/cam/image_rect", 800.0, "rectified_pictures"),
        ("/cam/image_rect_color/compressed", 800.0, "rectified_pictures"),
        ("/left/rectified/image", 800.0, "rectified_pictures"),
        ("/cam/image_raw", 1000.0, ""),
        ("/direct/image", 1000.0, ""),
    ],
)
def test_rectified_pictures_have_the_lens_p_and_no_distortion(
    topic: str, focal_px: float, code: str
) -> None:
    claim = LensClaim(*HD, matrix(), projection(800.0), "plumb_bob", (-0.3, 0.1, 0, 0, 0))
    found = lens_of_claim(claim, HD, topic)
    assert found.lens is not None
    assert (found.lens.fx_px, found.code) == (focal_px, code)
    assert bool(found.lens.distortion) == (focal_px == 1000.0)


def test_where_the_topic_does_not_tell_both_lenses_are_kept() -> None:
    claim = LensClaim(*HD, matrix(), projection(800.0), "plumb_bob", (-0.3, 0.1, 0, 0, 0))
    found = lens_of_claim(claim, HD, TOPIC)
    assert found.rectified == Intrinsics(*HD, 800.0, 800.0, 639.5, 359.5)
    assert lens_of_claim(claim, HD, "/cam/image_raw").rectified is None
    same = LensClaim(*HD, matrix(), projection(1000.0))
    assert lens_of_claim(same, HD, TOPIC).rectified is None


def test_p_stands_in_for_a_k_that_is_none_and_k_for_a_p_that_is_none() -> None:
    found = lens_of_claim(LensClaim(*HD, (), projection(800.0)), HD, TOPIC)
    assert (of(found)[0], found.code) == (800.0, "lens_reading")
    claim = LensClaim(*HD, matrix(), (), "plumb_bob", (-0.3, 0.1, 0, 0, 0))
    found = lens_of_claim(claim, HD, "/cam/image_rect")
    assert found.lens is not None
    assert (found.lens.fx_px, found.lens.distortion, found.code) == (FX, (), "lens_reading")


def test_a_dummy_does_not_decide_and_each_frame_has_the_lens_of_its_time(tmp_path: Path) -> None:
    start_ns, step_ns = 1_700_000_000_000_000_000, 100_000_000
    focal_px = [1.0, 400.0, 400.0, 600.0]
    with RecordingWriter(tmp_path / "x.mcap") as writer:
        for index, f in enumerate(focal_px):
            at_ns = start_ns + index * step_ns
            lens = Intrinsics(320, 240, f, f, 159.5, 119.5)
            writer.write("/c", calibration_message(lens, at_ns, "cam"), at_ns)
            writer.write("/i", image_message(jpeg(), "jpeg", at_ns, "cam"), at_ns)
    notes, config = Notes(), Config()
    file = McapFile(tmp_path / "x.mcap", config.limits, notes.add)
    frames = list(FrameAssembler(file, config.ingest, notes))
    assert [f.intrinsics.fx_px if f.intrinsics else None for f in frames] == [None, 400, 400, 600]
    assert [(n.code, n.count) for n in notes] == [("impossible_lens", 1)]
