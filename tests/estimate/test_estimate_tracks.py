from __future__ import annotations

import numpy as np
import pyarrow as pa
import pytest

from pipeline.core.calibration import CalibratedMethod, Calibration, Dimension, Parameter
from pipeline.core.config import ADULT, Config, SizePrior
from pipeline.core.records import GroundPlane
from pipeline.core.tables import CALIBRATIONS, ESTIMATES, TRACK_HEIGHTS
from pipeline.estimate.estimate_tracks import estimate
from pipeline.estimate.gait import GAIT_DROP_M
from pipeline.estimate.tables import calibrations_table
from tests.estimate.scenes import lens, outlined, people, tables

PLANE = GroundPlane(6.0, 0.2, 0.0, np.diag([0.1, 0.01, 0.01]) ** 2)
K = Calibration(
    CalibratedMethod.APERTURE,
    "person",
    Dimension.WIDTH,
    (Parameter("k", 0.66, 0.01, 2.8), Parameter("k", 0.95, 0.01, 4.0)),
    depth_min_m=0.1,
    depth_max_m=0.2,
)


def walk(n=50, noise_px=0.0, seed=0, tall_m=1.8, *, body=True):
    rng = np.random.default_rng(seed)
    box = people(np.zeros(n), np.linspace(10, 25, n), np.full(n, tall_m), PLANE)
    box = outlined(box, PLANE, np.pi / 2) if body else box
    box[:, 0] -= 20
    box[:, 2] += 20
    return box + rng.normal(0, noise_px, box.shape) if noise_px else box


def rows(table: pa.Table, method: str) -> dict:
    return table.filter(pa.compute.equal(table["method"], method)).to_pydict()


def codes(result):
    return {(d.code, d.count) for d in result.diagnostics}


def test_every_method_that_applies_gives_rows_of_the_tables():
    given = tables(walk(), lens(50))
    result = estimate(**given, poses={"cam": PLANE}, config=Config(calibration=(K,)))
    assert result.estimates.schema == ESTIMATES
    assert result.track_heights.schema == TRACK_HEIGHTS
    assert result.calibrations.schema == CALIBRATIONS
    assert set(result.estimates["method"].to_pylist()) == {"aperture", "size", "ground", "fused"}
    ground = rows(result.estimates, "ground")
    # who walks is 1.8 m tall in the picture, and more when standing
    np.testing.assert_allclose(ground["height_m"], 1.8 + GAIT_DROP_M, atol=0.005)
    aperture = rows(result.estimates, "aperture")
    assert aperture["calibration_id"] == [K.calibration_id] * 50
    assert aperture["in_calibrated_range"] == [False] * 50
    assert ground["in_calibrated_range"] == [None] * 50
    assert result.calibrations["parameter"].to_pylist() == ["k", "k"]
    assert codes(result) == {("outside_calibrated_range", 50)}


def test_without_a_calibration_the_papers_method_does_not_apply_and_says_so_once():
    result = estimate(**tables(walk(), lens(50)), poses={}, config=Config())
    assert set(result.estimates["method"].to_pylist()) == {"size", "fused"}
    assert codes(result) == {("method_not_applicable", 50)}
    assert "'person'" in result.diagnostics[0].message
    assert result.diagnostics[0].camera == "cam"


def test_refused_f_numbers_and_unknown_sizes_are_counted():
    bright = lens(50)
    bright["f_number"][:20] = 1.4
    result = estimate(**tables(walk(), bright), poses={}, config=Config(calibration=(K,)))
    assert ("f_number_outside_calibration", 20) in codes(result)
    assert len(rows(result.estimates, "aperture")["depth_m"]) == 30
    dogs = tables(walk(), lens(50), class_name=["dog"] * 50)
    result = estimate(**dogs, poses={}, config=Config())
    assert ("size_unknown", 50) in codes(result)
    assert result.estimates.num_rows == 0
    assert result.track_heights.num_rows == 0
    unknown = tables(walk(), lens(50, f_number=np.nan))
    result = estimate(**unknown, poses={}, config=Config(calibration=(K,)))
    assert "f-number is not known" in result.diagnostics[0].message


def test_an_assumed_height_does_not_average_out():
    result = estimate(**tables(walk(), lens(50)), poses={}, config=Config())
    track = rows(result.track_heights, "size")
    assert track["height_m"] == [ADULT.mean_m]
    assert track["height_std_m"] == [pytest.approx(ADULT.any_std_m)]
    assert track["height_assumed"] == [True]
    assert track["observation_count"] == [50]


