"""Tracks of a stored recording against its truth: the rows of the table `tracking_accuracy`."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import pandas as pd
import pyarrow as pa
from scipy.optimize import linear_sum_assignment

from pipeline.core.arrays import BoolArray, FloatArray
from pipeline.store.database import Store
from pipeline.truth.tracking_metrics import (
    OVERLAPS,
    USUAL_OVERLAP,
    Counts,
    Labelled,
    compare,
    overlaps,
)

# The bins of depth of `accuracy.metrics`.
EDGES_M = (0, 0.25, 0.5, 0.75, 1, 1.5, 2, 3, 5, 7.5, 10, 15, 20, 30, 40, 60, 100, np.inf)
# A box that lies in an ignored region by more than this share of itself is not counted.
IGNORED_SHARE = 0.5
_SIDES = ["x_min_px", "y_min_px", "x_max_px", "y_max_px"]
_TRUE = """
SELECT camera, frame_index, object_id AS identity, class_name, depth_m, x_min_px, y_min_px, x_max_px,
    y_max_px
FROM ground_truth WHERE recording_id = $recording AND x_max_px > x_min_px AND y_max_px > y_min_px
"""
_FOUND = """
SELECT camera, frame_index, track_id AS identity, class_name, depth_m, x_min_px, y_min_px, x_max_px,
    y_max_px
