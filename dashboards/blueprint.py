"""How the timeline opens: picture and scene above, curves below, text at the side."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import rerun as rr
import rerun.blueprint as rrb

from dashboards.scene import FRAME, path

TRAIL_FRAMES = 100


@dataclass(frozen=True, slots=True)
class CameraView:
    """What there is to show of one camera."""

    camera: str
    method: str | None
    pose_known: bool
    camera_height_m: float
    depth_m: tuple[float, float, float]  # low end, middle and high end of what is drawn
    height_m: tuple[float, float, float]
    has_heights: bool
    has_exposure: bool
    has_truth: bool


def blueprint(views: Sequence[CameraView]) -> rrb.Blueprint:
    """Return the layout for the cameras of a recording, a tab each if there are several."""
    texts = rrb.Tabs(
        rrb.TextDocumentView(origin="about", name="About"),
        rrb.TextDocumentView(origin="tracks", name="Tracks"),
        rrb.TextLogView(origin="diagnostics", name="Diagnostics"),
        active_tab=1,
    )
    cameras = [_camera(view) for view in views]
    main = cameras[0] if len(cameras) == 1 else rrb.Tabs(*cameras)
    body = rrb.Horizontal(main, texts, column_shares=[3, 1]) if cameras else texts
    return rrb.Blueprint(
        body,
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline=FRAME),
        auto_views=False,
    )


def _camera(view: CameraView) -> rrb.Vertical:
    above = rrb.Horizontal(_picture(view), _scene(view), column_shares=[6, 5])
    return rrb.Vertical(above, _curves(view), row_shares=[3, 2], name=view.camera)


def _picture(view: CameraView) -> rrb.Spatial2DView:
    return rrb.Spatial2DView(
        origin=path(view.camera, "camera"),
        contents=["$origin/image", "$origin/tracks", "$origin/labels"],
        name="Picture",
    )


def _scene(view: CameraView) -> rrb.Spatial3DView:
    trail = path(view.camera, "trail")
    back = rrb.VisibleTimeRanges(
        timeline=FRAME,
        range=rr.TimeRange(
            start=rr.TimeRangeBoundary.cursor_relative(seq=-TRAIL_FRAMES),
            end=rr.TimeRangeBoundary.cursor_relative(),
        ),
    )
    middle = view.depth_m[1]
    eye = rrb.EyeControls3D(
        kind=rrb.Eye3DKind.Orbital,
        position=[-0.75 * middle, -0.05 * middle, 0.5 * middle],
        look_target=[0.0, 0.85 * middle, 0.0],
        eye_up=[0.0, 0.0, 1.0],
    )
    return rrb.Spatial3DView(
        origin=path(view.camera),
        contents=["$origin/camera/**", "$origin/people", "$origin/trail"],
        name="Ground, in metres" if view.pose_known else "Scene, in metres",
        line_grid=rrb.LineGrid3D(visible=view.pose_known, spacing=1.0 if middle < 15 else 5.0),
        eye_controls=eye,
        overrides={trail: [back]},
    )


def _curves(view: CameraView) -> rrb.Horizontal | rrb.Vertical:
    method = view.method or "none"
    plots = [_plot(view, "depth", method, f"Depth by {method}, m (band: 95 %)")]
    if view.has_heights:
        plots.append(_plot(view, "height", method, f"Height by {method}, m (band: 95 %)"))
    every = _plot(view, "depth", "**", "Depth by every method, m")
    tabs = [rrb.Horizontal(*plots, name="Curves"), every]
    exposure = rrb.TimeSeriesView(
        origin=path(view.camera, "exposure"), name="f-number, EV100, relative luminance"
    )
    tabs.append(exposure)
    return rrb.Tabs(*tabs, active_tab=0)


def _plot(view: CameraView, quantity: str, method: str, title: str) -> rrb.TimeSeriesView:
    low, _, high = view.height_m if quantity == "height" else view.depth_m
    contents = ["$origin/**"] if method == "**" else [f"$origin/{method}/**", "$origin/truth/**"]
    return rrb.TimeSeriesView(
        origin=path(view.camera, quantity),
        contents=contents,
        name=title,
        axis_y=rrb.ScalarAxis(range=(low, high)),
        plot_legend=rrb.PlotLegend(visible=False),
    )
