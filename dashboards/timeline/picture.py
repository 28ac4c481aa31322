"""Overlay on the camera's picture: boxes in the colour of their track, labels, true boxes."""

from __future__ import annotations

import numpy as np
import rerun as rr

from dashboards.style import packed, tinted
from dashboards.timeline.columns import CameraRows
from dashboards.timeline.labels import placed_labels
from dashboards.timeline.names import path
from dashboards.timeline.stream import send_sets
from pipeline.core.arrays import FloatArray

# Our (0, 0) is the middle of the first pixel, Rerun's is its corner.
CORNER_PX = 0.5
BEHIND = -100.0  # Rerun draws pictures at -10
# Half widths of lines in points of the screen, which Rerun takes as negative. Truth is thinner than
# what is compared with it, and above it.
BOX_RADIUS, TRUTH_RADIUS = -1.25, -0.6
WHITE = 0xFFFFFFFF


def log_boxes(stream: rr.RecordingStream, rows: CameraRows) -> None:
    """Log the boxes of each frame with their labels, and the true boxes."""
    seen, camera = rows.observations, (rows.name, "camera")
    colour = rows.tracks.colour[seen.track]
    boxes, box_colour = _shown(rows, seen.bbox_xyxy_px), packed(colour)
    send_sets(
        stream,
        path("cameras", *camera, "tracks"),
        rows.frames,
        seen.row,
        lambda part: rr.Boxes2D.columns(**_centred(boxes[part]), colors=box_colour[part]),
        rr.Boxes2D.from_fields(radii=BOX_RADIUS),
    )
    texts, middle, half_width = placed_labels(rows)
    middle, text_colour = _shown(rows, middle), packed(tinted(colour))
    half = np.column_stack([half_width * rows.scale, np.zeros(len(half_width))])
    # Only the text is wanted: what it hangs from is hidden behind the picture.
    entity = path("cameras", *camera, "labels")
    stream.log(entity, rr.Boxes2D.from_fields(draw_order=BEHIND, show_labels=True), static=True)
    send_sets(
        stream,
        entity,
        rows.frames,
        seen.row,
        lambda part: rr.Boxes2D.columns(
            centers=middle[part],
            half_sizes=half[part],
            radii=np.zeros(len(half[part]), dtype=np.float32),
            colors=text_colour[part],
            labels=texts[part].to_pylist(),
        ),
    )
    known = np.isfinite(rows.truth.bbox_xyxy_px).all(axis=1)
    true_boxes = _shown(rows, rows.truth.bbox_xyxy_px[known])
    send_sets(
        stream,
        path("cameras", *camera, "truth"),
        rows.frames,
        rows.truth.row[known],
        lambda part: rr.Boxes2D.columns(
            **_centred(true_boxes[part]),
            colors=np.full(len(true_boxes[part]), WHITE, dtype=np.uint32),
        ),
        rr.Boxes2D.from_fields(radii=TRUTH_RADIUS),
    )


def _shown(rows: CameraRows, points_px: FloatArray) -> FloatArray:
    """Return points of the stored picture as points of that on the timeline."""
    return (points_px + CORNER_PX) * rows.scale


def _centred(boxes_px: FloatArray) -> dict[str, FloatArray]:
    low, high = boxes_px[:, :2], boxes_px[:, 2:]
    return {"centers": (low + high) / 2, "half_sizes": (high - low) / 2}
