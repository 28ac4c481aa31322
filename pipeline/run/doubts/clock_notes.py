"""Diagnostics where the cadence of people says that the clock, or a given scale, cannot be right.

People take 1.9 steps a second, and at that cadence walk at 1.385 m/s; speed goes as cadence^1.5. A clock
that runs r times too fast multiplies cadence and speed by r, so that speed falls behind cadence^1.5 by
r^-0.5; a scale that is s times too large multiplies speed alone. Both are compared with what is found.
"""

from __future__ import annotations

import math

import numpy as np
import pyarrow as pa

from pipeline.core.config import Config
from pipeline.core.records import Diagnostic, GroundPlane, Severity
from pipeline.store.database import Store

# Free walking out of doors: studies have means of 1.80 to 2.00 steps a second (Pachi and Ji 2005,
# Zivanovic 2005, Matsumoto 1978, Bachmann 1987), people within one a deviation of 0.11 to 0.19.
CADENCE_HZ, CADENCE_GROUP_STD, CADENCE_PERSON_STD = 1.9, 0.05, 0.09
# Who strolls takes 1.5 to 1.7 steps a second (slow walk: 1.7, Bachmann and Ammann 1987), and at some
# places all do; but nowhere do all hurry. Below the mean whole groups differ by more.
STROLLING_STD = 0.12
# Speed beside cadence, on surveyed cameras: 1.385 m/s (cadence / 1.9 Hz)^1.5. Its deviations are of one
# person (stature and habit), and of the mean of those who are at one place; relative.
SPEED_M_S, EXPONENT = 1.385, 1.5
SPEED_PERSON_STD, SPEED_GROUP_STD = 0.11, 0.04
GIVEN_SCALE_STD = 0.02  # of a surveyed pose
MIN_TRACKS = 4
# Half of all who pass somewhere run a marathon at the world's best pace (5.8 m/s, rounded down) nowhere.
FASTEST_M_S, MIN_FAST, MOST_TRACKS = 5.0, 3, 200
_SPEEDS = """
WITH chosen AS (
    SELECT track_id FROM tracks
    WHERE recording_id = $recording AND camera = $camera AND class_name = $class
        AND last_time_ns - first_time_ns >= 200_000_000
    ORDER BY hash(track_id), track_id LIMIT $most
), placed AS (
    SELECT o.track_id, f.capture_time_ns AS t, e.x_m, e.y_m
    FROM observations AS o
    SEMI JOIN chosen USING (track_id)
    JOIN estimates AS e ON e.recording_id = o.recording_id
        AND e.observation_index = o.observation_index
    JOIN frames AS f ON f.recording_id = o.recording_id AND f.camera = o.camera
        AND f.frame_index = o.frame_index
    WHERE o.recording_id = $recording AND o.camera = $camera AND e.run_id = $run
        AND e.method = 'fused' AND isfinite(e.x_m) AND isfinite(e.y_m)
)
SELECT
    sqrt((arg_max(x_m, t) - arg_min(x_m, t)) ** 2 + (arg_max(y_m, t) - arg_min(y_m, t)) ** 2)
    / ((max(t) - min(t)) / 1e9) AS speed_m_s
FROM placed GROUP BY track_id HAVING max(t) - min(t) >= 200_000_000
ORDER BY track_id
"""
ALARM = 3.0**2  # by which the explanation must be better than none
MEDIAN = 1.25  # the deviation of a median over that of a mean


