"""How the timeline opens: the picture large, curves below it, the scene and the texts beside it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from dashboards.columns import BEST, CameraRows
from dashboards.curves import CURVES_SHOWN, EXPOSURE, exposure_curves, longest_tracks
from dashboards.names import path, title
from dashboards.scene import TRAILS, Pose, lens_known
from dashboards.stream import FRAME, TIME
from pipeline.records import FloatArray

APPLICATION = "stadimeter"
# Spacings of the grid on the ground, in metres; about ten lines to what is seen.
GRIDS_M = (0.1, 0.5, 1.0, 5.0, 10.0, 50.0)
Span = tuple[float, float]


@dataclass(frozen=True, slots=True)
class CameraView:
    """What there is to show of one camera."""

    camera: str
    drawn_by: str  # a method, or `best`
    methods: tuple[str, ...]
    pose_known: bool
    camera_height_m: float
    frame_ns: int  # the time from a frame to the next
    across_m: tuple[float, float]  # the middle and the far end of where things are
    ahead_m: tuple[float, float]
    depth_m: Span | None  # what a plot shows; None: nothing to plot
    height_m: Span | None
    exposure: tuple[str, ...]
    track_count: int
    as_series: bool  # one curve for all, because nothing is followed

    @property
    def middle_m(self) -> float:
        """Return how far away things are, on the whole."""
        return max(self.ahead_m[0], 0.05)


def camera_view(rows: CameraRows) -> CameraView:
    """Return what there is to show of a camera."""
    best, pose = rows.best, Pose.of(rows.camera)
    rate_hz = rows.frames.rate_hz()
    x_m, y_m = (best.x_m, best.y_m) if lens_known(rows.camera) else (np.empty(0), np.empty(0))
    plotted = np.isin(rows.observations.track, longest_tracks(rows)[:CURVES_SHOWN])
    plotted |= rows.is_series_of_pictures
    return CameraView(
        camera=rows.name,
        drawn_by=rows.drawn_by,
        methods=rows.methods,
        pose_known=pose.known,
        camera_height_m=pose.height_m,
        frame_ns=int(1e9 / rate_hz) if rate_hz else 0,
        across_m=_spread(x_m, 0.0),
        ahead_m=_spread(y_m, 1.0),
        depth_m=_span(best.depth_m[plotted], rows.truth.depth_m),
        height_m=_span(best.measured_height_m[plotted], rows.truth.height_m),
        exposure=tuple(exposure_curves(rows.frames)),
        track_count=len(rows.tracks.track_id),
        as_series=rows.is_series_of_pictures,
    )


def _spread(values: FloatArray, default: float) -> tuple[float, float]:
    known = values[np.isfinite(values)]
    if not len(known):
        return default, default
    middle, far = np.quantile(known, [0.5, 0.85]).tolist()
    return middle, far


def _span(values: FloatArray, truth: FloatArray) -> Span | None:
    """Return what a plot shows: the truth and nearly all values; outliers may leave it."""
    known, true = values[np.isfinite(values)], truth[np.isfinite(truth)]
    if not len(known) and not len(true):
        return None
    ends = np.concatenate([np.quantile(known, [0.01, 0.99]) if len(known) else known, true])
    low, high = float(ends.min()), float(ends.max())
    margin = 0.15 * (high - low) + 0.03 * abs(high)
    return max(low - margin, 0.0), high + margin


def blueprint(views: Sequence[CameraView]) -> rrb.Blueprint:
    """Return the layout for the cameras of a recording, a tab each if there are several."""
    cameras = [_camera(view) for view in views]
    if not cameras:
        body: rrb.Container = _texts()
    elif len(cameras) == 1:
        body = cameras[0]
    else:
        body = rrb.Tabs(*cameras, active_tab=0)
    rate_hz = next((1e9 / v.frame_ns for v in views if v.frame_ns), 10.0)
    return rrb.Blueprint(
        body,
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(
            state="collapsed",
            # Each camera counts its own frames: only the time is common to several.
            timeline=FRAME if len(views) == 1 else TIME,
            fps=min(max(rate_hz, 1.0), 60.0),
            loop_mode="all",
        ),
        auto_views=False,
    )


def _camera(view: CameraView) -> rrb.Horizontal:
    left = [_picture(view), *_plots(view)]
    right = [_scene(view), _texts()]
    return rrb.Horizontal(
        rrb.Vertical(*left, row_shares=[9, 5][: len(left)]),
        rrb.Vertical(*right, row_shares=[6, 5]),
        column_shares=[3, 2],
        name=title(view.camera),
    )


def _texts() -> rrb.Tabs:
    return rrb.Tabs(
        rrb.TextDocumentView(origin="tracks", name="Tracks"),
        rrb.TextDocumentView(origin="about", name="About"),
        rrb.TextLogView(origin="diagnostics", name="Diagnostics"),
        active_tab=0,
    )


def _picture(view: CameraView) -> rrb.Spatial2DView:
    return rrb.Spatial2DView(
        origin=path("cameras", view.camera, "camera"),
        contents=["$origin/image", "$origin/truth", "$origin/tracks", "$origin/labels"],
        name=f"{title(view.camera)}: track, depth, ↕ height (± 95 %)",
    )


def _scene(view: CameraView) -> rrb.Spatial3DView:
    grid_m = next((g for g in GRIDS_M if g >= view.ahead_m[1] / 10), GRIDS_M[-1])
    name = f"Ground from the side, grid of {grid_m:g} m" if view.pose_known else "Scene, in metres"
    return rrb.Spatial3DView(
        origin=path("cameras", view.camera),
        contents=[
            "$origin/camera",
            "$origin/camera/image",
            "$origin/people",
            "$origin/numbers",
            "$origin/truth",
            "$origin/trails/**",
        ],
        name=name,
        line_grid=rrb.LineGrid3D(visible=view.pose_known, spacing=grid_m),
        eye_controls=_eye(view),
        overrides={
            path("cameras", view.camera, "trails", age): [_back(view, *frames[:2])]
            for age, frames in TRAILS.items()
        },
    )


def _eye(view: CameraView) -> rrb.EyeControls3D:
    """Return an eye to the right of camera and people, so that they stand before it left to right."""
    across, ahead = view.across_m[0], max(view.ahead_m[1], 0.1)
    above = 0.38 * ahead if view.pose_known else 0.3 * ahead
    return rrb.EyeControls3D(
        kind=rrb.Eye3DKind.Orbital,
        position=[across + 0.85 * ahead, 0.12 * ahead, above],
        look_target=[across, 0.52 * ahead, 0.0],
        eye_up=[0.0, 0.0, 1.0],
    )


def _back(view: CameraView, newest: int, oldest: int) -> rrb.VisibleTimeRanges:
    """Return the part of the past, in frames, that a trail of one age shows, on both clocks."""
    edge = rr.TimeRangeBoundary.cursor_relative
    return rrb.VisibleTimeRanges(
        [
            rrb.VisibleTimeRange(FRAME, start=edge(seq=-oldest), end=edge(seq=-newest)),
            rrb.VisibleTimeRange(
                TIME,
                start=edge(seconds=-oldest * view.frame_ns / 1e9),
                end=edge(seconds=-newest * view.frame_ns / 1e9),
            ),
        ]
    )


def _plots(view: CameraView) -> list[rrb.Container]:
    tabs: list[rrb.Container] = []
    best = "best method" if view.drawn_by == BEST else view.drawn_by
    drawn = _depth_and_height(view, view.drawn_by, best, "Depth and height")
    if drawn is not None:
        tabs.append(drawn)
    for method in view.methods:
        if method == view.drawn_by:
            continue
        by_method = _depth_and_height(view, method, method, f"by {method}")
        if by_method is not None:
            tabs.append(by_method)
    if view.exposure:
        plots = [
            rrb.TimeSeriesView(
                origin=path("cameras", view.camera, "exposure", name),
                name=EXPOSURE[name],
                plot_legend=rrb.PlotLegend(visible=False),
            )
            for name in view.exposure
        ]
        tabs.append(rrb.Horizontal(*plots, name="Exposure"))
    return [rrb.Tabs(*tabs, active_tab=0)] if tabs else []


def _depth_and_height(
    view: CameraView, entity: str, method: str, name: str
) -> rrb.Horizontal | None:
    of = "" if view.track_count <= CURVES_SHOWN or view.as_series else " of the longest tracks"
    plots = [
        rrb.TimeSeriesView(
            origin=path("cameras", view.camera, quantity),
            contents=[f"$origin/{entity}/**", "$origin/truth/**"],
            name=f"{quantity.capitalize()}{of} by {method}, m (band: 95 %)",
            axis_y=rrb.ScalarAxis(range=span),
            plot_legend=rrb.PlotLegend(visible=False),
        )
        for quantity, span in (("depth", view.depth_m), ("height", view.height_m))
        if span is not None
    ]
    return rrb.Horizontal(*plots, name=name) if plots else None
