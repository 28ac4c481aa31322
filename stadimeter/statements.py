"""The statement on one person or pair, and the page on which they are marked by hand."""

from __future__ import annotations

import json
import math
import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pipeline.core.errors import UsageError
from pipeline.estimate.track_heights import HALF_WIDTH
from stadimeter.arguments import PathLike

if TYPE_CHECKING:
    from dashboards.statement.pictures import Shown
    from dashboards.statement.writer import Part, Sheet
    from pipeline.images.decode import Image
    from pipeline.statement.evidence import Evidence
    from pipeline.statement.marks import Marked
    from pipeline.statement.sensitivity import Change
    from pipeline.store.database import Store

MARK_FRAMES = 5
_PARTS = (
    ("scale", "scale_share", "the mean stature of the people here, or what is known instead"),
    ("camera", "camera_share", "the rest of the pose, and the lens"),
    ("boxes", "boxes_share", "where the boxes end, in common and by themselves"),
    ("posture", "posture_share", "gait, and the feet of this person"),
    ("doubt", "doubt_share", "the doubt that the track is one person throughout"),
)


def statement(
    db: PathLike,
    track: int,
    output: PathLike,
    *,
    recording: str | None = None,
    camera: str | None = None,
    against: int | None = None,
    reference_height_m: float | None = None,
    marks: PathLike | None = None,
) -> Path:
    """Write the statement on one person, or a pair, as an HTML page for screen and paper.

    Args:
        db: database with the results.
        track: number of the track.
        output: HTML file to write.
        recording: file name, path or id of the recording, where the track's number is there in several.
        camera: name of the camera, likewise.
        against: track of another person of the same camera, whose height is compared.
        reference_height_m: stature that somebody is said to have, whose likelihood is stated.
        marks: CSV of heads and feet marked by hand (`pipeline.statement.marks`); the height then rests
            on them.

    Returns:
        The path of the page.

    Raises:
        UsageError: the track is not there, or an argument is impossible.
        StoreError: the database cannot be read.
        MissingLibrary: the extra `report` is not installed.
        StadimeterError: the file cannot be written.
    """
    from dashboards.statement.writer import write_statement
    from pipeline.statement.evidence import find_subject, read_evidence
    from pipeline.statement.marks import read_marks
    from pipeline.store.database import Store

    if reference_height_m is not None and not 0.5 <= reference_height_m <= 2.75:
        raise UsageError(
            f"a stature of {reference_height_m:g} m: it must be at least 0.5 and at most 2.75 m"
        )
    if against is not None and against == track:
        raise UsageError(f"track {track} cannot be compared with itself")
    with Store.open_current(Path(db)) as store:
        evidence = read_evidence(store, find_subject(store, track, recording, camera))
        if not evidence.frames:
            raise UsageError(
                f"track {track} has no distance in any frame, so there is nothing to state",
                remedy="`stadimeter query --view diagnostics` says why",
            )
        marked = None if marks is None else _marked(evidence, read_marks(Path(marks)))
        command = [
            *("stadimeter", "statement", "--db", str(db), "--track", str(track)),
            *(("--against", str(against)) if against is not None else ()),
            *(("--reference-height", f"{reference_height_m:g}") if reference_height_m else ()),
            *(("--marks", str(marks)) if marks is not None else ()),
        ]
        sheet = _sheet(store, evidence, against, reference_height_m, marked, command)
    write_statement(sheet, Path(output))
    return Path(output)


def marks_page(
    db: PathLike,
    track: int,
    output: PathLike,
    *,
    recording: str | None = None,
    camera: str | None = None,
) -> Path:
    """Write a page with frames of a track on which a person clicks head and feet.

    Raises:
        UsageError: the track is not there, or its recording cannot be read.
        StoreError: the database cannot be read.
        StadimeterError: the file cannot be written.
    """
    from dashboards.statement.pictures import best_frames, encoded
    from dashboards.statement.writer import write_marks_page
    from pipeline.statement.evidence import find_subject, read_evidence
    from pipeline.store.database import Store

    with Store.open_current(Path(db)) as store:
        evidence = read_evidence(store, find_subject(store, track, recording, camera))
        chosen = best_frames(evidence.frames, MARK_FRAMES)
        pictures = _pictures(store, evidence, chosen)
    if not pictures:
        raise UsageError(f"no picture of {evidence.recording['path']} could be read")
    shown = [encoded(picture, index) for index, picture in sorted(pictures.items())]
    sides = ("x_min_px", "y_min_px", "x_max_px", "y_max_px")
    boxes = {f["frame_index"]: [f[side] for side in sides] for f in chosen}
    write_marks_page(shown, boxes, evidence.recording["file_name"], track, Path(output))
    return Path(output)


