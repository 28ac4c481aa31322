"""The timeline of one recording: its pictures with what was measured in them, for Rerun.

Pictures pass through undecoded. Everything is sent as columns; nothing is logged object by object.

    CAMERA/camera/image        the pictures
    CAMERA/camera/tracks       boxes in the picture, labelled with depth and height
    CAMERA/people, /trail      the same people on the ground, in metres
    CAMERA/depth/METHOD/TRACK  depth over time; the band is the 95 % interval
    CAMERA/height/METHOD/TRACK height over time, where it was measured
    CAMERA/exposure/NAME       f-number, EV100, luminance
    about, tracks, diagnostics what recording this is, its tracks, and what was wrong with it
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import rerun as rr

from dashboards.blueprint import CameraView, blueprint
from dashboards.documents import about_text, tracks_text
from dashboards.scene import FRAME, TIME, TRUTH_COLOUR, Pose, best_method, colours_of, path

# Pictures are sent in batches: large enough for columns to pay, small enough for a flat memory.
BATCH_BYTES = 8 * 1024**2
# Curves of more tracks than this would hide each other; all are in the database.
MAX_CURVES = 200
# rr.Measurements draws one standard deviation; a variance of (1.96 s)^2 makes it the 95 % interval.
Z_95 = 1.96
MEDIA_TYPES = {"jpeg": "image/jpeg", "jpg": "image/jpeg", "png": "image/png", "webp": "image/webp"}
TRUNK_M = 0.22  # half the breadth of a person drawn in the scene; not measured


@dataclass(frozen=True, slots=True)
class StillEncoded:
    """One picture on its way through."""

    camera: str
    frame_index: int
    capture_time_ns: int
    image_format: str
    image: bytes


def write_timeline(
    target: Path,
    recording: Mapping[str, Any],
    images: Iterable[StillEncoded],
    tables: Mapping[str, pa.Table],
) -> None:
    """Write a `.rrd`, and its blueprint as `.rbl` beside it; they appear when they are complete.

    Args:
        target: the file to write.
        recording: the row of the table `recordings`.
        images: the pictures, in any order.
        tables: rows of that recording: cameras, frames, tracks, observations, estimates,
            track_heights, ground_truth, diagnostics.
    """
    frames = {name: table.to_pandas() for name, table in tables.items()}
    views = [_view_of(camera, frames) for camera in tables["cameras"].to_pylist()]
    layout = blueprint(views)
    part = target.with_name(target.name + ".part")
    target.parent.mkdir(parents=True, exist_ok=True)
    stream = rr.RecordingStream("stadimeter", recording_id=str(recording["recording_id"]))
    stream.save(part, default_blueprint=layout)
    with stream:
        stream.send_recording_name(str(recording["file_name"]))
        _log_documents(recording, frames)
        for camera, view in zip(tables["cameras"].to_pylist(), views, strict=True):
            _log_camera(camera, view, frames)
        _log_images(images)
        _log_diagnostics(frames["diagnostics"])
    stream.disconnect()
    part.replace(target)
    layout.save("stadimeter", str(target.with_suffix(".rbl")))


def _view_of(camera: Mapping[str, Any], frames: Mapping[str, pd.DataFrame]) -> CameraView:
    name = camera["camera"]
    mine = frames["observations"].query("camera == @name")
    merged = frames["estimates"].merge(mine[["observation_index"]], on="observation_index")
    exposure = frames["frames"].query("camera == @name")
    truth = frames["ground_truth"].query("camera == @name")
    best = best_method(set(merged["method"]))
    return CameraView(
        camera=name,
        method=best,
        pose_known=camera["camera_height_m"] is not None,
        camera_height_m=float(camera["camera_height_m"] or 0.0),
        depth_m=_range_of(merged["depth_m"], merged["method"] == best),
        height_m=_range_of(merged["height_m"], merged["method"] == best),
        has_heights=bool((~merged["height_assumed"] & merged["height_m"].notna()).any()),
        has_exposure=bool(exposure["f_number"].notna().any()),
        has_truth=bool(truth["depth_m"].notna().any()),
    )


def _range_of(values: pd.Series, chosen: pd.Series) -> tuple[float, float, float]:
    """Return the low end, the middle and the high end of what a plot shows: outliers may leave it."""
    known = values[chosen].dropna()
    if known.empty:
        return 0.0, 1.0, 2.0
    low, middle, high = (float(known.quantile(q)) for q in (0.01, 0.5, 0.99))
    margin = 0.1 * (high - low) + 0.02 * middle
    return low - margin, middle, high + margin


def _log_camera(
    camera: Mapping[str, Any], view: CameraView, frames: Mapping[str, pd.DataFrame]
) -> None:
    name, pose = view.camera, Pose.of(dict(camera))
    rr.log(path(name), rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    rr.log(
        path(name, "camera"),
        rr.Transform3D(translation=[0, 0, pose.height_m], mat3x3=pose.world_from_camera()),
        static=True,
    )
    if camera["fx_px"] is not None:
        rr.log(
            path(name, "camera"),
            rr.Pinhole(
                image_from_camera=[
                    [camera["fx_px"], 0, camera["cx_px"]],
                    [0, camera["fy_px"], camera["cy_px"]],
                    [0, 0, 1],
                ],
                resolution=[camera["width_px"], camera["height_px"]],
                camera_xyz=rr.ViewCoordinates.RDF,
                image_plane_distance=max(view.depth_m[1] / 6, 0.05),
            ),
            static=True,
        )
    times = frames["frames"].query("camera == @name").sort_values("frame_index")
    seen = frames["observations"].query("camera == @name")
    seen = seen.merge(times[["frame_index", "capture_time_ns"]], on="frame_index")
    shown = frames["estimates"].query("method == @view.method")
    shown = shown.drop(columns=["recording_id", "run_id"], errors="ignore")
    drawn = seen.merge(shown, on="observation_index", how="left").sort_values(
        ["frame_index", "track_id"]
    )
    _log_boxes(name, drawn, times)
    if camera["fx_px"] is not None:
        _log_people(name, drawn, times, pose)
    _log_curves(view, seen, frames["estimates"])
    _log_truth(name, frames["ground_truth"].query("camera == @name"), times)
    _log_exposure(name, times)


def _log_boxes(name: str, drawn: pd.DataFrame, times: pd.DataFrame) -> None:
    """Log all boxes of each frame at once; a frame without any clears those of the one before."""
    counts = _counts(drawn, times)
    low = drawn[["x_min_px", "y_min_px"]].to_numpy()
    high = drawn[["x_max_px", "y_max_px"]].to_numpy()
    # Rerun puts the corner of the first pixel, not its centre, at (0, 0).
    columns = rr.Boxes2D.columns(
        centers=(low + high) / 2 + 0.5,
        half_sizes=(high - low) / 2,
        colors=colours_of(drawn["track_id"].to_numpy()),
    )
    rr.send_columns(path(name, "camera", "tracks"), _index(times), columns.partition(counts))
    # A box wraps its label to its own width; a point under its feet does not.
    feet = np.column_stack([(low[:, 0] + high[:, 0]) / 2, high[:, 1]]) + 0.5
    labels = rr.Points2D.columns(
        positions=feet,
        colors=colours_of(drawn["track_id"].to_numpy()),
        radii=np.full(len(drawn), 1.5),
        labels=_labels(drawn),
        show_labels=np.ones(len(drawn), dtype=bool),
    )
    rr.send_columns(path(name, "camera", "labels"), _index(times), labels.partition(counts))


def _labels(drawn: pd.DataFrame) -> list[str]:
    """Return number, depth and height with 95 % intervals, a line each; no spaces, which would wrap.

    A height that was assumed is not shown.
    """
    labels = []
    columns = ("track_id", "depth_m", "depth_std_m", "height_m", "height_std_m", "height_assumed")
    for track, depth, depth_std, height, height_std, assumed in zip(
        *(drawn[c].to_numpy() for c in columns), strict=True
    ):
        lines = [f"#{track}"]
        if pd.notna(depth):
            lines.append(_with_interval(depth, depth_std))
        if pd.notna(height) and assumed is not True:
            lines.append(f"↕{_with_interval(height, height_std)}")
        labels.append("\n".join(lines))
    return labels


def _with_interval(value: float, std: float) -> str:
    half = Z_95 * std
    digits = 2 if half < 0.3 else 1 if half < 3 else 0
    return f"{value:.{digits}f}±{half:.{digits}f}m"


def _log_people(name: str, drawn: pd.DataFrame, times: pd.DataFrame, pose: Pose) -> None:
    """Log each object where it stands, at its size, and a point for its trail."""
    placed = drawn[drawn["x_m"].notna() & drawn["y_m"].notna()]
    height = placed["height_m"].fillna(0.0).to_numpy()
    counts = _counts(placed, times)
    colours = colours_of(placed["track_id"].to_numpy())
    ground = placed[["x_m", "y_m"]].to_numpy()
    base = np.zeros(len(placed)) if pose.known else -height / 2
    breadth = np.minimum(TRUNK_M, height / 4)
    boxes = rr.Boxes3D.columns(
        centers=np.column_stack([ground, base + height / 2]),
        half_sizes=np.column_stack([breadth, breadth, height / 2]),
        colors=colours,
        labels=[f"#{t}" for t in placed["track_id"]],
    )
    rr.send_columns(path(name, "people"), _index(times), boxes.partition(counts))
    points = rr.Points3D.columns(
        positions=np.column_stack([ground, base]),
        colors=colours,
        radii=np.full(len(placed), max(float(np.median(height)) / 40, 0.001) if len(placed) else 1),
    )
    rr.send_columns(path(name, "trail"), _index(times), points.partition(counts))


def _log_curves(view: CameraView, seen: pd.DataFrame, estimates: pd.DataFrame) -> None:
    """Log depth and measured height over time, a curve a track a method."""
    columns = ["observation_index", "frame_index", "capture_time_ns", "track_id"]
    rows = estimates.merge(seen[columns], on="observation_index").sort_values("frame_index")
    one_by_one = not seen.duplicated("frame_index").any()
    longest = seen["track_id"].value_counts().index[:MAX_CURVES]
    for method, of_method in rows.groupby("method"):
        if one_by_one:  # one object a frame, as in a series of photographs: one curve
            tracks: Iterable[tuple[str, int, pd.DataFrame]] = [("all", 0, of_method)]
        else:
            chosen = of_method[of_method["track_id"].isin(longest)]
            tracks = ((f"#{t}", int(str(t)), group) for t, group in chosen.groupby("track_id"))
        for label, number, track in tracks:
            colour = colours_of(np.array([number]))[0]
            title = method if one_by_one else label
            _log_curve(view.camera, "depth", str(method), label, track, colour, str(title))
            measured = track[track["height_m"].notna() & ~track["height_assumed"].astype(bool)]
            _log_curve(view.camera, "height", str(method), label, measured, colour, str(title))


def _log_curve(
    name: str,
    quantity: str,
    method: str,
    label: str,
    track: pd.DataFrame,
    colour: np.ndarray,
    title: str,
) -> None:
    if track.empty:
        return
    entity = path(name, quantity, method, label)
    rr.log(entity, rr.Measurements.from_fields(names=[title], colors=[colour]), static=True)
    columns = rr.Measurements.columns(
        values=track[f"{quantity}_m"].to_numpy(),
        variances=(Z_95 * track[f"{quantity}_std_m"].fillna(0.0).to_numpy()) ** 2,
    )
    rr.send_columns(entity, _index(track), columns)


def _log_truth(name: str, truth: pd.DataFrame, times: pd.DataFrame) -> None:
    rows = truth.merge(times[["frame_index", "capture_time_ns"]], on="frame_index")
    rows = rows.sort_values("frame_index")
    for quantity in ("depth", "height"):
        known = rows[rows[f"{quantity}_m"].notna()]
        if known.empty:
            continue
        one_by_one = not known.duplicated("frame_index").any()
        groups = [("all", known)] if one_by_one else list(known.groupby("object_id"))[:MAX_CURVES]
        for label, group in groups:
            entity = path(name, quantity, "truth", str(label))
            style = rr.SeriesPoints(names=["truth"], colors=[TRUTH_COLOUR], marker_sizes=[3])
            rr.log(entity, style, static=True)
            columns = rr.Scalars.columns(scalars=group[f"{quantity}_m"].to_numpy())
            rr.send_columns(entity, _index(group), columns)


def _log_exposure(name: str, times: pd.DataFrame) -> None:
    titles = {"f_number": "f-number", "ev100": "EV100", "luminance": "relative luminance"}
    for column, title in titles.items():
        known = times[times[column].notna()]
        if known.empty:
            continue
        entity = path(name, "exposure", column)
        rr.log(entity, rr.SeriesLines(names=[title]), static=True)
        rr.send_columns(entity, _index(known), rr.Scalars.columns(scalars=known[column].to_numpy()))


def _log_images(images: Iterable[StillEncoded]) -> None:
    for batch in _batches(images):
        for camera in {image.camera for image in batch}:
            mine = [image for image in batch if image.camera == camera]
            times = pd.DataFrame(
                {
                    "frame_index": [i.frame_index for i in mine],
                    "capture_time_ns": [i.capture_time_ns for i in mine],
                }
            )
            columns = rr.EncodedImage.columns(
                blob=[i.image for i in mine],
                media_type=[MEDIA_TYPES.get(i.image_format.lower(), "image/jpeg") for i in mine],
            )
            rr.send_columns(path(camera, "camera", "image"), _index(times), columns)


def _batches(images: Iterable[StillEncoded]) -> Iterator[list[StillEncoded]]:
    batch: list[StillEncoded] = []
    size = 0
    for image in images:
        batch.append(image)
        size += len(image.image)
        if size >= BATCH_BYTES:
            yield batch
            batch, size = [], 0
    if batch:
        yield batch


def _log_documents(recording: Mapping[str, Any], frames: Mapping[str, pd.DataFrame]) -> None:
    markdown = rr.MediaType.MARKDOWN
    about = about_text(recording, frames)
    rr.log("about", rr.TextDocument(about, media_type=markdown), static=True)
    table = tracks_text(frames["track_heights"])
    rr.log("tracks", rr.TextDocument(table, media_type=markdown), static=True)


def _log_diagnostics(diagnostics: pd.DataFrame) -> None:
    levels = {"info": "INFO", "warning": "WARN", "error": "ERROR"}
    texts = [
        f"{code}: {message}" + (f" ({count:,} times)" if count > 1 else "")
        for code, message, count in zip(
            diagnostics["code"], diagnostics["message"], diagnostics["count"], strict=True
        )
    ]
    timed = diagnostics["log_time_ns"].notna().to_numpy()
    for text, level in [
        (t, s) for t, s, at in zip(texts, diagnostics["severity"], timed, strict=True) if not at
    ]:
        rr.log("diagnostics", rr.TextLog(text, level=levels.get(level, "INFO")), static=True)
    if timed.any():
        rows = diagnostics[timed]
        times_ns = rows["log_time_ns"].to_numpy(dtype=np.int64)
        columns = rr.TextLog.columns(
            text=[t for t, at in zip(texts, timed, strict=True) if at],
            level=[levels.get(s, "INFO") for s in rows["severity"]],
        )
        index = [rr.TimeColumn(TIME, timestamp=times_ns.astype("datetime64[ns]"))]
        rr.send_columns("diagnostics", index, columns)


def _counts(rows: pd.DataFrame, times: pd.DataFrame) -> np.ndarray:
    """Return how many of the rows belong to each frame of `times`."""
    count = rows.groupby("frame_index").size()
    return count.reindex(times["frame_index"], fill_value=0).to_numpy()


def _index(rows: pd.DataFrame) -> list[rr.TimeColumn]:
    times_ns = rows["capture_time_ns"].to_numpy(dtype=np.int64)
    return [
        rr.TimeColumn(FRAME, sequence=rows["frame_index"].to_numpy(dtype=np.int64)),
        rr.TimeColumn(TIME, timestamp=times_ns.astype("datetime64[ns]")),
    ]