FROM observations
SEMI JOIN (
    SELECT camera, frame_index FROM labelled_frames WHERE recording_id = $recording
    UNION SELECT camera, frame_index FROM ground_truth WHERE recording_id = $recording
) USING (camera, frame_index)
LEFT JOIN (
    SELECT observation_index, depth_m
    FROM estimates SEMI JOIN main.current_run USING (recording_id, run_id)
    WHERE recording_id = $recording AND method = 'fused'
) USING (observation_index)
WHERE recording_id = $recording
ORDER BY camera, frame_index, observation_index
"""
_IGNORED = """
SELECT camera, first_frame_index, last_frame_index, x_min_px, y_min_px, x_max_px, y_max_px
FROM ignore_regions WHERE recording_id = $recording
"""


def judge_tracking(store: Store, recording_id: str) -> None:
    """Replace a recording's rows of `tracking_accuracy`; call inside a transaction.

    Recordings without true boxes have none.
    """
    connection = store.connection
    connection.execute("DELETE FROM tracking_accuracy WHERE recording_id = ?", [recording_id])
    values = {"recording": recording_id}
    true = connection.sql(_TRUE, params=values).to_arrow_table()
    if not true.num_rows:
        return
    found, ignored = (
        connection.sql(sql, params=values).to_arrow_table() for sql in (_FOUND, _IGNORED)
    )
    rows = pa.Table.from_pylist(
        list(_rows(recording_id, true.to_pandas(), found.to_pandas(), ignored.to_pandas()))
    )
    with store.incoming("incoming", rows):
        connection.execute("INSERT INTO tracking_accuracy BY NAME FROM incoming")


def _rows(
    recording_id: str, true: pd.DataFrame, found: pd.DataFrame, ignored: pd.DataFrame
) -> Iterator[dict[str, object]]:
    """Yield the rows of every camera and group."""
    for camera, mine in true.groupby("camera", sort=True):
        boxes = _countable(
            mine, found[found["camera"] == camera], ignored[ignored["camera"] == camera]
        )
        for group in _groups(mine, boxes):
            counts = compare(_labelled(group.true), _labelled(group.found))
            start = {"recording_id": recording_id, "camera": camera} | group.key
            yield from (start | row for row in _by_overlap(counts))


@dataclass(frozen=True, slots=True)
class _Group:
    """True boxes and found ones that are compared with each other."""

    key: dict[str, object]
    true: pd.DataFrame
    found: pd.DataFrame


def _groups(true: pd.DataFrame, found: pd.DataFrame) -> Iterator[_Group]:
    nothing: dict[str, object] = {
        "class_name": None,
        "true_depth_from_m": None,
        "true_depth_to_m": None,
    }
    yield _Group(nothing | {"grouping": "all"}, true, found)
    for name, mine in true.groupby("class_name", sort=True):
        same = found[found["class_name"] == name]
        yield _Group(nothing | {"grouping": "class", "class_name": name}, mine, same)
    if true["depth_m"].notna().any():
        at = _bins(true, found)
        for number in sorted(set(at[0][at[0] >= 0].tolist())):
            low, high = EDGES_M[number], EDGES_M[number + 1]
            key = {"grouping": "range", "true_depth_from_m": low, "true_depth_to_m": high}
            yield _Group(nothing | key, true[at[0] == number], found[at[1] == number])


def _bins(true: pd.DataFrame, found: pd.DataFrame) -> tuple[np.ndarray, np.ndarray]:
    """Return the bin of depth of each true box, and of each found one; -1 without a depth.

    A box that matches a true one is in its bin.
    """
    depth = found["depth_m"].to_numpy(dtype=np.float64, na_value=np.nan).copy()
    known = true["depth_m"].to_numpy(dtype=np.float64, na_value=np.nan)
    for a, b in _matched(true, found):
        depth[b] = known[a]
    return tuple(
        np.where(np.isfinite(d), np.searchsorted(EDGES_M, d, side="right") - 1, -1)
        for d in (known, depth)
    )  # type: ignore[return-value]


def _countable(true: pd.DataFrame, found: pd.DataFrame, ignored: pd.DataFrame) -> pd.DataFrame:
    """Return the boxes of true classes that lie in no ignored region, or match a true one."""
    classes = set(true["class_name"].dropna())
    kept = found["class_name"].isin(classes) if classes else found["class_name"] != "unknown"
    found = found[kept]
    if not len(ignored):
        return found
    lies_in = _inside(found, ignored)
    for _, b in _matched(true, found):
        lies_in[b] = False
    return found[~lies_in]


def _inside(found: pd.DataFrame, ignored: pd.DataFrame) -> BoolArray:
    box, frame = _boxes(found), found["frame_index"].to_numpy()
    size = (box[:, 2:] - box[:, :2]).prod(axis=1)
    result = np.zeros(len(found), dtype=np.bool_)
    for first, last, *edges in ignored[
        ["first_frame_index", "last_frame_index", *_SIDES]
    ].to_numpy():
        low, high = np.maximum(box[:, :2], edges[:2]), np.minimum(box[:, 2:], edges[2:])
        shared = np.clip(high - low, 0, None).prod(axis=1)
        result |= (frame >= first) & (frame <= last) & (shared > IGNORED_SHARE * size)
    return result


def _matched(true: pd.DataFrame, found: pd.DataFrame) -> Iterator[tuple[int, int]]:
    """Yield positions of true and found boxes that are each other's, at the usual overlap."""
    true_boxes, found_boxes = _boxes(true), _boxes(found)
    of_true = true.reset_index(drop=True).groupby("frame_index").indices
    of_found = found.reset_index(drop=True).groupby("frame_index").indices
    for frame in of_true.keys() & of_found.keys():
        a, b = of_true[frame], of_found[frame]
        shared = overlaps(true_boxes[a], found_boxes[b])
        shared = np.where(shared >= USUAL_OVERLAP, shared, 0.0)
        rows, columns = linear_sum_assignment(shared, maximize=True)
        for i, j in zip(rows, columns, strict=True):
            if shared[i, j] > 0:
                yield int(a[i]), int(b[j])


def _boxes(rows: pd.DataFrame) -> FloatArray:
    return rows[_SIDES].to_numpy(dtype=np.float64)


def _labelled(rows: pd.DataFrame) -> Labelled:
    """Return rows with identities as numbers; of two boxes of one identity in a frame, the first."""
    rows = rows.drop_duplicates(["frame_index", "identity"])
    codes, _ = pd.factorize(rows["identity"], sort=True)
    return Labelled(rows["frame_index"].to_numpy(dtype=np.int64), codes, _boxes(rows))


def _by_overlap(counts: Counts) -> Iterator[dict[str, object]]:
    for i, least in enumerate(OVERLAPS.tolist()):
        usual = least == USUAL_OVERLAP
        matched = int(counts.true_positives[i])
        yield {
            "overlap": least,
            "true_count": matched + int(counts.misses[i]),
            "observed_count": matched + int(counts.false_positives[i]),
            "matched_count": matched,
            "association_sum": float(counts.association[i]),
            "overlap_sum": float(counts.localisation[i]),
            "clear_matched_count": counts.clear_matches if usual else None,
            "switch_count": counts.switches if usual else None,
            "fragment_count": counts.fragments if usual else None,
            "identity_matched_count": counts.identity_true_positives if usual else None,
        }
