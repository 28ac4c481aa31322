"""Layout of the timeline when it opens.

The picture and the texts on the left, as wide as the picture needs; on the right, on one time axis,
the scene, the curves (a tab each method, errors, exposure) and the lanes of states.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from rerun.blueprint.components import LinkAxis

from dashboards.timeline.columns import BEST, CameraRows
from dashboards.timeline.curves import height_in_plots, in_plots, true_in_plots
from dashboards.timeline.error_curves import worst_errors
from dashboards.timeline.exposure_curves import EXPOSURE, exposure_curves
from dashboards.timeline.lanes import lane_count
from dashboards.timeline.layout import (
    MOST_PICTURES,
    PICTURE_SHARE,
    PICTURES_ACROSS,
    PICTURES_SHARE,
    TITLE_PX,
    WINDOW_PX,
    left_share,
)
from dashboards.timeline.names import path, title
from dashboards.timeline.scene import TRAILS, Pose, lens_known
from dashboards.timeline.slots import SLOTS
from dashboards.timeline.stream import ELAPSED, FRAME, TIME
from pipeline.core.arrays import FloatArray

APPLICATION = "stadimeter"
# Spacings of the grid on the ground, in metres; about ten lines to what is seen.
GRIDS_M = (0.1, 0.5, 1.0, 5.0, 10.0, 50.0)
SCENE_SHARE = 0.31  # of the height
LANE_PX, LANES_TOP_PX = 41.0, 60.0
MOST_LANES_SHARE = 0.25  # of the height; more lanes than fit can be scrolled to
# From the right and a little from behind, from above; and how much the viewer's eye sees upwards.
EYE_RAD = (np.radians(-12.0), np.radians(22.0))
EYE_ANGLE_RAD = np.radians(55.0)
EYE_MARGIN = 1.12
Span = tuple[float, float]


@dataclass(frozen=True, slots=True)
class CameraView:
    """Facts of one camera that decide its layout."""

    camera: str
    drawn_by: str  # a method, or `best`
    methods: tuple[str, ...]
    pose_known: bool
    frame_ns: int  # the time from a frame to the next
    camera_height_m: float
    across_m: tuple[float, float]  # the near and the far end of where things are
    ahead_m: tuple[float, float]
    depth_m: Span | None  # what a plot shows; None: nothing to plot
    height_m: Span | None
    has_truth: bool
    has_errors: bool
    exposure: tuple[str, ...]
    lanes: int
    left_share: float
    is_series_of_pictures: bool  # nothing is followed
    span_ns: tuple[int, int]  # the first and the last capture time
    track: int | None  # the track that has the plots for itself
    track_slot: int

    @property
    def middle_m(self) -> float:
        """Return how far away things are, on the whole."""
        return max(sum(self.ahead_m) / 2, 0.05)

    @property
    def ruler_m(self) -> float:
        """Return how far to the right the ruler on the ground lies."""
        return self.across_m[1] + 0.04 * self.ahead_m[1]


def camera_view(rows: CameraRows) -> CameraView:
    """Return what there is to show of a camera."""
    best, pose, alone = rows.best, Pose.of(rows.camera), rows.alone_track
    rate_hz = rows.frames.rate_hz()
    x_m, y_m = (best.x_m, best.y_m) if lens_known(rows.camera) else (np.empty(0), np.empty(0))
    plotted, truth = in_plots(rows), true_in_plots(rows)
    return CameraView(
        camera=rows.name,
        drawn_by=rows.drawn_by,
        methods=rows.methods,
        pose_known=pose.known,
        frame_ns=int(1e9 / rate_hz) if rate_hz else 0,
        camera_height_m=pose.height_m,
        across_m=_spread(x_m, (0.0, 0.0)),
        ahead_m=_spread(y_m, (0.5, 1.0)),
        depth_m=_span(best.depth_m[plotted], rows.truth.depth_m[truth]),
        height_m=_span(height_in_plots(rows, best)[plotted], rows.truth.height_m[truth]),
        has_truth=bool(np.isfinite(rows.truth.depth_m).any()),
        has_errors=worst_errors(rows) is not None,
        exposure=tuple(exposure_curves(rows.frames)),
        lanes=lane_count(rows) + 2,
        left_share=left_share(rows.camera),
        is_series_of_pictures=rows.is_series_of_pictures,
        span_ns=_capture_span(rows),
        track=None if alone is None else rows.alone,
        track_slot=-1 if alone is None else int(rows.tracks.slot[alone]),
    )


def _capture_span(rows: CameraRows) -> tuple[int, int]:
    times_ns = rows.frames.capture_time_ns
    return (int(times_ns.min()), int(times_ns.max())) if len(times_ns) else (0, 0)


def _spread(values: FloatArray, default: Span) -> Span:
    known = values[np.isfinite(values)]
    if not len(known):
        return default
    near, far = np.quantile(known, [0.05, 0.95]).tolist()
    return near, far


def _span(values: FloatArray, truth: FloatArray) -> Span | None:
    """Return what a plot shows: the truth and nearly all values; outliers may leave it."""
    known, true = values[np.isfinite(values)], truth[np.isfinite(truth)]
    if not len(known) and not len(true):
        return None
    ends = np.concatenate([np.quantile(known, [0.01, 0.99]) if len(known) else known, true])
    low, high = float(ends.min()), float(ends.max())
    margin = 0.15 * (high - low) + 0.03 * abs(high)
    return max(low - margin, 0.0), high + margin


def blueprint(views: Sequence[CameraView], *, has_diagnostics: bool = True) -> rrb.Blueprint:
    """Return the layout for the cameras: a tab each if there are several, after one with all."""
    cameras = [_camera(view, has_diagnostics=has_diagnostics) for view in views]
    if not cameras:
        body: rrb.Container = _texts(has_diagnostics=has_diagnostics)
    elif len(cameras) == 1:
        body = cameras[0]
    else:
        together = _all(views, has_diagnostics=has_diagnostics)
        body = rrb.Tabs(together, *cameras, active_tab=0)
    rate_hz = next((1e9 / v.frame_ns for v in views if v.frame_ns), 10.0)
    return rrb.Blueprint(
        body,
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(
            state="collapsed",
            timeline=shared_clock(views),
            fps=min(max(rate_hz, 1.0), 60.0),
            loop_mode="all",
        ),
        auto_views=False,
    )


def shared_clock(views: Sequence[CameraView]) -> str:
    """Return the timeline to open on: what is told of one frame must be of one time.

    Each camera counts its own frames, so several share the time; and where they were not recorded
    at the same time, the time from the start of each.
    """
    if len(views) <= 1:
        return FRAME
    together = max(v.span_ns[0] for v in views) <= min(v.span_ns[1] for v in views)
    return TIME if together else ELAPSED


def _all(views: Sequence[CameraView], *, has_diagnostics: bool) -> rrb.Vertical:
    """Return all cameras side by side: their pictures, and their depths below."""
    across = min(len(views), PICTURES_ACROSS)
    shown = views[:MOST_PICTURES]
    depths = [plot for v in shown for plot in _curve_views(v, v.drawn_by, v.drawn_by, ("depth",))]
    pictures = rrb.Grid(*(_picture(view) for view in shown), grid_columns=across)
    curves = [rrb.Grid(*depths, grid_columns=across)] if depths else []
    rest = 1 - PICTURES_SHARE
    return rrb.Vertical(
        pictures,
        *curves,
        _texts(has_diagnostics=has_diagnostics),
        row_shares=[PICTURES_SHARE, *[rest * 0.4] * len(curves), rest * 0.6],
        name="All cameras",
    )


def _camera(view: CameraView, *, has_diagnostics: bool) -> rrb.Horizontal:
    left = rrb.Vertical(
        _picture(view),
        _texts(view, has_diagnostics=has_diagnostics),
        row_shares=[PICTURE_SHARE, 1 - PICTURE_SHARE],
    )
    lanes = min((LANES_TOP_PX + LANE_PX * view.lanes) / WINDOW_PX[1], MOST_LANES_SHARE)
    plots = _plots(view)
    right = [_scene(view), *plots, _lanes(view)]
    shares = [SCENE_SHARE, *[1 - SCENE_SHARE - lanes] * len(plots), lanes]
    return rrb.Horizontal(
        left,
        rrb.Vertical(*right, row_shares=shares),
        column_shares=[view.left_share, 1 - view.left_share],
        name=title(view.camera),
    )


def _texts(view: CameraView | None = None, *, has_diagnostics: bool) -> rrb.Tabs:
    texts: list[rrb.View] = [
        rrb.TextDocumentView(origin="tracks", name="Tracks"),
        rrb.TextDocumentView(origin="about", name="About"),
    ]
    if has_diagnostics:
        texts.append(_log("diagnostics", "Diagnostics"))
    if view is not None and view.has_errors:
        worst = path("cameras", view.camera, "worst")
        texts.append(_log(worst, "Worst errors"))
    return rrb.Tabs(*texts, active_tab=0)


def _log(origin: str, name: str) -> rrb.TextLogView:
    return rrb.TextLogView(
        origin=origin,
        name=name,
        columns=rrb.TextLogColumns(timeline_columns=[FRAME], text_log_columns=["loglevel", "body"]),
    )


def _picture(view: CameraView) -> rrb.Spatial2DView:
    truth = "; white: truth" if view.has_truth else ""
    return rrb.Spatial2DView(
        origin=path("cameras", view.camera, "camera"),
        contents=["$origin/image", "$origin/truth", "$origin/tracks", "$origin/labels"],
        name=f"{title(view.camera)}: track, depth and ↕ height in m, ± 95 %{truth}",
    )


def _scene(view: CameraView) -> rrb.Spatial3DView:
    grid_m = next((g for g in GRIDS_M if g >= view.ahead_m[1] / 10), GRIDS_M[-1])
    truth = "; white outlines: truth" if view.has_truth else ""
    name = f"On the ground, grid of {grid_m:g} m" if view.pose_known else "Scene, in metres"
    return rrb.Spatial3DView(
        origin=path("cameras", view.camera),
        contents=[
            "$origin/camera",
            "$origin/camera/image",
            "$origin/people",
            "$origin/numbers",
            "$origin/truth",
            "$origin/ground/**",
            "$origin/trails/**",
        ],
        name=name + truth,
        line_grid=rrb.LineGrid3D(visible=view.pose_known, spacing=grid_m),
        eye_controls=_eye(view),
        overrides={
            path("cameras", view.camera, "trails", age): [_back(view, *frames[:2])]
            for age, frames in TRAILS.items()
        },
    )


def _eye(view: CameraView) -> rrb.EyeControls3D:
    """Return an eye to the right of camera and people, so that they stand before it left to right."""
    eye, target = eye_and_target(view)
    return rrb.EyeControls3D(
        kind=rrb.Eye3DKind.Orbital, position=eye, look_target=target, eye_up=[0.0, 0.0, 1.0]
    )


def eye_and_target(view: CameraView) -> tuple[FloatArray, FloatArray]:
    """Return where the eye is, and what it looks at: as near as all that matters is in its picture.

    The camera and the space in which things are: each corner p must be within the eye's angles. With
    the eye at t + d u, looking at t, it is if d >= (p - t) u + |(p - t) r| / tan(angle / 2), for r
    to the right and upwards.
    """
    tall_m = 2.0 if view.pose_known else 0.2 * view.ahead_m[1]
    low_m = 0.0 if view.pose_known else -tall_m / 2  # around the axis where no ground is known
    edges = ((view.across_m[0], view.ruler_m), view.ahead_m, (low_m, low_m + tall_m))
    space = np.stack(np.meshgrid(*edges, indexing="ij"), axis=-1).reshape(-1, 3)
    points = np.vstack([space, [0.0, 0.0, view.camera_height_m]])
    target = (points.min(axis=0) + points.max(axis=0)) / 2
    azimuth, elevation = EYE_RAD
    back = np.array(
        [
            np.cos(elevation) * np.cos(azimuth),
            np.cos(elevation) * np.sin(azimuth),
            np.sin(elevation),
        ]
    )
    right = np.array([-np.sin(azimuth), np.cos(azimuth), 0.0])
    up = np.cross(back, right)
    apart = points - target
    tan_up = np.tan(EYE_ANGLE_RAD / 2)
    width_px = (1 - view.left_share) * WINDOW_PX[0]
    tan_right = tan_up * width_px / (SCENE_SHARE * WINDOW_PX[1] - TITLE_PX)
    needed = apart @ back + np.maximum(
        np.abs(apart @ right) / tan_right, np.abs(apart @ up) / tan_up
    )
    return target + EYE_MARGIN * float(needed.max()) * back, target


def _back(view: CameraView, newest: int, oldest: int) -> rrb.VisibleTimeRanges:
    """Return the part of the past, in frames, that a trail of one age shows, on all clocks."""
    edge = rr.TimeRangeBoundary.cursor_relative
    start_s, end_s = (-frames * view.frame_ns / 1e9 for frames in (oldest, newest))
    return rrb.VisibleTimeRanges(
        [
            rrb.VisibleTimeRange(FRAME, start=edge(seq=-oldest), end=edge(seq=-newest)),
            *(
                rrb.VisibleTimeRange(clock, start=edge(seconds=start_s), end=edge(seconds=end_s))
                for clock in (TIME, ELAPSED)
            ),
        ]
    )


def _lanes(view: CameraView) -> rrb.StateTimelineView:
    tracks = "" if view.is_series_of_pictures else "Tracks: seen (bright), hidden, predicted. "
    others = [name for name, there in (("the worst errors", view.has_errors),) if there]
    return rrb.StateTimelineView(
        origin=path("cameras", view.camera, "lanes"),
        name=f"{tracks}When: {', '.join([*others, 'exposure', 'diagnostics'])}",
        time_view=_linked(),
    )


def _linked() -> rrb.TimeAxis:
    """Return a time axis that moves with all others."""
    return rrb.TimeAxis(link=LinkAxis.LinkToGlobal)


def _plots(view: CameraView) -> list[rrb.Tabs]:
    tabs: list[rrb.Container] = []
    best = "best method" if view.drawn_by == BEST else view.drawn_by
    drawn = _depth_and_height(view, view.drawn_by, best)
    if drawn is not None:
        tabs.append(drawn)
    others = (m for m in view.methods if m != view.drawn_by)
    tabs += [t for t in (_depth_and_height(view, m, m) for m in others) if t is not None]
    if view.has_errors:
        tabs.append(_errors(view))
    if view.exposure:
        tabs.append(_exposure(view))
    return [rrb.Tabs(*tabs, active_tab=0)] if tabs else []


def _depth_and_height(view: CameraView, entity: str, method: str) -> rrb.Vertical | None:
    plots = _curve_views(view, entity, method, ("depth", "height"))
    return rrb.Vertical(*plots, name=f"by {title(method)}") if plots else None


def _curve_views(
    view: CameraView, entity: str, method: str, quantities: Sequence[str]
) -> list[rrb.TimeSeriesView]:
    truth = ", white: truth" if view.has_truth else ""
    of = "" if view.track is None else f" of #{view.track}"
    known = "" if view.is_series_of_pictures else " where known within 20 %"
    spans = {"depth": view.depth_m, "height": view.height_m}
    names = {"depth": f"Depth{of}, m", "height": f"Height{of}{known}, m"}
    camera = path("cameras", view.camera)
    return [
        rrb.TimeSeriesView(
            origin=f"{camera}/{quantity}",
            contents=[path("cameras", view.camera, quantity, entity), "$origin/truth"],
            name=f"{names[quantity]}, by {title(method)}; band: 95 %{truth}",
            axis_x=_linked(),
            axis_y=rrb.ScalarAxis(range=spans[quantity]),
            plot_legend=rrb.PlotLegend(visible=False),
            overrides=_only_its_track(view, path("cameras", view.camera, quantity, entity)),
        )
        for quantity in quantities
        if spans[quantity] is not None
    ]


def _only_its_track(view: CameraView, entity: str) -> dict[str, rr.Measurements]:
    """Return what hides the lines of all other tracks, where one has the plots for itself."""
    if view.track_slot < 0:
        return {}
    shown = [slot == view.track_slot for slot in range(SLOTS)]
    return {entity: rr.Measurements.from_fields(visible_series=shown)}


def _errors(view: CameraView) -> rrb.Vertical:
    plots = [
        rrb.TimeSeriesView(
            origin=path("cameras", view.camera, "error"),
            contents=contents,
            name=name,
            axis_x=_linked(),
            plot_legend=rrb.PlotLegend(rrb.Corner2D.LeftTop),
        )
        for name, contents in (
            (
                "Depth error, % of the truth, median of each frame; diamonds: the worst",
                ["$origin/depth/**", "$origin/worst"],
            ),
            ("Height error, cm, median of each frame", ["$origin/height/**"]),
        )
    ]
    return rrb.Vertical(*plots, name="Errors")


def _exposure(view: CameraView) -> rrb.Grid:
    plots = [
        rrb.TimeSeriesView(
            origin=path("cameras", view.camera, "exposure", name),
            name=EXPOSURE[name][0],
            axis_x=_linked(),
            plot_legend=rrb.PlotLegend(visible=False),
        )
        for name in view.exposure
    ]
    return rrb.Grid(*plots, grid_columns=2 if len(plots) > 2 else 1, name="Exposure")
