"""Reading observations by whole tracks, and a few columns of the other boxes in their frames.

Observations lie by camera and frame, and a track is a short range of frames: DuckDB skips the blocks
whose smallest and largest frame number are outside it, without an index.
"""
# ruff: noqa: S608  (the text that is put into SQL is that of this file)

from __future__ import annotations

from collections.abc import Sequence

import pyarrow as pa

from pipeline.store.database import Store

_OWN = """
FROM observations WHERE recording_id = $recording AND camera = $camera
    AND frame_index BETWEEN $first AND $last AND track_id IN (SELECT unnest($tracks))
"""
_UNUSED = "object_id, score, luminance, blur_edge_count, blur_reason"
_EXPOSURE = """,
    capture_time_ns, exposure_time_s, f_number, focal_length_mm, focus_distance_m, pixel_pitch_x_um,
    pixel_pitch_y_um"""
# Only of a camera whose lens or size changes: a list for each observation costs more than all the rest.
_LENS = """,
    width_px AS frame_width_px, height_px AS frame_height_px, fx_px AS frame_fx_px,
    fy_px AS frame_fy_px, cx_px AS frame_cx_px, cy_px AS frame_cy_px,
    distortion_model AS frame_distortion_model, distortion AS frame_distortion,
    intrinsics_source AS frame_intrinsics_source"""
_OF_FRAMES = """
SELECT camera, frame_index {0} FROM frames WHERE recording_id = $recording AND camera = $camera
    AND frame_index BETWEEN $first AND $last
"""


def tracks_of(store: Store, recording_id: str, object_class: str) -> pa.Table:
    """Return every track of a recording: its frames, its observations, and those of a class."""
    return store.connection.sql(
        """
        SELECT
            camera, track_id, min(frame_index) AS first_frame_index,
            max(frame_index) AS last_frame_index, count(*) AS observation_count,
            count(*) FILTER (class_name = $class) AS class_count,
            min(observation_index) FILTER (class_name = $class) AS first_of_class
        FROM observations WHERE recording_id = $recording
        GROUP BY ALL ORDER BY camera, first_frame_index, track_id
        """,
        params={"recording": recording_id, "class": object_class},
    ).to_arrow_table()


def lenses_of(store: Store, recording_id: str, camera: str) -> pa.Table:
    """Return the sizes and lenses of a camera's pictures as in the table `frames`.

    Lenses that are known come first, and of these that of most frames.
    """
    return store.connection.sql(
        """
        SELECT
            width_px, height_px, fx_px, fy_px, cx_px, cy_px, intrinsics_source,
            first(distortion_model ORDER BY frame_index) AS distortion_model,
            first(distortion ORDER BY frame_index) AS distortion
        FROM frames WHERE recording_id = $recording AND camera = $camera AND width_px IS NOT NULL
        GROUP BY ALL ORDER BY count(fx_px) = 0, count(*) DESC, min(frame_index)
        """,
        params={"recording": recording_id, "camera": camera},
    ).to_arrow_table()


def observed(
    store: Store,
    recording_id: str,
    camera: str,
    track_ids: Sequence[int],
    frame_range: tuple[int, int],
    *,
    with_lens: bool = True,
) -> tuple[pa.Table, pa.Table]:
    """Return the observations of tracks, joined with their frames, and the other boxes in these.

    Both are in the order of `observation_index`.

    Args:
        store: a database that is open.
        recording_id: which recording.
        camera: which camera of it.
        track_ids: the tracks.
        frame_range: the first and the last frame that any of them is in.
        with_lens: whether the size and the lens of each frame stand beside its boxes, `frame_...`.
    """
    exposed = _OF_FRAMES.format(_EXPOSURE + (_LENS if with_lens else ""))
    lens, beside = "", ""
    if with_lens:
        lens = ", seen_by.* EXCLUDE (camera, frame_index)"
        beside = f"JOIN ({_OF_FRAMES.format(_LENS)}) AS seen_by USING (camera, frame_index)"
    values = {
        "recording": recording_id,
        "camera": camera,
        "tracks": list(track_ids),
        "first": frame_range[0],
        "last": frame_range[1],
    }
    own = store.connection.sql(
        f"""
        SELECT * EXCLUDE ({_UNUSED}) FROM (SELECT * {_OWN})
        JOIN ({exposed}) USING (camera, frame_index)
        ORDER BY observation_index
        """,
        params=values,
    ).to_arrow_table()
    others = store.connection.sql(
        f"""
        SELECT
            observation_index, frame_index, x_min_px, y_min_px, x_max_px, y_max_px {lens}
        FROM observations SEMI JOIN (SELECT frame_index {_OWN}) USING (frame_index) {beside}
        WHERE recording_id = $recording AND camera = $camera
            AND frame_index BETWEEN $first AND $last AND track_id NOT IN (SELECT unnest($tracks))
        ORDER BY observation_index
        """,
        params=values,
    ).to_arrow_table()
    return own, others
