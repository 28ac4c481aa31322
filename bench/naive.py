"""A script that a user would write instead; stadimeter's speed is compared with it.

An mcap reader, imdecode, MOG2 at full size, connected components, per-object Python, a data frame,
and executemany.
"""

from __future__ import annotations

import math
import sys
from pathlib import Path

import cv2
import duckdb
import numpy as np
import pandas as pd
from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from mcap.reader import make_reader


def main(recording: Path, database: Path) -> None:
    """Detect people in a recording and store depths by similar triangles."""
    background = cv2.createBackgroundSubtractorMOG2(history=500, varThreshold=16)
    kernel = np.ones((5, 3), np.uint8)
    rows = []
    last: dict[int, tuple[float, float]] = {}
    next_id = 0
    with recording.open("rb") as stream:
        for _, channel, message in make_reader(stream).iter_messages():
            if not channel.topic.endswith("/image"):
                continue
            image = CompressedImage.FromString(message.data)
            picture = cv2.imdecode(np.frombuffer(image.data, np.uint8), cv2.IMREAD_COLOR)
            mask = background.apply(picture)
            mask = cv2.morphologyEx((mask == 255).astype(np.uint8), cv2.MORPH_CLOSE, kernel)
            count, _, stats, centres = cv2.connectedComponentsWithStats(mask)
            now = {}
            for i in range(1, count):
                x, y, w, h, area = stats[i]
                if area < 300 or h < w:
                    continue
                near = [(math.dist(centres[i], at), track) for track, at in last.items()]
                distance, track = min(near, default=(math.inf, -1))
                if distance > 50:
                    track, next_id = next_id, next_id + 1
                now[track] = tuple(centres[i])
                depth_m = 1493.0 * 1.7 / h
                rows.append((message.log_time, track, int(x), int(y), int(w), int(h), depth_m))
            last = now
    columns = ["time_ns", "track", "x", "y", "w", "h", "depth_m"]
    frame = pd.DataFrame(rows, columns=columns)
    with duckdb.connect(str(database)) as connection:
        connection.execute(
            "CREATE OR REPLACE TABLE estimates (time_ns BIGINT, track INTEGER, x INTEGER, "
            "y INTEGER, w INTEGER, h INTEGER, depth_m DOUBLE)"
        )
        connection.executemany(
            "INSERT INTO estimates VALUES (?, ?, ?, ?, ?, ?, ?)",
            [tuple(row) for row in frame.itertuples(index=False, name=None)],
        )


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
