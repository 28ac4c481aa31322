"""Heights of things that may be turned: which, by how much, and what is told."""

from dataclasses import replace

import numpy as np
import pytest

from pipeline.core.calibration import Dimension
from pipeline.core.config import Config, EstimateConfig, SizePrior
from pipeline.core.records import GroundPlane
from pipeline.estimate.boxes.geometry import Geometry
from pipeline.estimate.boxes.turned_box import box_around, height_share
from pipeline.estimate.methods import size
from pipeline.estimate.turned import as_turned, shares_of, turn_notes
from tests.estimate.scenes import estimates, measured

CONFIG = EstimateConfig()


def boards(turn_rad=0.05, **changes):
    wide, tall = box_around(np.array([130.0]), np.array([90.0]), turn_rad, 0.0, rounded=False)
    box = np.array([[100.0, 100.0, 100.0 + wide[0], 100.0 + tall[0]]])
    return measured(box, class_name=np.array(["board"], dtype=np.object_), **changes), tall[0]


def test_the_interval_of_a_card_turned_by_three_degrees_holds_its_height():
    seen, tall_px = boards(0.05)
    made = estimates(1, height_m=np.array([tall_px / 1e3]), height_std_m=np.array([0.0013]))
    found = as_turned(made, shares_of(seen, CONFIG))
    assert abs(made.height_m[0] - 0.09) > 1.96 * made.height_std_m[0]
    assert abs(found.height_m[0] - 0.09) < 1.96 * found.height_std_m[0]
    (left, _, right, _) = seen.bbox_xyxy_px[0]
    ratio = np.array([(right - left) / tall_px])
    mean, std = height_share(ratio, np.radians(3), np.radians(10))
    assert found.height_m[0] == pytest.approx(made.height_m[0] * mean[0], rel=1e-3)
    # It is the same in all frames.
    assert found.height_common_std_m[0] == pytest.approx(made.height_m[0] * std[0], rel=1e-3)


def test_people_and_what_is_said_to_stand_upright_stay_as_they_are():
    seen, _ = boards()
    assert shares_of(seen, replace(CONFIG, upright=("board",))) is None
    person = replace(seen, class_name=np.array(["person"], dtype=np.object_))
    assert shares_of(person, CONFIG) is None
    posed = replace(seen, ground_plane=GroundPlane(3.0, 0.2))
    assert shares_of(posed, CONFIG) is None
    known = replace(CONFIG, turn_std_deg=0.0, slant_std_deg=0.0)
    assert shares_of(seen, known) is None


def test_a_height_that_was_put_in_stays_as_it_is():
    seen, _ = boards()
    made = estimates(
        1,
        height_m=np.array([0.1]),
        height_std_m=np.array([0.002]),
        height_assumed=np.array([True]),
    )
    found = as_turned(made, shares_of(seen, CONFIG))
    assert found.height_m[0] == 0.1
    assert found.height_std_m[0] == 0.002


def test_it_is_told_once_a_class():
    seen, _ = boards()
    made = estimates(1, height_m=np.array([0.1]), height_std_m=np.array([0.002]))
    (note,) = turn_notes(seen, [made, made], CONFIG)
    assert (note.code, note.count, note.camera) == ("height_may_be_turned", 1, "cam")
    assert "3 degrees" in note.message
    assert turn_notes(seen, [estimates(1)], CONFIG) == []


def test_a_width_that_may_be_turned_gives_a_wider_interval_of_depth():
    seen, _ = boards(turn_rad=0.0)
    prior = SizePrior("board", Dimension.WIDTH, 0.13, 1e-6, mean_std_m=0.0)
    config = Config(size_prior=(prior,))
    known = replace(config, estimate=replace(CONFIG, upright=("board",)))
    loose, firm = (size.estimate(Geometry.of(seen), c) for c in (config, known))
    assert firm.depth_m[0] == pytest.approx(0.13 * 1200 / 130, rel=1e-3)
    mean, std = height_share(np.array([90 / 130]), np.radians(3), np.radians(10))
    assert loose.depth_m[0] == pytest.approx(firm.depth_m[0] / mean[0], rel=1e-3)
    assert loose.depth_common_std_m[0] == pytest.approx(firm.depth_m[0] * std[0], rel=0.02)