def test_a_track_averages_its_noise_but_not_what_its_frames_share():
    # Ground: the pose is shared, the edges are noise. 150 tracks of 40 frames of 2 px noise, of what
    # does not bob as it moves.
    exact = GroundPlane(6.0, 0.2)
    errors, stds = [], []
    for seed in range(150):
        box = walk(40, noise_px=2.0, seed=seed, body=False)
        given = tables(box, lens(40), class_name=["robot"] * 40)
        result = estimate(**given, poses={"cam": exact}, config=Config(size_prior=()))
        track = rows(result.track_heights, "ground")
        errors.append(track["height_m"][0] - 1.8)
        stds.append(track["height_std_m"][0])
    z = np.array(errors) / np.array(stds)
    assert z.std() == pytest.approx(1.0, abs=0.25)
    assert np.mean(stds) < 0.01
    given = tables(walk(40, body=False), lens(40), class_name=["robot"] * 40)
    result = estimate(**given, poses={"cam": PLANE}, config=Config(size_prior=()))
    shared = rows(result.track_heights, "ground")["height_std_m"][0]
    assert shared == pytest.approx(
        np.median(rows(result.estimates, "ground")["height_std_m"]), rel=0.05
    )


def test_correlated_frames_count_for_fewer():
    n = 400
    rng = np.random.default_rng(1)
    slow = np.zeros(n)
    for i in range(1, n):  # AR(1), c = 0.9
        slow[i] = 0.9 * slow[i - 1] + rng.normal(0, np.sqrt(1 - 0.81))
    fast = rng.permutation(slow)
    stds = []
    for noise in (slow, fast):
        box = people(np.zeros(n), np.full(n, 15.0), np.full(n, 1.8), PLANE)
        box[:, 1] += 3 * noise
        given = tables(box, lens(n), class_name=["post"] * n)  # no body: nothing else is unsure
        exact = {"cam": GroundPlane(6.0, 0.2)}
        result = estimate(**given, poses=exact, config=Config(size_prior=()))
        stds.append(rows(result.track_heights, "ground")["height_std_m"][0])
    assert stds[0] / stds[1] == pytest.approx(np.sqrt(1.9 / 0.1), rel=0.35)


def test_tracks_and_cameras_stay_apart():
    given = tables(walk(), lens(50), track_id=np.repeat([3, 8], 25).astype(np.int32))
    other = given["observations"].set_column(1, "camera", pa.array(["b"] * 50))
    frames = given["frames"].set_column(0, "camera", pa.array(["b"] * 50))
    cameras = given["cameras"].set_column(0, "camera", pa.array(["b"]))
    other = other.set_column(0, "observation_index", pa.array(range(50, 100), pa.int32()))
    both = {
        "observations": pa.concat_tables([given["observations"], other]),
        "frames": pa.concat_tables([given["frames"], frames]),
        "cameras": pa.concat_tables([given["cameras"], cameras]),
    }
    result = estimate(**both, poses={"cam": PLANE}, config=Config())
    heights = result.track_heights.to_pylist()
    assert {(h["camera"], h["track_id"], h["method"]) for h in heights} == {
        *((camera, track, "fused") for camera in ("cam", "b") for track in (3, 8)),
        ("cam", 3, "ground"),
        ("cam", 8, "ground"),
        ("cam", 3, "size"),
        ("cam", 8, "size"),
        ("b", 3, "size"),
        ("b", 8, "size"),
    }
    index = result.estimates["observation_index"].to_numpy()
    assert sorted(index[result.estimates["method"].to_numpy(zero_copy_only=False) == "size"]) == (
        list(range(100))
    )


def test_two_priors_the_surer_one_speaks():
    wide = SizePrior("person", Dimension.WIDTH, 0.5, 0.001)
    result = estimate(**tables(walk(), lens(50)), poses={}, config=Config(size_prior=(ADULT, wide)))
    assert rows(result.estimates, "size")["height_assumed"] == [False] * 50


def test_calibrations_have_a_row_a_parameter():
    table = calibrations_table([K]).to_pylist()
    assert [(r["parameter"], r["f_number"], r["value"]) for r in table] == [
        ("k", 2.8, 0.66),
        ("k", 4.0, 0.95),
    ]
    assert {r["calibration_id"] for r in table} == {K.calibration_id}
    assert table[0]["loo_rmse_m"] is None