def clock_notes(
    camera: str, cadences: pa.Table, plane: GroundPlane | None, config: Config
) -> list[Diagnostic]:
    """Return a note if the clock of the frames, or the scale of a given pose, is impossible.

    Args:
        camera: its name.
        cadences: its rows of `track_cadences`, those of impossible cadences among them.
        plane: its pose, None if unknown.
        config: the configuration of this camera (`Config.of_camera`).
    """
    hz = np.asarray(cadences["cadence_hz"].to_numpy(), dtype=np.float64)
    if len(hz) < MIN_TRACKS:
        return []
    speed = np.asarray(cadences["speed_m_s"].to_numpy(), dtype=np.float64)
    if plane is None:
        speed = np.full(len(hz), np.nan)
    log_hz = np.log(hz / CADENCE_HZ)
    group_std = CADENCE_GROUP_STD if np.median(log_hz) > 0 else STROLLING_STD
    fast, fast_std = _median(log_hz, group_std, CADENCE_PERSON_STD)
    with np.errstate(invalid="ignore", divide="ignore"):
        beside = np.log(speed / SPEED_M_S) - EXPONENT * np.log(hz / CADENCE_HZ)
    far, far_std = _median(beside[np.isfinite(beside)], SPEED_GROUP_STD, SPEED_PERSON_STD)
    far_std = math.hypot(far_std, _scale_std(plane, config))
    nothing = (fast / fast_std) ** 2 + (far / far_std) ** 2
    # One factor of the clock for both: least squares of fast = r, far = (1 - 1.5) r.
    lag = 1 - EXPONENT
    weight = fast_std**-2 + (lag / far_std) ** 2
    clock = (fast / fast_std**2 + lag * far / far_std**2) / weight
    by_clock = ((fast - clock) / fast_std) ** 2 + ((far - lag * clock) / far_std) ** 2
    by_scale = (fast / fast_std) ** 2
    if nothing - by_clock > ALARM and by_clock <= by_scale:
        return [_clock(camera, hz, math.exp(clock), weight**-0.5)]
    given = plane is not None and plane.source != "walkers"
    if given and nothing - by_scale > ALARM:
        return [_scale(camera, hz, math.exp(far), far_std)]
    return []


def speed_notes(
    store: Store, recording_id: str, run_id: str, camera: str, object_class: str
) -> list[Diagnostic]:
    """Return a note if people are faster than people can be: the clock, the scale or the class is wrong.

    Args:
        store: a database that is open, with the estimates of the run.
        recording_id: the recording.
        run_id: the run.
        camera: name of the camera.
        object_class: the class of those who walk.
    """
    values = {
        "recording": recording_id,
        "run": run_id,
        "camera": camera,
        "class": object_class,
        "most": MOST_TRACKS,
    }
    found = store.connection.sql(_SPEEDS, params=values).to_arrow_table()
    speeds = found["speed_m_s"].to_numpy()
    if len(speeds) < MIN_FAST or np.median(speeds) < FASTEST_M_S:
        return []
    return [
        Diagnostic(
            Severity.WARNING,
            "impossible_speeds",
            f"half of {len(speeds)} tracks of {object_class!r} move at more than "
            f"{np.median(speeds):.1f} m/s: the clock of the frames runs too fast, the "
            f"distances are too "
            "long, or these are no people. Check the frame rate, the lens and the camera's height",
            camera=camera,
            count=len(speeds),
        )
    ]


def _median(values: np.ndarray, group_std: float, person_std: float) -> tuple[float, float]:
    """Return the median of the people here, and its deviation from that of people anywhere."""
    if len(values) < MIN_TRACKS:
        return 0.0, 1e3
    return float(np.median(values)), math.hypot(
        group_std, MEDIAN * person_std / math.sqrt(len(values))
    )


def _scale_std(plane: GroundPlane | None, config: Config) -> float:
    prior = config.stature
    if plane is None or plane.source != "walkers" or prior is None:
        return GIVEN_SCALE_STD
    return prior.mean_uncertainty_m / prior.mean_m


def _clock(camera: str, hz: np.ndarray, factor: float, std: float) -> Diagnostic:
    return Diagnostic(
        Severity.WARNING,
        "frame_rate_contradicted",
        f"{len(hz)} people take {np.median(hz):.2f} steps a second, which does not go with "
        f"how people walk: the clock of the frames seems to run {factor:.2f} \u00b1 "
        f"{factor * std:.2f} times as fast as it should (one "
        "standard error). Depths and heights do not depend on it, speeds do; import the video "
        "again "
        "with its true frame rate",
        camera=camera,
        count=len(hz),
    )


def _scale(camera: str, hz: np.ndarray, factor: float, std: float) -> Diagnostic:
    return Diagnostic(
        Severity.WARNING,
        "scale_contradicted",
        f"{len(hz)} people who take {np.median(hz):.2f} steps a second would walk {factor:.2f} "
        f"\u00b1 "
        f"{factor * std:.2f} times as fast as people do: distances by the given pose "
        "seem too large by that factor (one standard error). Check the unit and the height of "
        "the camera",
        camera=camera,
        count=len(hz),
    )
