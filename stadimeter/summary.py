"""Summary of a run: its cameras, what was measured, what gave no number and why, and every warning."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING, Any

from stadimeter.advice import advice_for

if TYPE_CHECKING:
    from stadimeter.results import Results

# Two-sided 95 % of a normal distribution, in standard deviations.
NORMAL_95 = 1.96
# Findings of severity `info` that say what the numbers rest on; they are told with the warnings.
FOUNDATIONS = (
    "scale_from_statures",
    "scale_from_known_lengths",
    "tilt_from_people",
    "focal_length_from_walkers",
    "rounded_focal_length",
    "class_renamed",
)
# Findings that say why objects have no depth, most telling first.
REASONS = (
    "no_lens_data",
    "pose_refused",
    "pose_undetermined",
    "pose_unused",
    "size_unknown",
    "method_not_applicable",
)


@dataclass(frozen=True, slots=True)
class CameraSummary:
    """Lens and pose of a camera, with their sources; unknown is None. Deviations are one sigma."""

    camera: str
    width_px: int | None
    height_px: int | None
    focal_length_px: float | None
    focal_length_std_px: float | None
    lens_source: str | None
    camera_height_m: float | None
    camera_height_std_m: float | None
    tilt_deg: float | None
    tilt_std_deg: float | None
    roll_deg: float | None
    roll_std_deg: float | None
    pose_source: str | None


@dataclass(frozen=True, slots=True)
class TrackSummary:
    """Depth and height of a tracked object by the method that assumes least; unknown is None.

    `depth_m` is the median along the track, `_low` and `_high` are the ends of 95 % intervals.
    """

    camera: str
    track_id: int
    class_name: str | None
    frames: int
    method: str
    depth_min_m: float | None
    depth_m: float | None
    depth_low_m: float | None
    depth_high_m: float | None
    depth_max_m: float | None
    height_m: float | None
    height_low_m: float | None
    height_high_m: float | None
    height_assumed: bool
    height_plausible: bool | None


@dataclass(frozen=True, slots=True)
class Unmeasured:
    """Objects of a class that have no depth, in `count` of `seen` observations, and the reasons."""

    camera: str
    class_name: str | None
    count: int
    seen: int
    reasons: tuple[str, ...]
    advice: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Finding:
    """A diagnostic of one or several recordings, with what to do about it.

    `topic` and `byte_offset` are the place where it was met first, in the first of `recordings`.
    """

    severity: str
    code: str
    message: str
    advice: str
    count: int
    recordings: tuple[str, ...]
    topic: str | None = None
    byte_offset: int | None = None


@dataclass(frozen=True, slots=True)
class RecordingSummary:
    """Results of one recording."""

    recording_id: str
    file_name: str
    frames: int
    frames_lost: int
    damaged: bool
    cameras: tuple[CameraSummary, ...] = ()
    tracks: tuple[TrackSummary, ...] = ()
    unmeasured: tuple[Unmeasured, ...] = ()

    @property
    def is_empty(self) -> bool:
        """Return True if not a single distance came out."""
        return not any(track.depth_m is not None for track in self.tracks)


@dataclass(frozen=True, slots=True)
class RunSummary:
    """Results of a run, recording by recording, and its findings, the gravest first."""

    run_id: str
    recordings: tuple[RecordingSummary, ...]
    findings: tuple[Finding, ...] = field(default=())

    @property
    def warnings(self) -> list[Finding]:
        """Findings that cost a number or put one in doubt."""
        return [f for f in self.findings if f.severity in ("warning", "error")]

    @property
    def in_doubt(self) -> bool:
        """Return True if a recording gave no distance, or anything of the run is in doubt."""
        return bool(self.warnings) or any(one.is_empty for one in self.recordings)

    def as_dict(self) -> dict[str, Any]:
        """Return everything as dictionaries and lists, for JSON; unknown is None."""
        tree = asdict(self)
        for one, summary in zip(tree["recordings"], self.recordings, strict=True):
            one["is_empty"] = summary.is_empty
        return tree | {"in_doubt": self.in_doubt}


def summarize(
    results: Results, run_id: str | None = None, recording_ids: Sequence[str] | None = None
) -> RunSummary:
    """Return what a run found.

    Args:
        results: open database.
        run_id: id of the run; None takes the newest.
        recording_ids: stored recordings to tell of, in that order; None takes all that it estimated.

    Raises:
        UsageError: the database is none that `measure` made.
    """
    if run_id is None:
        newest = results.query("FROM runs ORDER BY started_at DESC, run_id LIMIT 1").rows()
        run_id = newest[0]["run_id"] if newest else ""
    if recording_ids is None:
        found = results.query(_OF_RUN, [run_id]).rows()
        recording_ids = [row["recording_id"] for row in found]
    ids = list(recording_ids)
    by_id = {
        row["recording_id"]: row
        for row in results.query(
            "FROM recordings WHERE list_contains(?, recording_id)", [ids]
        ).rows()
    }
    cameras, tracks, unmeasured = (
        _grouped(results.query(sql, [ids, *more]).rows())
        for sql, more in (
            (_CAMERAS, ()),
            (_TRACKS, (_methods(), run_id, NORMAL_95)),
            (_UNMEASURED, (run_id,)),
        )
    )
    notes = results.query(_NOTES, [run_id]).rows()
    return RunSummary(
        run_id,
        tuple(
            RecordingSummary(
                one,
                by_id[one]["file_name"],
                by_id[one]["frame_count"],
                by_id[one]["frames_lost"],
                by_id[one]["damaged"],
                tuple(CameraSummary(**row) for row in cameras.get(one, [])),
                tuple(TrackSummary(**row) for row in tracks.get(one, [])),
                tuple(_with_reasons(row, one, notes) for row in unmeasured.get(one, [])),
            )
            for one in ids
            if one in by_id
        ),
        tuple(_findings(notes, len(ids))),
    )


def _methods() -> list[str]:
    from pipeline.estimate.methods import NAMES

    return list(NAMES)


def _grouped(rows: list[dict[str, Any]]) -> dict[str, list[dict[str, Any]]]:
    """Return rows by their recording, without that column."""
    groups: dict[str, list[dict[str, Any]]] = {}
    for row in rows:
        groups.setdefault(row.pop("recording_id"), []).append(row)
    return groups


def _with_reasons(
    row: dict[str, Any], recording_id: str, notes: list[dict[str, Any]]
) -> Unmeasured:
    """Return objects without depth with what the diagnostics say about them."""
    found: dict[str, str] = {}
    for code in REASONS:
        for note in notes:
            mine = note["recording_id"] == recording_id and note["camera"] in (None, row["camera"])
            of_class = code not in ("size_unknown", "method_not_applicable")
            of_class = of_class or f"'{row['class_name']}'" in note["message"]
            if note["code"] == code and mine and of_class:
                found.setdefault(note["message"], advice_for(code))
    advice = dict.fromkeys(text for text in found.values() if text)
    return Unmeasured(**row, reasons=tuple(found), advice=tuple(advice))


def _matched_nowhere(notes: list[dict[str, Any]], recordings: int) -> set[str]:
    """Return the entries of the camera file that match no camera of any recording."""
    places: dict[str, set[str]] = {}
    for note in notes:
        if note["code"] == "unmatched_camera":
            places.setdefault(note["camera"], set()).add(note["recording_id"])
    return {entry for entry, found in places.items() if len(found) >= recordings}


def _findings(notes: list[dict[str, Any]], recordings: int) -> list[Finding]:
    """Return warnings, errors and foundations, equal ones of several recordings as one."""
    gravity = {"error": 0, "warning": 1, "info": 2}
    groups: dict[tuple[str, str, str], list[dict[str, Any]]] = {}
    nowhere = _matched_nowhere(notes, recordings)
    for note in notes:
        if note["code"] == "unmatched_camera" and note["camera"] in nowhere:
            note["severity"] = "error"
        if note["severity"] != "info" or note["code"] in FOUNDATIONS:
            key = (note["severity"], note["code"], note["message"])
            groups.setdefault(key, []).append(note)
    found = [
        Finding(
            severity,
            code,
            message,
            advice_for(code),
            sum(note["count"] for note in group),
            tuple(dict.fromkeys(note["file_name"] or "" for note in group)),
            group[0]["topic"],
            group[0]["byte_offset"],
        )
        for (severity, code, message), group in groups.items()
    ]
    return sorted(found, key=lambda f: gravity.get(f.severity, 3))


_OF_RUN = """
    SELECT recording_id FROM recordings
    WHERE run_id = $1 OR recording_id IN (SELECT recording_id FROM track_heights WHERE run_id = $1)
    ORDER BY file_name, recording_id