def _marked(evidence: Evidence, marks: list[Any]) -> Marked:
    from pipeline.statement.marks import measure_marks

    lens, plane = evidence.camera.intrinsics, evidence.plane
    if lens is None or plane is None:
        raise UsageError(
            "marks need the camera's lens and pose, and they are not known",
            remedy="Give them in a camera file and run `stadimeter estimate`",
        )
    return measure_marks(marks, lens, plane)


def _pictures(
    store: Store, evidence: Evidence, chosen: Sequence[Mapping[str, Any]]
) -> dict[int, Image]:
    from dashboards.statement.pictures import read_pictures

    if evidence.file is None:
        return {}
    indexes = [f["frame_index"] for f in chosen]
    camera = evidence.subject.camera
    row = evidence.recording
    return read_pictures(store, row, evidence.file, camera, indexes, evidence.config)


def _sheet(
    store: Store,
    evidence: Evidence,
    against: int | None,
    reference_height_m: float | None,
    marked: Marked | None,
    command: Sequence[str],
) -> Sheet:
    from dashboards.statement.chart import heights_chart
    from dashboards.statement.words import POSES, UNPOSED, points
    from dashboards.statement.writer import Sheet
    from pipeline.statement.evidence import difference
    from pipeline.statement.likelihood import weight_of
    from pipeline.statement.sensitivity import sensitivities

    height_m, std_m, low_m, high_m = _height(evidence, marked)
    changes = sensitivities(store, evidence) if marked is None else []
    pictures = _shown(store, evidence)
    compared: tuple[Mapping[str, Any] | None, float | None] = (None, None)
    if against is not None:
        compared = difference(store, evidence.subject, against)
    prior = evidence.config.of_camera(evidence.subject.camera).stature
    population = (prior.mean_m, prior.std_m) if prior is not None else (math.nan, math.nan)
    weight = None
    if reference_height_m is not None:
        if height_m is None or prior is None:
            raise UsageError(
                "no height was measured, so nothing can be said of a stated stature: "
                + _no_height(evidence)
            )
        weight = weight_of(height_m, std_m, reference_height_m, population)
    frames = evidence.frames
    middle = sorted(frames, key=lambda f: f["depth_m"])[len(frames) // 2]
    same = _is_same(evidence)
    source = evidence.pose["pose_source"] or ""
    best = evidence.height
    chart = ""
    if height_m is not None and marked is None and low_m is not None and high_m is not None:
        chart = heights_chart(frames, low_m, high_m, height_m)
    return Sheet(
        track_id=evidence.subject.track_id,
        against=against,
        file_name=evidence.recording["file_name"],
        camera=evidence.subject.camera,
        warnings=[n for n in evidence.notes if n["severity"] != "info"],
        findings=[n for n in evidence.notes if n["severity"] == "info"],
        height_m=height_m,
        height_low_m=low_m,
        height_high_m=high_m,
        half_cm=100 * HALF_WIDTH * std_m,
        no_height=_no_height(evidence),
        depth_m=middle["depth_m"],
        depth_low_m=middle["depth_low_m"],
        depth_high_m=middle["depth_high_m"],
        difference=compared[0],
        taller=compared[1],
        weight=weight,
        population=population,
        items=_items(evidence, same=same),
        pictures=pictures,
        no_pictures=f"The recording is not at {evidence.recording['path']} any more, or cannot be read; "
        "run the command again where it is.",
        budget=_budget(evidence, marked, changes),
        changes=changes,
        pose_text=POSES.get(source, UNPOSED),
        marked=marked,
        program_height_m=best["height_m"] if best else None,
        chart=chart,
        frames=frames,
        points=points(
            has_pictures=bool(pictures),
            pose=source,
            marked=marked is not None,
            repeated=marked is not None and marked.repeated,
            references=marked.references if marked else 0,
            file_checked=same,
        ),
        tables_sha256=evidence.recording["tables_sha256"],
        commands=_commands(evidence, command),
        settings=json.dumps(json.loads(evidence.run["configuration"]), indent=1),
        libraries=evidence.run["libraries"] or "",
    )


def _height(
    evidence: Evidence, marked: Marked | None
) -> tuple[float | None, float, float | None, float | None]:
    """Return height, deviation and interval; None where no height was measured."""
    if marked is not None:
        half_m = HALF_WIDTH * marked.std_m
        return marked.height_m, marked.std_m, marked.height_m - half_m, marked.height_m + half_m
    best = evidence.height
    if best is None or best["height_assumed"] or best["height_m"] is None:
        return None, math.nan, None, None
    return best["height_m"], best["height_std_m"], best["height_low_m"], best["height_high_m"]


def _no_height(evidence: Evidence) -> str:
    best = evidence.height
    if best is not None and best["height_assumed"]:
        return (
            f"the height of {best['height_m']:.2f} m was assumed to find the distance, as the "
            f"pose of the "
            "camera is not known; an assumption is no measurement"
        )
    return "the best method has no height for this track"


def _budget(evidence: Evidence, marked: Marked | None, changes: Sequence[Change]) -> list[Part]:
    from dashboards.statement.writer import Part
    from pipeline.statement.evidence import half_width_cm

    if marked is not None:
        parts = [
            ("pose", marked.pose_std_m, "height above the ground, tilt and roll of the camera"),
            ("marks", marked.marks_std_m, "the person's hand, by the repeats"),
            (
                "frames",
                marked.between_frames_std_m,
                "posture: the frames differ by it (in the marks)",
            ),
            ("references", marked.scale_std_m, "the marks of things of known length"),
        ]
        return [Part(n, 100 * HALF_WIDTH * std_m, what) for n, std_m, what in parts if std_m > 0]
    best = evidence.height
    if best is None or best["height_assumed"] or best["height_m"] is None:
        return []
    std_m = best["height_std_m"]
    if best["scale_share"] is None:  # of a pose that is given, what each of its deviations does
        pose_m = math.hypot(*(c.height_change_m for c in changes if c.of_pose))
        rest_m = math.sqrt(max(std_m**2 - pose_m**2, 0.0))
        return [
            Part(
                "pose", 100 * HALF_WIDTH * min(pose_m, std_m), "its stated deviations, as if apart"
            ),
            Part("boxes, posture, doubt", 100 * HALF_WIDTH * rest_m, "of this track"),
        ]
    return [Part(name, half_width_cm(best[share], std_m), what) for name, share, what in _PARTS]


def _shown(store: Store, evidence: Evidence) -> list[Shown]:
    from dashboards.statement.pictures import best_frames, crop, whole

    chosen = best_frames(evidence.frames)
    read = _pictures(store, evidence, chosen)
    rows = [row for row in chosen if row["frame_index"] in read]
    if not rows:
        return []
    largest = max(rows, key=lambda f: f["y_max_px"] - f["y_min_px"])
    pictures = [whole(read[largest["frame_index"]], largest)]
    return pictures + [crop(read[row["frame_index"]], row) for row in rows]


def _is_same(evidence: Evidence) -> bool | None:
    """Return whether the file is the one that was measured; None if it is not there."""
    from pipeline.mcap_file.bag import sha256_of

    if evidence.file is None:
        return None
    return sha256_of(evidence.file) == str(evidence.recording["content_sha256"])


def _items(evidence: Evidence, *, same: bool | None) -> list[tuple[str, str]]:
    from dashboards.report.writer import clock

    recording, pose = evidence.recording, evidence.pose
    checked = {
        True: "hashed again now: unchanged",
        False: "HAS CHANGED SINCE",
        None: "not there now",
    }
    lens = "unknown"
    if pose["fx_px"] is not None:
        lens = f"focal length {pose['fx_px']:.1f} px ({pose['intrinsics_source']})"
    place = "unknown"
    if pose["camera_height_m"] is not None:
        place = (
            f"{pose['camera_height_m']:.2f} m above the ground, tilt "
            f"{math.degrees(pose['tilt_rad']):.2f}, roll "
            f"{math.degrees(pose['roll_rad'] or 0):.2f} degrees "
            f"({pose['pose_source']})"
        )
    first, last = evidence.frames[0], evidence.frames[-1]
    return [
        ("file", f"{recording['file_name']}, {recording['size_bytes']:,} bytes ({checked[same]})"),
        ("SHA-256", recording["content_sha256"]),
        (
            "recorded",
            f"{clock(recording['start_time_ns'])} to {clock(recording['end_time_ns'])} UTC by "
            f"its own clock",
        ),
        (
            "frames",
            f"{recording['frame_count']:,} read, {recording['frames_lost']:,} known to be lost",
        ),
        (
            "camera",
            f"{evidence.subject.camera}, {pose['width_px']} x {pose['height_px']} px; {lens}",
        ),
        ("pose", place),
        (
            "track",
            f"{evidence.subject.track_id}, class {evidence.class_name}, frames "
            f"{first['frame_index']} to "
            f"{last['frame_index']}, {clock(first['capture_time_ns'])} to "
            f"{clock(last['capture_time_ns'])}",
        ),
        (
            "measured by",
            f"stadimeter {evidence.run['software_version']}, run {evidence.run['run_id']}",
        ),
    ]


def _commands(evidence: Evidence, command: Sequence[str]) -> list[str]:
    label = evidence.run["command"]
    run = f"stadimeter run {shlex.quote(evidence.recording['file_name'])} --db again.duckdb"
    lines = [run + "    # with the settings below as the camera file, if they are not the defaults"]
    if label == "estimate":
        lines.append("stadimeter estimate --db again.duckdb --camera camera.toml")
    return [*lines, shlex.join(command), f"stadimeter verify --db {command[3]} --frames 20"]
