"""A network beside motion: it looks now and then, and confirms what it finds a person in."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from pipeline.core.config import DetectConfig
from pipeline.core.records import Boxes, Frame
from pipeline.detect.verify import AGAIN_S, ENOUGH_LOOKS, Verifier
from pipeline.images.decode import Picture
from tests.support.footage import frame
from tests.support.onnx_models import model

# A person at the left, a bottle at the right, and in the middle both, of which the bottle is surer.
FOUND = np.array(
    [
        [5, 10, 15, 50, 0.9, 0],
        [45, 10, 55, 50, 0.9, 39],
        [25, 10, 35, 50, 0.5, 0],
        [25, 10, 35, 50, 0.8, 39],
    ],
    dtype=np.float32,
)

WHOLE = np.ones(2, dtype=bool)


def verifier(folder: Path) -> Verifier:
    rows = np.zeros((1, 300, 6), np.float32)
    rows[0, : len(FOUND)] = FOUND
    path = folder / "two.onnx"
    path.write_bytes(model({"output0": rows}, metadata={}))
    return Verifier(DetectConfig(model=str(path), model_backend="opencv"))


def boxes(*left: float) -> Boxes:
    edges = np.array([[x, 10.0, x + 10, 50.0] for x in left])
    count = len(left)
    return Boxes(edges, np.ones(count), ("person",) * count, np.ones((count, 4)), (None,) * count)


def picture(_: Frame) -> Picture:
    return Picture(64, 64, np.zeros((64, 64, 3), np.uint8), 1, 0.0, 0.0)


def test_a_person_is_confirmed_and_a_bottle_and_nothing_are_not(tmp_path: Path) -> None:
    found = verifier(tmp_path).confirmed(
        frame(0), boxes(4.5, 44.5, 24.5, 80), np.arange(4), np.ones(4, dtype=bool), picture
    )
    assert found is not None
    assert found.tolist() == [1, 0, 0, 0]


def test_it_looks_at_every_fifth_frame_until_it_knows(tmp_path: Path) -> None:
    network = verifier(tmp_path)
    looked = [
        index
        for index in range(200)
        if network.confirmed(frame(index), boxes(4.5), np.array([7]), WHOLE[:1], picture)
        is not None
    ]
    known = 5 * ENOUGH_LOOKS
    assert looked[:ENOUGH_LOOKS] == list(range(0, known, 5))
    # Then every four seconds.
    apart_s = np.diff([frame(index).capture_time_ns / 1e9 for index in looked[ENOUGH_LOOKS - 1 :]])
    assert (apart_s >= AGAIN_S).all()
    assert (
        network.confirmed(frame(200), boxes(4.5, 44.5), np.array([7, 8]), WHOLE, picture)
        is not None
    )


def test_parts_at_the_edge_are_not_judged_and_use_up_no_looks(tmp_path: Path) -> None:
    network = verifier(tmp_path)
    for index in range(0, 100, 5):
        assert (
            network.confirmed(frame(index), boxes(4.5), np.array([7]), ~WHOLE[:1], picture) is None
        )
    found = network.confirmed(
        frame(100), boxes(4.5, 24.5), np.array([7, 8]), np.array([True, False]), picture
    )
    assert found is not None
    assert found[0] == 1
    assert np.isnan(found[1])
