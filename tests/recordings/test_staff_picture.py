"""The pictures of `staff` show what its boxes and its truth say: measured in the pixels."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from pipeline.core.config import CameraConfig
from pipeline.detect.roi import RoiDetector
from pipeline.images.decode import decode
from pipeline.optics.exposure import srgb_to_linear
from recordings.staff_scene import photograph
from recordings.staff_table import photos

ABOVE_BENCH_PX = 760  # the wall reaches down to here: one background for each edge


@pytest.fixture(scope="module")
def luma(staff):
    """Linear light of every picture, from luma alone: chroma is stored at half the size."""
    pictures = []
    for message in staff.messages["foxglove.CompressedImage"]:
        assert message.format == "jpeg"
        grey = cv2.imdecode(np.frombuffer(message.data, np.uint8), cv2.IMREAD_GRAYSCALE)
        assert grey is not None
        assert grey.shape == (1000, 1500)
        pictures.append(srgb_to_linear(np.arange(256) / 255)[grey])
    return pictures


@pytest.fixture(scope="module")
def boxes(staff):
    return [m.objects[0].box for m in staff.messages["stadimeter.Detections"]]


def _outer_edges_px(light):
    """Positions of the outermost strong edges: centres of gravity of their gradients."""
    slope = np.diff(light[:ABOVE_BENCH_PX].mean(axis=0))
    edges = []
    for sign, columns in ((1, range(300, 750)), (-1, range(1199, 749, -1))):
        rise = np.clip(sign * slope, 0, None)
        strong = 0.4 * max(rise[c] for c in columns)
        first = next(c for c in columns if rise[c] > strong)
        peak = max(range(first - 2, first + 3), key=lambda c: rise[c])
        near = np.arange(peak - 2, peak + 3)
        edges.append(float(rise[near] @ (near + 0.5) / rise[near].sum()))
    return edges


def test_staff_is_as_wide_as_its_box(luma, boxes):
    for light, box in zip(luma, boxes, strict=True):
        left, right = _outer_edges_px(light)
        assert left == pytest.approx(box.x_min_px, abs=0.2)
        assert right == pytest.approx(box.x_max_px, abs=0.2)
        assert right - left == pytest.approx(box.x_max_px - box.x_min_px, abs=0.3)


def test_region_of_interest_measures_the_same_width(staff, boxes):
    roi = (400.0, 0.0, 1100.0, float(ABOVE_BENCH_PX))
    detector = RoiDetector(CameraConfig("nikon_d5300", roi_xyxy_px=roi))
    for message, box in zip(staff.messages["foxglove.CompressedImage"], boxes, strict=True):
        picture = decode(message.data, max_pixels=10**7, full_resolution=True)
        found = detector.detect(None, picture)  # type: ignore[arg-type]
        assert len(found) == 1
        width = found.bbox_xyxy_px[0, 2] - found.bbox_xyxy_px[0, 0]
        assert width == pytest.approx(box.x_max_px - box.x_min_px, abs=0.6)


def test_graduations_show_the_truth(staff, luma, boxes):
    for light, box, message in zip(
        luma, boxes, staff.messages["stadimeter.GroundTruth"], strict=True
    ):
        truth = message.objects[0]
        if truth.HasField("depth_m"):
            px_per_cm = 50 / (truth.depth_m * 1e3) / 3.9e-3 * 0.25 * 10
        else:
            px_per_cm = (box.y_max_px - box.y_min_px) / (truth.height_m * 100)
        width = box.x_max_px - box.x_min_px
        columns = slice(round(box.x_min_px + 0.22 * width), round(box.x_min_px + 0.44 * width))
        profile = light[:, columns].mean(axis=1)
        high = profile > (profile.max() + profile.min()) / 2
        at = np.flatnonzero(high[1:] != high[:-1])
        level = (profile.max() + profile.min()) / 2
        crossing = at + (level - profile[at]) / (profile[at + 1] - profile[at])
        assert len(crossing) >= 4
        # Edges of bars are whole centimetres apart: 1, or 5 between one E and the next.
        apart_cm = np.diff(crossing) / px_per_cm
        assert set(np.rint(apart_cm)) <= {1.0, 5.0}
        assert apart_cm == pytest.approx(np.rint(apart_cm), abs=0.03)


def test_brightness_follows_the_aperture(staff, luma, boxes):
    by_aperture = {}
    for light, box, message in zip(
        luma, boxes, staff.messages["stadimeter.CameraExposure"], strict=True
    ):
        width = box.x_max_px - box.x_min_px
        x = box.x_min_px + np.array([0.067, 0.093]) * width  # the face beside the left rim
        face = np.median(light[300:700, round(x[0]) : round(x[1]) + 1])
        by_aperture.setdefault(message.f_number, []).append(face)
    faces = {n: float(np.mean(v)) for n, v in by_aperture.items()}
    assert faces[1.8] > 0.99  # clipped, as a camera would
    unclipped = {n: v for n, v in faces.items() if n >= 2.5}
    # Eq. 15: value times N^2 is one number at constant time and ISO. The vignette is a few per cent.
    constant = np.array([v * n**2 for n, v in unclipped.items()])
    assert constant == pytest.approx(constant.mean(), rel=0.06)
    assert len(unclipped) == 8


def test_noise_is_that_of_photons_and_reading():
    photo = next(p for p in photos() if p.object_id == "table7/row7")
    one, two = (photograph(photo, seed)[:, :, 1].astype(np.float64) / 255 for seed in (1, 2))
    wall = (slice(100, 500), slice(100, 500))
    light = srgb_to_linear(one[wall]), srgb_to_linear(two[wall])
    # Green has half of the 16 sensor pixels behind a stored one, of 4000 electrons each.
    electrons = 8 * 4000 * light[0].mean()
    expected = np.sqrt(electrons + 8 * 3.0**2) / (8 * 4000)
    assert (light[0] - light[1]).std() / np.sqrt(2) == pytest.approx(expected, rel=0.15)
    assert light[0].mean() == pytest.approx(light[1].mean(), rel=0.01)
