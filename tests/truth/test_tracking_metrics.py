"""Tracking metrics against TrackEval 1.3.0 (HOTA) and py-motmetrics 1.4.0 (the others).

Neither is a dependency: TrackEval brings `opencv-python`, which must not lie beside the headless one. The
file `tracking_reference.json` holds six random scenes (0: tracks of 6 people over 40 frames, boxes with
noise of 3 px, 15 % of them missing, identities that change in 6 % of the frames, 12 false boxes) with
what the two said of them: `HOTA().eval_sequence` on overlaps (intersection over union), and
`MOTAccumulator.update` with distances 1 - overlap, not a number below 0.5.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pipeline.truth.tracking_metrics import Labelled, compare, hota, idf1, mota

SCENES = json.loads((Path(__file__).parent / "tracking_reference.json").read_text())


def labelled(rows: list[list[float]]) -> Labelled:
    array = np.array(rows, dtype=float).reshape(-1, 6)
    return Labelled(array[:, 0].astype(int), array[:, 1].astype(int), array[:, 2:])


@pytest.mark.parametrize("scene", SCENES)
def test_figures_are_those_of_trackeval_and_motmetrics(scene: dict[str, Any]) -> None:
    counts = compare(labelled(scene["true"]), labelled(scene["found"]))
    known = scene["reference"]
    assert hota(counts) == pytest.approx([known[k] for k in ("hota", "deta", "assa")], abs=5e-5)
    assert mota(counts) == pytest.approx(known["mota"], abs=5e-5)
    assert idf1(counts) == pytest.approx(known["idf1"], abs=5e-5)
    assert counts.switches == known["switches"]
    assert counts.fragments == known["fragments"]
    matched, true, found = counts.clear_matches, len(scene["true"]), len(scene["found"])
    assert matched / true == pytest.approx(known["recall"], abs=5e-5)
    assert matched / found == pytest.approx(known["precision"], abs=5e-5)


def test_order_and_names_do_not_matter() -> None:
    scene = SCENES[0]
    true, found = labelled(scene["true"]), labelled(scene["found"])
    mixed = np.random.default_rng(0).permutation(len(found))
    renamed = Labelled(found.frame, 7000 - 3 * found.identity, found.bbox_xyxy_px).take(mixed)
    one, other = compare(true, found), compare(true, renamed)
    assert hota(one) == pytest.approx(hota(other))
    assert (idf1(one), one.switches) == (idf1(other), other.switches)


def test_nothing_found_and_nothing_there() -> None:
    true, none = labelled(SCENES[0]["true"]), labelled([])
    missed, false = compare(true, none), compare(none, true)
    assert (hota(missed)[0], mota(missed), idf1(missed)) == (0.0, 0.0, 0.0)
    assert false.false_positives[0] == len(true)
    assert np.isnan(mota(false))
    assert np.isnan(idf1(compare(none, none)))


def test_perfect_tracks_are_perfect() -> None:
    true = labelled(SCENES[0]["true"])
    counts = compare(true, true)
    assert hota(counts) == pytest.approx((1.0, 1.0, 1.0))
    assert (mota(counts), idf1(counts), counts.switches, counts.fragments) == (1.0, 1.0, 0, 0)
