"""Rows of the table `tracks` for refined tracks, with the verdict on each: a person, or not.

A network that looks at some frames decides, if there is one: a track that it did not confirm is no
person. Columns alone refuse only what no person does; on footage of cars, bottles and leaves that is not
enough, so that what they leave is undecided, and is taken for people.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import pandas as pd
import pyarrow as pa

from pipeline.core.arrays import BoolArray, FloatArray, IntArray
from pipeline.core.config import TrackConfig
from pipeline.core.tables import TRACKS

CONFIRMED, REFUSED = "confirmed", "refused"
IMPLAUSIBLE, UNDECIDED = "implausible", "undecided"
# A network that knows people finds them in most pictures, and something else in hardly any. Of people
# that are half hidden or small it finds a part.
LEAST_CONFIRMED = 0.3
# Nobody runs so fast for long: 10 m/s is the fastest ever, 4 m/s (2.4 body heights a second) a runner
# in a street. A track that is faster throughout is a vehicle, a bird, a shadow.
FASTEST = 4.0  # body heights a second


@dataclass(slots=True)
class TrackSums:
    """Sums over the rows of each track, a stretch after another."""

    _parts: list[pd.DataFrame] = field(default_factory=list)

    def add(
        self,
        track: IntArray,
        frame: IntArray,
        time_ns: IntArray,
        bbox_xyxy_px: FloatArray,
        class_name: list[str | None],
        measured: BoolArray,
        confirmed: FloatArray,
    ) -> None:
        """Take refined rows, in order of frame; `confirmed` is 1, 0, or NaN where none looked."""
        rows = pd.DataFrame(
            {
                "track_id": track,
                "frame": frame,
                "time_ns": time_ns,
                "x": (bbox_xyxy_px[:, 0] + bbox_xyxy_px[:, 2]) / 2,
                "y": bbox_xyxy_px[:, 3],
                "tall": bbox_xyxy_px[:, 3] - bbox_xyxy_px[:, 1],
                "class_name": class_name,
                "seen": np.asarray(measured, dtype=np.int64),
                "looks": np.isfinite(confirmed).astype(np.int64),
                "confirmed": np.nan_to_num(confirmed),
            }
        )
        step = rows.groupby("track_id")[["x", "y", "time_ns"]].diff()
        rows["path"] = (np.hypot(step["x"], step["y"]) / rows["tall"]).fillna(0.0)
        rows["moved_s"] = step["time_ns"].fillna(0.0) / 1e9
        seen = rows[rows["seen"] > 0]
        votes = seen.groupby(["track_id", "class_name"], dropna=False).size().rename("votes")
        sums = rows.groupby("track_id").agg(
            first_frame=("frame", "min"),
            last_frame=("frame", "max"),
            first_ns=("time_ns", "min"),
            last_ns=("time_ns", "max"),
            rows=("frame", "size"),
            seen=("seen", "sum"),
            looks=("looks", "sum"),
            confirmed=("confirmed", "sum"),
            path=("path", "sum"),
            moved_s=("moved_s", "sum"),
        )
        self._parts.append(votes.reset_index().merge(sums.reset_index(), on="track_id"))

    def by_track(self) -> pd.DataFrame:
        """Return one row a track: its sums, and the class of most of its boxes."""
        if not self._parts:
            return pd.DataFrame()
        every = pd.concat(self._parts, ignore_index=True)
        votes = every.groupby(["track_id", "class_name"], dropna=False)["votes"].sum().reset_index()
        votes = votes.sort_values("votes", ascending=False, kind="stable")
        names = votes.drop_duplicates("track_id").set_index("track_id")["class_name"]
        once = pd.concat([part.drop_duplicates("track_id") for part in self._parts])
        least, most = ["first_frame", "first_ns"], ["last_frame", "last_ns"]
        added = ["rows", "seen", "looks", "confirmed", "path", "moved_s"]
        how = dict.fromkeys(least, "min") | dict.fromkeys(most, "max") | dict.fromkeys(added, "sum")
        tracks = once.groupby("track_id", sort=True).agg(how)
        tracks["class_name"] = names
        return tracks


def tracks_table(camera: str, sums: TrackSums, config: TrackConfig, *, judged: bool) -> pa.Table:
    """Return the tracks of a camera that lasted, in the schema of the table `tracks`.

    Args:
        camera: its name.
        sums: of its tracks.
        config: which tracks are noise.
        judged: whether the detector leaves it open what it has found.
    """
    tracks = sums.by_track()
    if not len(tracks):
        return TRACKS.empty_table()
    span_s = (tracks["last_ns"] - tracks["first_ns"]) / 1e9
    kept = [
        not config.noisy(count, seconds)
        for count, seconds in zip(tracks["seen"], span_s, strict=True)
    ]
    tracks = tracks[kept]
    verdict = verdicts(tracks) if judged else [None] * len(tracks)
    network = bool((tracks["looks"] > 0).any())
    people = (None, CONFIRMED) if network else (None, UNDECIDED)
    looked = (
        tracks["looks"] if network else tracks["looks"].astype("float").where(tracks["looks"] > 0)
    )
    columns = {
        "camera": [camera] * len(tracks),
        "track_id": tracks.index,
        "class_name": [
            name if v in people else "unknown"
            for v, name in zip(verdict, tracks["class_name"], strict=True)
        ],
        "object_id": [None] * len(tracks),
        "first_frame_index": tracks["first_frame"],
        "last_frame_index": tracks["last_frame"],
        "first_time_ns": tracks["first_ns"],
        "last_time_ns": tracks["last_ns"],
        "observation_count": tracks["seen"],
        "filled_count": tracks["rows"] - tracks["seen"],
        "looked_at_count": looked,
        "confirmed_count": tracks["confirmed"].where(looked.notna()),
        "verdict": verdict,
    }
    arrays = [pa.array(columns[f.name], type=f.type, from_pandas=True) for f in TRACKS]
    return pa.Table.from_arrays(arrays, schema=TRACKS)


def verdicts(tracks: pd.DataFrame) -> list[str | None]:
    """Return the verdict on each track: `CONFIRMED`, `REFUSED`, `IMPLAUSIBLE` or `UNDECIDED`."""
    share = tracks["confirmed"] / tracks["looks"].replace(0, np.nan)
    speed = tracks["path"] / tracks["moved_s"].replace(0.0, np.nan)
    verdict = np.full(len(tracks), UNDECIDED, dtype=object)
    verdict[(speed > FASTEST).to_numpy()] = IMPLAUSIBLE
    verdict[(share < LEAST_CONFIRMED).to_numpy()] = REFUSED
    verdict[(share >= LEAST_CONFIRMED).to_numpy()] = CONFIRMED
    return list(verdict)
