"""main.exposure_checks and accuracy.exposure_effect on frames made up from Eq. 15."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.stats import linregress

from pipeline.core.tables import CALIBRATIONS, ESTIMATES, OBSERVATION_QUALITY, TRACK_HEIGHTS
from pipeline.run.doubts.exposure_notes import exposure_notes
from pipeline.store.database import Store
from pipeline.store.exposure_rows import exposure_verdicts
from pipeline.store.recordings import list_recordings
from tests.store.rows import ingest, recording, start, table, write_estimates

FRAMES = 40


def exposed(store: Store, folder: Path, **changes: np.ndarray) -> list[dict[str, object]]:
    """Store frames of one scene at changing apertures, and return the verdicts by frame."""
    chance = np.random.default_rng(4)
    f_number = np.tile([1.8, 2.8, 4.0, 5.6], FRAMES // 4)
    time_s, iso = np.full(FRAMES, 0.01), np.full(FRAMES, 400.0)
    luminance = 3.0 * time_s * iso / 100 / f_number**2 * 2 ** chance.normal(0, 0.03, FRAMES)
    columns = {
        "f_number": f_number,
        "exposure_time_s": time_s,
        "iso_speed": iso,
        "luminance": luminance,
        "clipped_fraction": np.zeros(FRAMES),
    }
    columns |= {
        name: value(columns[name]) if callable(value) else value for name, value in changes.items()
    }
    rows = {name: [None if np.isnan(v) else float(v) for v in c] for name, c in columns.items()}
    rows |= {"frame_index": list(range(FRAMES)), "capture_time_ns": list(range(FRAMES))}
    ingest(store, start(store), folder, recording(), frames=rows)
    return store.query(
        "SELECT verdict, departure_ev, step_ev FROM main.exposure_checks ORDER BY frame_index"
    ).to_pylist()


def at(index: int, factor: float):
    def changed(values: np.ndarray) -> np.ndarray:
        values = values.copy()
        values[index] *= factor
        return values

    return changed


def test_a_scene_at_many_apertures_agrees(store: Store, tmp_path: Path) -> None:
    assert {row["verdict"] for row in exposed(store, tmp_path)} == {"agrees"}


def test_one_wrong_f_number_departs_by_its_stops(store: Store, tmp_path: Path) -> None:
    rows = exposed(store, tmp_path, f_number=at(17, 2.0))
    assert [i for i, row in enumerate(rows) if row["verdict"] != "agrees"] == [17]
    assert rows[17]["verdict"] == "departs"
    assert rows[17]["departure_ev"] == pytest.approx(2.0, abs=0.2)


def test_a_gain_that_changes_steps_once(store: Store, tmp_path: Path) -> None:
    rows = exposed(store, tmp_path, luminance=lambda v: v * np.where(np.arange(FRAMES) >= 22, 3, 1))
    assert [i for i, row in enumerate(rows) if row["verdict"] != "agrees"] == [22]
    assert rows[22]["verdict"] == "steps"
    assert rows[22]["step_ev"] == pytest.approx(np.log2(3), abs=0.1)


def test_the_same_change_told_by_the_iso_speed_agrees(store: Store, tmp_path: Path) -> None:
    later = np.where(np.arange(FRAMES) >= 22, 3.0, 1.0)
    rows = exposed(store, tmp_path, luminance=lambda v: v * later, iso_speed=lambda v: v * later)
    assert {row["verdict"] for row in rows} == {"agrees"}


def test_clipped_frames_are_flagged_and_not_asked(store: Store, tmp_path: Path) -> None:
    rows = exposed(store, tmp_path, clipped_fraction=_clip, luminance=at(3, 0.2))
    assert rows[3]["verdict"] == "clipped"
    assert rows[3]["departure_ev"] is None
    assert [row["verdict"] for row in rows].count("agrees") == FRAMES - 1


def _clip(values: np.ndarray) -> np.ndarray:
    values = values.copy()
    values[3] = 0.3
    return values


def test_without_an_exposure_time_nothing_is_said(store: Store, tmp_path: Path) -> None:
    rows = exposed(store, tmp_path, exposure_time_s=lambda v: v * np.nan)
    assert {row["verdict"] for row in rows} == {None}
    assert exposure_notes(exposure_verdicts(store, _id(store))) == []


def test_a_constant_that_a_camera_never_tells_is_no_matter(store: Store, tmp_path: Path) -> None:
    same = np.full(FRAMES, 0.2)
    rows = exposed(store, tmp_path, f_number=same * np.nan, iso_speed=same * np.nan, luminance=same)
    assert {row["verdict"] for row in rows} == {"agrees"}


def test_verdicts_become_diagnostics(store: Store, tmp_path: Path) -> None:
    exposed(store, tmp_path, f_number=at(17, 2.0))
    (note,) = exposure_notes(exposure_verdicts(store, _id(store)))
    assert (note.code, note.count, note.camera) == ("exposure_departs", 1, "cam")
    assert "2.0 stops" in note.message
    assert "frame 17" in note.message


def _id(store: Store) -> str:
    return str(list_recordings(store).to_pylist()[0]["recording_id"])


def test_the_effect_of_exposure_is_a_regression(store: Store, tmp_path: Path) -> None:
    chance = np.random.default_rng(8)
    n = 30
    f_number = chance.choice([1.8, 2.8, 4.0], n)
    luminance = chance.uniform(0.05, 0.5, n)
    exposure_ev = np.log2(luminance / f_number**2)
    error = 0.01 * (1 + 0.5 * exposure_ev) + chance.normal(0, 0.01, n)
    ids = [f"o{i}" for i in range(n)]
    run_id = start(store)
    key = ingest(
        store,
        run_id,
        tmp_path,
        recording(),
        frames={"frame_index": list(range(n)), "f_number": f_number.tolist()},
        observations={
            "object_id": ids,
            "frame_index": list(range(n)),
            "track_id": list(range(n)),
            "luminance": luminance.tolist(),
        },
        ground_truth={"object_id": ids, "frame_index": list(range(n)), "depth_m": [2.0] * n},
    )
    estimates = {
        "observation_index": list(range(n)),
        "depth_m": (2 * (1 + error)).tolist(),
        "depth_std_m": [0.1] * n,
        "method": ["size"] * n,
    }
    with store.transaction():
        write_estimates(
            store,
            key,
            run_id,
            table(ESTIMATES, estimates),
            table(TRACK_HEIGHTS, {}),
            table(CALIBRATIONS, {}),
            table(OBSERVATION_QUALITY, {}),
        )
    (row,) = store.query("FROM accuracy.exposure_effect").to_pylist()
    expected = linregress(exposure_ev, 100 * error)
    assert row["observation_count"] == n
    assert row["slope_percent_per_ev"] == pytest.approx(expected.slope, rel=1e-3)
    assert row["slope_std_error_percent"] == pytest.approx(expected.stderr, rel=1e-3)
    assert row["r2"] == pytest.approx(expected.rvalue**2, rel=1e-3)


@pytest.mark.parametrize("stretch", [3, 7, 39])
def test_stretches_say_what_the_whole_says(store: Store, tmp_path: Path, stretch: int) -> None:
    def luminance(values: np.ndarray) -> np.ndarray:
        values = values * np.where(np.arange(FRAMES) >= 26, 3.0, 1.0)  # a step
        values[9] *= 4.0
        values[20] = np.nan
        return values

    def clipped(values: np.ndarray) -> np.ndarray:
        return np.where(np.isin(np.arange(FRAMES), [3, 33]), 0.2, values)

    exposed(store, tmp_path, luminance=luminance, clipped_fraction=clipped)
    key = recording().recording_id
    expected = store.query(
        """
        SELECT camera, verdict, count(*) AS frames, min(frame_index) AS first_frame_index,
            arg_min(capture_time_ns, frame_index) AS first_time_ns,
            max(greatest(abs(departure_ev), abs(step_ev))) AS most_ev
        FROM main.exposure_checks WHERE verdict <> 'agrees' GROUP BY ALL ORDER BY ALL
        """
    ).to_pylist()
    assert [row["verdict"] for row in expected] == ["clipped", "departs", "steps"]
    assert exposure_verdicts(store, key, stretch).to_pylist() == expected
    assert exposure_verdicts(store, key).to_pylist() == expected


def test_what_is_not_there_has_no_verdict(store: Store) -> None:
    assert exposure_verdicts(store, "nothing").num_rows == 0