"""

_CAMERAS = """
    SELECT recording_id, camera, width_px, height_px, fx_px AS focal_length_px,
        focal_std_px AS focal_length_std_px, intrinsics_source AS lens_source,
        camera_height_m, camera_height_std_m,
        degrees(tilt_rad) AS tilt_deg, degrees(tilt_std_rad) AS tilt_std_deg,
        degrees(roll_rad) AS roll_deg, degrees(roll_std_rad) AS roll_std_deg, pose_source
    FROM cameras WHERE list_contains(?, recording_id) ORDER BY camera
"""

# The interval of a depth is multiplicative: it stays positive however wide it is.
_TRACKS = """
    WITH best AS (
        FROM track_heights
        WHERE list_contains($1, recording_id) AND run_id = $3
        QUALIFY row_number() OVER (
            PARTITION BY recording_id, camera, track_id ORDER BY list_position($2, method)
        ) = 1
    ), depths AS (
        SELECT e.recording_id, o.camera, o.track_id, e.method,
            median(e.depth_m) AS depth_m, median(e.depth_std_m / e.depth_m) AS relative_std
        FROM estimates AS e JOIN observations AS o USING (recording_id, observation_index)
        WHERE list_contains($1, e.recording_id) AND e.run_id = $3 AND e.depth_m > 0
        GROUP BY ALL
    )
    SELECT b.recording_id, b.camera, b.track_id, t.class_name, b.observation_count AS frames, b.method,
        b.depth_min_m, b.depth_median_m AS depth_m,
        b.depth_median_m * exp(-$4 * d.relative_std) AS depth_low_m,
        b.depth_median_m * exp($4 * d.relative_std) AS depth_high_m,
        b.depth_max_m, b.height_m,
        greatest(b.height_m - $4 * b.height_std_m, 0) AS height_low_m,
        b.height_m + $4 * b.height_std_m AS height_high_m,
        coalesce(b.height_assumed, false) AS height_assumed, b.height_plausible
    FROM best AS b
    LEFT JOIN depths AS d USING (recording_id, camera, track_id, method)
    LEFT JOIN tracks AS t USING (recording_id, camera, track_id)
    ORDER BY b.camera, b.track_id
"""

_UNMEASURED = """
    SELECT o.recording_id, o.camera, o.class_name,
        count(*) FILTER (WHERE e.observation_index IS NULL)::INTEGER AS count, count(*)::INTEGER AS seen
    FROM observations AS o
    LEFT JOIN (
        SELECT DISTINCT recording_id, observation_index FROM estimates
        WHERE run_id = $2 AND depth_m IS NOT NULL
    ) AS e USING (recording_id, observation_index)
    WHERE list_contains($1, o.recording_id)
    GROUP BY ALL HAVING count > 0 ORDER BY count DESC
"""

_NOTES = """
    SELECT recording_id, file_name, severity, code, message, camera, sum(count)::BIGINT AS count,
        arg_min(topic, rowid) AS topic, arg_min(byte_offset, rowid) AS byte_offset
    FROM diagnostics WHERE run_id = ? GROUP BY ALL ORDER BY min(rowid)
"""
