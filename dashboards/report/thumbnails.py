"""Small pictures of the people in the report, cut from the frame that shows each best."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from itertools import groupby
from pathlib import Path
from typing import Any

from dashboards.statement.pictures import read_pictures, thumbnail
from pipeline.core.config import Config
from pipeline.mcap_file.bag import found_at
from pipeline.store.database import Store

Row = Mapping[str, Any]
Key = tuple[str, str, int]  # recording_id, camera, track_id

# A day of one camera has thousands of tracks, and all of a file is read to find a few pictures.
MOST = 80
MOST_BYTES = 400_000_000


def thumbnails(store: Store, people: Iterable[Row]) -> dict[Key, str]:
    """Return pictures of people as data: URIs; none of recordings that are large or not there."""
    found: dict[Key, str] = {}
    wanted = [p for p in people if p["best"] is not None][:MOST]
    for (recording_id, camera), group in groupby(
        wanted, lambda p: (p["recording_id"], p["camera"])
    ):
        found |= _of_camera(store, recording_id, camera, list(group))
    return found


def _of_camera(
    store: Store, recording_id: str, camera: str, people: Sequence[Row]
) -> dict[Key, str]:
    row = store.query("FROM recordings WHERE recording_id = ?", [recording_id]).to_pylist()[0]
    path = found_at(Path(row["path"]), store.path.parent)
    if path is None or row["size_bytes"] > MOST_BYTES:
        return {}
    indexes = {p["best"]["frame_index"] for p in people}
    pictures = read_pictures(store, row, path, camera, indexes, Config())
    return {
        (recording_id, camera, p["track_id"]): thumbnail(
            pictures[p["best"]["frame_index"]], p["best"]
        )
        for p in people
        if p["best"]["frame_index"] in pictures
    }
