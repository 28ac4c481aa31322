"""Lanes of states over time: each track seen, hidden or predicted; exposure, pictures, diagnostics.

A lane is a slot (`dashboards.timeline.slots`): one track after another, each bar with the number of
its track.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt
import pyarrow as pa
import pyarrow.compute as pc
import rerun as rr

from dashboards.style import DIM, ERROR, OK, WARNING, Colours, packed
from dashboards.timeline.columns import CameraRows, Frames
from dashboards.timeline.names import path, title
from dashboards.timeline.slots import SLOTS
from dashboards.timeline.stream import clocks
from pipeline.core.arrays import IntArray

SEEN, HIDDEN, PREDICTED = range(3)
STATES = ("", " hidden", " predicted")
# How bright a bar is beside the colour of its track.
SHARES = (0.85, 0.4)
# A bar shorter than this share of the recording has no room for a name.
LABEL_SHARE = 0.025
FRAMES_IN_VIEW = 2000  # what the viewer opens with of a longer one
UNNAMED = " "  # ends a state that has no name on its bar
# Kinds of diagnostics in their lane; all are in the log.
DIAGNOSTIC_KINDS = 6
LEVELS = (OK, WARNING, ERROR)
PAIRINGS = {
    "nearest": ("exposure of the frame", OK),
    "last_known": ("last exposure known", WARNING),
    "none": ("no exposure", DIM),
}

Texts = npt.NDArray[np.object_]


def log_lanes(stream: rr.RecordingStream, rows: CameraRows, diagnostics: pa.Table) -> None:
    """Log the lanes of a camera."""
    if not rows.is_series_of_pictures:
        _log_tracks(stream, rows)
    _log_pictures(stream, rows)
    _log_exposure(stream, rows)
    _log_diagnostics(stream, rows, diagnostics)


def _log_tracks(stream: rr.RecordingStream, rows: CameraRows) -> None:
    row, track, state = track_states(rows)
    slot = rows.tracks.slot[track]
    number = rows.tracks.track_id[track].astype(str).astype(object)
    text = "#" + number + np.array(STATES, dtype=object)[np.maximum(state, 0)]
    # A slot goes to its next track in the frame in which the last one ends: that start comes last.
    order = np.lexsort((state >= 0, row, slot))
    shortest = LABEL_SHARE * min(len(rows.frames), FRAMES_IN_VIEW)
    for lane in range(int(rows.tracks.slot.max(initial=-1)) + 1):
        mine = order[slot[order] == lane]
        mine = mine[np.append(np.diff(row[mine]) > 0, True)]
        length = np.diff(np.append(row[mine], len(rows.frames)))
        long, there = length >= shortest, state[mine] >= 0
        states = text[mine] + np.where(long, "", UNNAMED)
        states[~there] = None
        values, first = np.unique(states[there].astype(str), return_index=True)
        kinds, owners = state[mine][there][first], track[mine][there][first]
        _send(
            stream,
            _lane(rows.name, f"tracks_{lane + 1:02d}"),
            rows.frames,
            row[mine],
            states,
            (values.tolist(), _bar_colours(rows.tracks.colour[owners], kinds)),
        )


def _bar_colours(colour: Colours, state: IntArray) -> Colours:
    bars = np.tile(np.array(DIM, dtype=np.uint8), (len(state), 1))
    for kind in (SEEN, HIDDEN):
        bars[state == kind] = colour[state == kind] * SHARES[kind]
    return bars


def track_states(rows: CameraRows) -> tuple[IntArray, IntArray, IntArray]:
    """Return the changes of state: frame by position, track, and state; -1 where a track ends.

    A track is predicted where it has no observation between those that it has.
    """
    seen = rows.observations
    order = np.lexsort((seen.row, seen.track))
    row, track = seen.row[order], seen.track[order]
    state = np.where(seen.hidden[order], HIDDEN, SEEN)
    same = np.diff(track) == 0
    gap = same & (np.diff(row) > 1)
    goes_on = same & ~gap & (np.diff(state) == 0)
    starts = ~np.concatenate([[False], goes_on]) if len(row) else np.empty(0, dtype=np.bool_)
    away, ends = np.flatnonzero(gap), np.flatnonzero(~np.append(same, False))[: len(row)]
    ends = ends[row[ends] + 1 < len(rows.frames)]
    return (
        np.concatenate([row[starts], row[away] + 1, row[ends] + 1]),
        np.concatenate([track[starts], track[away], track[ends]]),
        np.concatenate([state[starts], np.full(len(away), PREDICTED), np.full(len(ends), -1)]),
    )


def _log_pictures(stream: rr.RecordingStream, rows: CameraRows) -> None:
    decoded = pc.fill_null(rows.frames.table["decoded"], False).to_numpy()
    if decoded.all():
        return
    text = np.where(decoded, "picture", "picture lost").astype(object)
    style = (["picture", "picture lost"], np.array([OK, ERROR], dtype=np.uint8))
    _send_changes(stream, _lane(rows.name, "pictures"), rows.frames, text, style)


def _log_exposure(stream: rr.RecordingStream, rows: CameraRows) -> None:
    pairing = rows.frames.table["exposure_pairing"].to_numpy()
    known = [name for name in PAIRINGS if (pairing == name).any()]
    if known in (
        ["nearest"],
        ["none"],
    ):  # nothing changes, and the text about the recording says it
        return
    text = np.full(len(pairing), None, dtype=object)
    for name in known:
        text[pairing == name] = PAIRINGS[name][0]
    style = (
        [PAIRINGS[name][0] for name in known],
        np.array([PAIRINGS[name][1] for name in known], dtype=np.uint8),
    )
    _send_changes(stream, _lane(rows.name, "exposure"), rows.frames, text, style)


def _send_changes(
    stream: rr.RecordingStream,
    entity: str,
    frames: Frames,
    text: Texts,
    style: tuple[list[str], Colours],
) -> None:
    changes = np.flatnonzero(np.append([True], text[1:] != text[:-1]))
    _send(stream, entity, frames, changes, text[changes], style)


def _log_diagnostics(stream: rr.RecordingStream, rows: CameraRows, diagnostics: pa.Table) -> None:
    """Log in one lane which kinds of diagnostics cover each frame, those that matter most."""
    weight = {"error": 2, "warning": 1}
    kinds: dict[str, list[Mapping[str, Any]]] = {}
    for note in diagnostics.to_pylist():
        mine = note["camera"] in (None, rows.camera["camera"])
        if note["log_time_ns"] is not None and mine:
            kinds.setdefault(str(note["code"]), []).append(note)
    severity = {code: max(weight.get(n["severity"], 0) for n in ns) for code, ns in kinds.items()}
    shown = sorted(kinds, key=lambda code: (-severity[code], -len(kinds[code])))[:DIAGNOSTIC_KINDS]
    if not shown:
        return
    covered = np.stack([_covered(rows.frames, kinds[code]) for code in shown])  # (kinds, frames)
    together = (covered << np.arange(len(shown))[:, None]).sum(axis=0)
    texts, colours = {}, {}
    for key in np.unique(together[together > 0]).tolist():
        there = [code for bit, code in enumerate(shown) if key >> bit & 1]
        texts[key] = title(", ".join(there))
        colours[texts[key]] = LEVELS[max(severity[code] for code in there)]
    states = np.array([texts.get(key) for key in together.tolist()], dtype=object)
    style = (list(colours), np.array(list(colours.values()), dtype=np.uint8))
    _send_changes(stream, _lane(rows.name, "diagnostics"), rows.frames, states, style)


def _covered(frames: Frames, notes: list[Mapping[str, Any]]) -> IntArray:
    """Return 1 for each frame that lies in the time of any of the notes, else 0."""
    log_time_ns = np.maximum.accumulate(frames.log_time_ns)
    begin_ns = np.array([note["log_time_ns"] for note in notes])
    end_ns = np.array([note["end_time_ns"] or note["log_time_ns"] for note in notes])
    first = np.searchsorted(log_time_ns, begin_ns, side="right") - 1
    last = np.searchsorted(log_time_ns, end_ns, side="right") - 1
    steps = np.zeros(len(log_time_ns) + 1, dtype=np.int64)
    np.add.at(steps, np.maximum(first, 0), 1)
    np.add.at(steps, np.maximum(last, 0) + 1, -1)
    return (np.cumsum(steps)[:-1] > 0).astype(np.int64)


def log_marks(
    stream: rr.RecordingStream, rows: CameraRows, lane: str, row: IntArray, texts: list[str]
) -> None:
    """Log a lane with a mark a frame wide at some frames; `row` ascends."""
    text = np.full(len(rows.frames), None, dtype=object)
    text[row] = texts
    values = list(dict.fromkeys(texts))
    style = (values, np.tile(np.array(ERROR, dtype=np.uint8), (len(values), 1)))
    _send_changes(stream, _lane(rows.name, lane), rows.frames, text, style)


def _lane(camera: str, name: str) -> str:
    return path("cameras", camera, "lanes", name)


def _send(
    stream: rr.RecordingStream,
    entity: str,
    frames: Frames,
    row: IntArray,
    states: Texts,
    style: tuple[list[str], Colours],
) -> None:
    """Send changes of state; None ends the state before."""
    values, colours = style
    there = np.array([state is not None for state in states])
    if not there.any():
        return
    stream.log(
        entity,
        rr.StateConfiguration(
            values=values,
            labels=[" " if value.endswith(UNNAMED) else value for value in values],
            colors=packed(colours),
        ),
        static=True,
    )
    columns = rr.StateChange.columns(state=states[there].tolist())
    stream.send_columns(
        entity,
        clocks(frames, row),
        columns.partition(there.astype(np.int64)),
    )


def lane_count(rows: CameraRows) -> int:
    """Return how many lanes of tracks there are."""
    return (
        0 if rows.is_series_of_pictures else min(int(rows.tracks.slot.max(initial=-1)) + 1, SLOTS)
    )
