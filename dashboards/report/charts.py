"""Charts of the report, in Vega-Lite, made with Altair: rows in, charts out.

Every chart has a tooltip on each mark; those of single observations can be zoomed and dragged, a
method can be picked out in their legend, and points that are marked in one show in the others.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import altair as alt

from dashboards.report.data import Row, rounded
from dashboards.style import METHOD_COLOURS, on_white
from pipeline.estimate.methods import NAMES, in_order

# Okabe and Ito (2008), without the yellow that a white page swallows.
COLOURS = ("#0072B2", "#E69F00", "#009E73", "#CC79A7", "#56B4E9", "#D55E00")
WIDE_PX, HALF_PX, TALL_PX = 1020, 450, 340
# From here on a linear axis would hide the near part.
LOG_FROM_RATIO = 8.0
GREY = "#767676"
_SINCE = "time since the start of the recording, s"


def _colour(rows: Sequence[Row], **options: Any) -> alt.Color:
    present = {row["method"] for row in rows}
    methods = in_order(present)
    colours = {name: on_white(colour) for name, colour in METHOD_COLOURS.items()}
    scale = alt.Scale(domain=methods, range=[colours.get(m, GREY) for m in methods])
    return alt.Color("method:N", scale=scale, title="method", **options)


def _depth_scale(rows: Sequence[Row]) -> alt.Scale:
    """Return an axis for depths: logarithmic where they span near and far."""
    depths = [r[name] for r in rows for name in ("true_depth_m", "depth_m") if r[name]]
    near, far = min(depths), max(depths)
    kind = "log" if near > 0 and far / near > LOG_FROM_RATIO else "linear"
    # One wild interval must not stretch the axis: what goes on beyond it is cut at its end.
    margin = 0.05 * (far - near) or 0.05 * max(abs(far), 1.0)
    ends = [near / 1.3, far * 1.3] if kind == "log" else [near - margin, far + margin]
    return alt.Scale(type=kind, zero=False, nice=False, domain=ends, clamp=True)


def _layer(row: Row) -> int:
    """Return when a point is drawn: the best method last, so that nothing covers it."""
    order = list(NAMES)
    return -order.index(row["method"]) if row["method"] in order else -len(order)


def _above_zero(row: Row) -> float | None:
    """Return the lower end of an interval, kept where an axis of logarithms can show it."""
    low: float | None = row["depth_low_m"]
    return None if low is None else max(low, min(row["depth_m"], row["true_depth_m"]) / 10)


def _zoom(name: str) -> alt.Parameter:
    return alt.selection_interval(name=name, bind="scales")


_WHERE = ("file_name:N", "camera:N", "frame_index:Q", "captured_at:N", "track_id:Q", "object_id:N")
_TIP_FIELDS = ("method:N", *_WHERE, "true_depth_m:Q", "depth_m:Q", "depth_error_m:Q", "f_number:Q")


def errors_chart(rows: list[Row], by_method: list[Row]) -> alt.Chart:
    """Return estimated against actual, Bland-Altman and error over time, linked.

    Args:
        rows: observations with `true_depth_m` and `depth_m`; none may be empty.
        by_method: the rows of `accuracy.by_method`, for the limits of agreement.
    """
    on_top = sorted(rows, key=_layer)
    data = alt.Data(values=rounded([r | {"depth_low_m": _above_zero(r)} for r in on_top]))
    picked = alt.selection_point(name="method_picked", fields=["method"], bind="legend")
    marked = alt.selection_interval(encodings=["x"], name="marked")
    seen = alt.when(picked & marked).then(alt.value(0.75)).otherwise(alt.value(0.06))
    colour = _colour(rows, legend=alt.Legend(orient="top"))
    scale = _depth_scale(rows)
    points = alt.Chart(data).encode(color=colour, opacity=seen, tooltip=list(_TIP_FIELDS))

    actual = points.encode(alt.X("true_depth_m:Q", title="actual depth, m", scale=scale))
    interval = actual.mark_rule(strokeWidth=1).encode(
        alt.Y("depth_low_m:Q", title="estimated depth, m (line: 95 % interval)", scale=scale),
        alt.Y2("depth_high_m:Q"),
    )
    dots = (
        actual.mark_circle(size=28)
        .encode(alt.Y("depth_m:Q", scale=scale))
        .add_params(picked, _zoom("zoom_actual"))
    )
    ends = [r["true_depth_m"] for r in rows]
    identity = (
        alt.Chart(alt.Data(values=[{"d": min(ends)}, {"d": max(ends)}]))
        .mark_line(color=GREY, strokeDash=[4, 3])
        .encode(alt.X("d:Q", scale=scale), alt.Y("d:Q", scale=scale))
    )
    against = (identity + interval + dots).properties(
        title="Estimated and actual depth", width=HALF_PX, height=TALL_PX
    )
    below = _over_time(points, marked)
    agreement = _bland_altman(points, by_method, scale, colour)
    return alt.vconcat(
        alt.hconcat(
            against,
            agreement,
        ).resolve_scale(color="shared"),
        below,
    )


def _bland_altman(
    points: alt.Chart, by_method: list[Row], scale: alt.Scale, colour: alt.Color
) -> alt.LayerChart:
    lines = [
        {"method": row["method"], "at_m": row[name], "line": label}
        for row in by_method
        for name, label in (
            ("depth_bias_m", "mean error"),
            ("depth_loa_low_m", "95 % limit of agreement"),
            ("depth_loa_high_m", "95 % limit of agreement"),
        )
        if row[name] is not None
    ]
    rules = (
        alt.Chart(alt.Data(values=rounded(lines)))
        .mark_rule(strokeWidth=1.5)
        .encode(
            y="at_m:Q",
            color=colour,
            strokeDash=alt.StrokeDash(
                "line:N",
                title=None,
                legend=alt.Legend(orient="top"),
                scale=alt.Scale(
                    domain=["mean error", "95 % limit of agreement"], range=[[1, 0], [5, 4]]
                ),
            ),
            tooltip=["method:N", "line:N", "at_m:Q"],
        )
    )
    dots = points.mark_circle(size=28).encode(
        alt.X("mean_depth_m:Q", title="mean of estimated and actual depth, m", scale=scale),
        alt.Y("depth_error_m:Q", title="estimated minus actual depth, m"),
    )
    dots = dots.add_params(_zoom("zoom_agreement"))
    return (dots + rules).properties(
        title="Agreement (Bland and Altman)", width=HALF_PX, height=TALL_PX
    )


def _over_time(points: alt.Chart, marked: alt.Parameter) -> alt.LayerChart:
    zero = alt.Chart(alt.Data(values=[{"y": 0}])).mark_rule(color=GREY).encode(y="y:Q")
    dots = points.mark_circle(size=22).encode(
        alt.X("time_s:Q", title=_SINCE),
        alt.Y("depth_error_m:Q", title="estimated minus actual depth, m"),
    )
    title = "Error over time: select a period to show only that period above"
    return (zero + dots.add_params(marked)).properties(title=title, width=WIDE_PX, height=180)


def range_chart(rows: list[Row]) -> alt.FacetChart | alt.LayerChart:
    """Return RMSE by bins of the actual depth, with 95 % intervals."""
    named = [r | {"bin": _bin(r)} for r in rows]
    bins = list(dict.fromkeys(r["bin"] for r in sorted(named, key=_from_m)))
    return _rmse_by("bin:N", bins, "actual depth, m", named, "Error by distance")


def aperture_chart(rows: list[Row]) -> alt.FacetChart | alt.LayerChart:
    """Return RMSE by f-number, with 95 % intervals."""
    known = [r | {"bin": f"f/{r['f_number']:g}"} for r in rows if r["f_number"] is not None]
    bins = list(dict.fromkeys(r["bin"] for r in sorted(known, key=lambda r: r["f_number"])))
    return _rmse_by("bin:N", bins, "aperture", known, "Error by aperture")


def _from_m(row: Row) -> float:
    return row["true_depth_from_m"] or 0.0


def _bin(row: Row) -> str:
    low, high = row["true_depth_from_m"], row["true_depth_to_m"]
    return f"{low:g}-{high:g}" if high is not None else f"over {low:g}"


def _rmse_by(field: str, bins: list[str], title: str, rows: list[Row], name: str) -> alt.LayerChart:
    shown = ["method", "bin", "depth_count", "track_count", "depth_rmse_m", "depth_rmse_low_m"]
    shown += ["depth_rmse_high_m", "depth_bias_m", "depth_abs_rel", "depth_coverage_95"]
    values = [{k: r[k] for k in shown} for r in rows]
    rmse_m = [v["depth_rmse_m"] for v in values if v["depth_rmse_m"]]
    # Centimetres beside metres: a linear axis would show only the metres.
    is_wide = bool(rmse_m) and max(rmse_m) > LOG_FROM_RATIO * min(rmse_m)
    scale = alt.Scale(type="log", nice=True) if is_wide else alt.Scale(zero=True)
    if is_wide:
        for value in values:
            value["depth_rmse_low_m"] = max(value["depth_rmse_low_m"] or 0, min(rmse_m) / 2)
    base = alt.Chart(alt.Data(values=rounded(values))).encode(
        alt.X(field, title=title, sort=bins, axis=alt.Axis(labelAngle=0, grid=True)),
        xOffset="method:N",
        color=_colour(rows, legend=alt.Legend(orient="top")),
        tooltip=[f"{k}:{'N' if k in ('method', 'bin') else 'Q'}" for k in shown],
    )
    dots = base.mark_circle(size=70, opacity=1).encode(
        alt.Y("depth_rmse_m:Q", title="RMSE of depth, m", scale=scale)
    )
    rules = base.mark_rule(strokeWidth=2, opacity=0.6).encode(
        alt.Y("depth_rmse_low_m:Q", scale=scale), alt.Y2("depth_rmse_high_m:Q")
    )
    return (rules + dots).properties(title=name, width=HALF_PX - 40, height=280)


def coverage_chart(rows: list[Row]) -> alt.FacetChart:
    """Return how often intervals hold the truth against how often they say they do."""
    data = alt.Data(values=rounded(rows))
    share = alt.Scale(domain=[0.4, 1.0])
    percent = alt.Axis(format="%", values=[0.5, 0.8, 0.95])
    base = alt.Chart(data).encode(
        alt.X("nominal:Q", title="nominal", scale=share, axis=percent),
        color=_colour(rows),
        tooltip=[
            "method:N",
            "quantity:N",
            "nominal:Q",
            "observed:Q",
            "observed_low:Q",
            "observed_high:Q",
            "estimate_count:Q",
            "track_count:Q",
            "mean_width_m:Q",
        ],
    )
    line = base.mark_line(point=alt.OverlayMarkDef(size=45)).encode(
        alt.Y("observed:Q", title="observed", scale=alt.Scale(domain=[0, 1]), axis=_PERCENT)
    )
    rules = base.mark_rule(opacity=0.5).encode(
        alt.Y("observed_low:Q"),
        alt.Y2("observed_high:Q"),
    )
    ideal = base.mark_line(color=GREY, strokeDash=[4, 3]).encode(
        y="nominal:Q", color=alt.value(GREY)
    )
    return (
        (ideal + rules + line)
        .properties(width=HALF_PX - 30, height=260)
        .facet(column=alt.Column("quantity:N", title=None))
        .properties(title="Share of intervals that contain the truth")
    )


_PERCENT = alt.Axis(format="%")
REMARKS = ("measured", "assumed", "not one object")


def heights_chart(rows: list[Row], object_name: str) -> alt.LayerChart:
    """Return the height of each track of one camera with its interval, and the truth where known."""
    known = [r | {"track": f"#{r['track_id']}", "remark": _remark(r)} for r in rows]
    order = [r["track"] for r in known]
    data = alt.Data(values=rounded(known))
    colours = alt.Scale(domain=list(REMARKS), range=["#0072B2", "#999999", "#D55E00"])
    tips = [
        "track:N",
        "class_name:N",
        "method:N",
        "height_m:Q",
        "height_low_m:Q",
        "height_high_m:Q",
    ]
    tips += ["true_height_m:Q", "observation_count:Q", "depth_min_m:Q", "depth_max_m:Q", "remark:N"]
    base = alt.Chart(data).encode(
        alt.Y("track:N", title="track", sort=order),
        color=alt.Color("remark:N", scale=colours, title="height"),
        tooltip=tips,
    )
    scale = _height_scale(rows)
    rule = base.mark_rule(strokeWidth=2, clip=True).encode(
        alt.X("height_low_m:Q", title="height, m (line: 95 % interval)", scale=scale),
        alt.X2("height_high_m:Q"),
    )
    dot = base.mark_circle(size=50, opacity=1).encode(alt.X("height_m:Q", scale=scale))
    layers = rule + dot
    if any(r["true_height_m"] is not None for r in rows):
        layers += base.mark_tick(thickness=2.5, size=11, color="#000000").encode(
            alt.X("true_height_m:Q", scale=scale), color=alt.value("#000000")
        )
    return layers.properties(title=object_name, width=WIDE_PX - 120, height={"step": 13})


def _height_scale(rows: Sequence[Row]) -> alt.Scale:
    """Return an axis that holds all heights and nine of ten intervals; the others go on beyond it."""
    lows = sorted(r["height_low_m"] for r in rows)
    highs = sorted(r["height_high_m"] for r in rows)
    heights = [r["height_m"] for r in rows]
    heights += [r["true_height_m"] for r in rows if r["true_height_m"] is not None]
    low = min(lows[len(lows) // 10], *heights)
    high = max(highs[-1 - len(highs) // 10], *heights)
    margin = 0.04 * max(high - low, 0.05)
    return alt.Scale(
        zero=False, nice=False, domain=[max(low - margin, 0.0), high + margin], clamp=True
    )


def _remark(row: Mapping[str, Any]) -> str:
    if row["height_assumed"]:
        return REMARKS[1]
    return REMARKS[2] if row["height_plausible"] is False else REMARKS[0]


def ground_chart(rows: list[Row], name: str) -> alt.LayerChart:
    """Return where the tracks of one camera went, seen from above; the camera is at the origin."""
    data = alt.Data(values=rounded(rows))
    x_m, y_m = [r["x_m"] for r in rows], [r["y_m"] for r in rows]
    left, right = min(0.0, *x_m), max(0.0, *x_m)
    far = max(*y_m, 1.0)
    # One scale for both axes, or angles would lie. Ahead of the camera is to the right of the page, so
    # that a long street fits.
    px_per_m = min((WIDE_PX - 60) / far, 480 / max(right - left, 1.0))
    axes = {
        "x": alt.X("y_m:Q", title="ahead of the camera, m", scale=_span(0.0, far)),
        "y": alt.Y("x_m:Q", title="to the right of it, m", scale=_span(left, right, reverse=True)),
    }
    picked = alt.selection_point(
        fields=["track"], name="track_picked", on="pointerover", nearest=True, empty=False
    )
    base = alt.Chart(data).encode(
        **axes, color=alt.Color("track:N", scale=alt.Scale(range=list(COLOURS)), legend=None)
    )
    lines = base.mark_line(strokeWidth=1.2).encode(
        order="frame_index:Q",
        strokeWidth=alt.when(picked).then(alt.value(3)).otherwise(alt.value(1.2)),
    )
    dots = base.mark_circle(size=9).encode(
        tooltip=["track:N", "frame_index:Q", "x_m:Q", "y_m:Q", "depth_m:Q", "method:N"]
    )
    camera = (
        alt.Chart(alt.Data(values=[{"x_m": 0, "y_m": 0, "is": "the camera"}]))
        .mark_point(shape="triangle-right", size=120, filled=True, color="#000000")
        .encode(x="y_m:Q", y="x_m:Q", tooltip="is:N")
    )
    ends = list({r["track"]: r for r in rows}.values())  # the last place of each
    named = [
        {"x_m": r["x_m"], "y_m": r["y_m"], "track": r["track"], "is": f"#{r['track_id']}"}
        for r in ends
    ]
    names = (
        alt.Chart(alt.Data(values=rounded(named)))
        .mark_text(dx=9, dy=-5, fontSize=11)
        .encode(
            alt.X("y_m:Q"),
            alt.Y("x_m:Q"),
            text="is:N",
            color=alt.Color("track:N", scale=alt.Scale(range=list(COLOURS)), legend=None),
        )
    )
    layers = lines + dots.add_params(picked, _zoom("zoom_actual")) + camera + names
    layers += _scale_bar(far, left, right)
    width, height = px_per_m * far, px_per_m * max(right - left, 1.0)
    return layers.properties(title=name, width=max(width, 120), height=max(height, 60))


def _scale_bar(far: float, left: float, right: float) -> alt.LayerChart:
    """Return a bar of 1, 2 or 5 metres or ten times that, about a fifth of the way ahead."""
    steps = [m * 10.0**e for e in range(-2, 5) for m in (1, 2, 5)]
    long_m = max((s for s in steps if s <= far / 5), default=steps[0])
    x_m = right - 0.06 * max(right - left, 1.0)
    bar = [{"from": 0.02 * far, "to": 0.02 * far + long_m, "x_m": x_m, "is": f"{long_m:g} m"}]
    base = alt.Chart(alt.Data(values=bar)).encode(y="x_m:Q")
    line = base.mark_rule(strokeWidth=4, color="#000000").encode(x="from:Q", x2="to:Q")
    text = base.mark_text(align="left", dy=-9, color="#000000").encode(x="from:Q", text="is:N")
    return line + text


def _span(low: float, high: float, *, reverse: bool = False) -> alt.Scale:
    return alt.Scale(domain=[low, max(high, low + 1.0)], nice=False, zero=False, reverse=reverse)


EXPOSURE_TITLES = {
    "f_number": "f-number",
    "ev100": "EV at ISO 100",
    "iso_speed": "ISO",
    "exposure_time_s": "exposure time, s",
    "luminance": "luminance, 0-1",
    "clipped_fraction": "clipped share",
}


def exposure_chart(rows: list[Row], name: str) -> alt.VConcatChart | None:
    """Return how one camera exposed over time; None where nothing is known of it."""
    data = alt.Data(values=rounded(rows))
    known = [field for field in EXPOSURE_TITLES if any(r[field] is not None for r in rows)]
    if not known:
        return None
    panels = [
        alt.Chart(data)
        .mark_line(point=alt.OverlayMarkDef(size=12), strokeWidth=1, color=COLOURS[0])
        .encode(
            alt.X("time_s:Q", title=_SINCE if field == known[-1] else None),
            alt.Y(f"{field}:Q", title=EXPOSURE_TITLES[field], scale=alt.Scale(zero=False)),
            tooltip=["frame_index:Q", "time_s:Q", *(f"{f}:Q" for f in known)],
        )
        .properties(width=WIDE_PX, height=80)
        for field in known
    ]
    # The panels share their axis, so that what moves one moves all.
    panels[0] = panels[0].add_params(
        alt.selection_interval(name="zoom_time", bind="scales", encodings=["x"])
    )
    return alt.vconcat(*panels, title=name).resolve_scale(x="shared")
