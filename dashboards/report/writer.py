"""The accuracy report: one HTML file that needs no network, made of a database.

Text from recordings is data: Jinja escapes it in the page, and what goes into a chart is JSON without
a `<`. The page forbids itself to load anything.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from datetime import UTC, datetime
from itertools import groupby
from pathlib import Path
from typing import Any

from dashboards.page import template
from dashboards.report.data import ReportData, Row, read_report_data
from dashboards.report.thumbnails import Key, thumbnails
from dashboards.style import Z_95
from dashboards.timeline.documents import POSE_TEXTS
from pipeline import __version__
from pipeline.core.errors import MissingLibrary
from pipeline.core.extras import how_to_install
from pipeline.core.files import whole_file
from pipeline.estimate.methods import IN_ORDER
from pipeline.store.database import Store

TEMPLATE = "report.html.j2"


def write_report(
    database: Path, target: Path, advice_for: Callable[[str], str] = lambda code: ""
) -> None:
    """Write the report of a database.

    Args:
        database: DuckDB file.
        target: HTML file to write.
        advice_for: returns what to do about a finding, by the code of its diagnostic.

    Raises:
        StoreError: the database cannot be read.
        MissingLibrary: the extra `report` is not installed.
        StadimeterError: the file cannot be written.
    """
    charts_of = _library()
    with Store.open_current(database) as store:
        data = read_report_data(store)
        pictures = thumbnails(store, data.people)
    page = _page(database, data, charts_of(data), pictures, advice_for)
    with whole_file(target, "the report") as part:
        part.write_text(page, encoding="utf-8")


def _library() -> Callable[[ReportData], dict[str, Any]]:
    try:
        import altair  # noqa: F401
        import vl_convert  # noqa: F401
    except ImportError as error:
        raise MissingLibrary(
            f"the report needs a library that is not installed: {error.name}",
            remedy=how_to_install("report"),
        ) from error
    return _charts


def _charts(data: ReportData) -> dict[str, Any]:
    """Return the charts by name; lists of them where there is one a camera."""
    from dashboards.report import charts

    lists = ("errors", "by_range", "by_aperture", "heights", "ground", "exposure")
    drawn: dict[str, Any] = {name: [] for name in lists}
    for camera, rows in _of_cameras(data.errors):
        of_camera = [r for r in data.by_method if r["camera"] == camera]
        drawn["errors"].append(charts.errors_chart(rows, of_camera).properties(title=shown(camera)))
    for camera, rows in _of_cameras(data.by_range):
        drawn["by_range"].append(
            charts.range_chart(rows).properties(title=_titled(camera, "distance"))
        )
    for camera, rows in _of_cameras(data.by_aperture):
        if any(r["f_number"] is not None for r in rows):
            chart = charts.aperture_chart(rows).properties(title=_titled(camera, "aperture"))
            drawn["by_aperture"].append(chart)
    if data.coverage:
        drawn["coverage"] = charts.coverage_chart(data.coverage)
    for name, rows in _by_camera(data.track_heights):
        drawn["heights"].append(charts.heights_chart(rows, name))
    for name, rows in _by_camera(data.positions):
        drawn["ground"].append(charts.ground_chart(rows, name))
    for name, rows in _by_camera(data.exposure):
        chart = charts.exposure_chart(rows, name)
        drawn["exposure"] += [chart] if chart is not None else []
    return drawn


def _titled(camera: str, by: str) -> str:
    return f"{shown(camera)}: error by {by}"


def _of_cameras(rows: Iterable[Row]) -> Iterable[tuple[str, list[Row]]]:
    """Yield rows by camera: errors of a bench and of a street say nothing together."""
    ordered = sorted(rows, key=lambda r: str(r["camera"]))
    for camera, group in groupby(ordered, lambda r: r["camera"]):
        yield camera, list(group)


def _by_camera(rows: Iterable[Row]) -> Iterable[tuple[str, list[Row]]]:
    for (file_name, camera), group in groupby(rows, lambda r: (r["file_name"], r["camera"])):
        yield f"{shown(file_name)}, {shown(camera)}", list(group)


def _page(
    database: Path,
    data: ReportData,
    drawn: Mapping[str, Any],
    pictures: Mapping[Key, str],
    advice_for: Callable[[str], str],
) -> str:
    filters: dict[str, Callable[..., Any]] = {
        "shown": shown,
        "m": metres,
        "interval": interval,
        "number": number,
        "percent": percent,
        "clock": clock,
        "degrees": lambda angle: None if angle is None else math.degrees(angle),
    }
    specs = {
        name: [embedded(c.to_dict()) for c in chart]
        if isinstance(chart, list)
        else embedded(chart.to_dict())
        for name, chart in drawn.items()
    }
    return template("dashboards.report", TEMPLATE, filters).render(
        data=data,
        people=[(name, _with_pictures(rows, pictures)) for name, rows in _by_camera(data.people)],
        poses_of={_place(c): c for c in data.cameras},
        warnings=[d for d in data.diagnostics if d["severity"] != "info"],
        advice_for=advice_for,
        charts=specs,
        bundle=_bundle().replace("</script", "<\\/script"),
        database=database.name,
        made_at=f"{datetime.now(UTC):%Y-%m-%d %H:%M} UTC",
        version=__version__,
        methods={method.name: method.text for method in IN_ORDER},
        poses=POSE_TEXTS,
        z_95=Z_95,
        span=_span_text(data.recordings),
    )


def _place(row: Row) -> str:
    return f"{shown(row['file_name'])}, {shown(row['camera'])}"


def _with_pictures(rows: Iterable[Row], pictures: Mapping[Key, str]) -> list[Row]:
    return [
        r | {"picture": pictures.get((r["recording_id"], r["camera"], r["track_id"]))} for r in rows
    ]


def _bundle() -> str:
    import vl_convert

    # Its stub wants a snippet; without one it makes `vegaEmbed` known to the page.
    return str(vl_convert.javascript_bundle(None))  # type: ignore[arg-type]


def embedded(spec: Mapping[str, Any]) -> str:
    """Return a chart as JSON that may stand in a script: with nothing in it that ends one."""
    text = json.dumps(spec, allow_nan=False, separators=(",", ":"), default=shown)
    return text.replace("<", "\\u003c").replace("\u2028", "\\u2028").replace("\u2029", "\\u2029")


def shown(text: object) -> str:
    """Return text from a file with what cannot be seen, or turns others around, made visible."""
    return "".join(c if c.isprintable() else repr(c)[1:-1] for c in str(text))


def metres(value: float | None) -> str:
    """Return metres to the millimetre below ten, to the centimetre above."""
    if value is None or not math.isfinite(value):
        return ""
    return f"{value:.3f}" if abs(value) < 10 else f"{value:.2f}"


def interval(low: float | None, high: float | None) -> str:
    """Return the two ends of an interval in metres; nothing where it is not known."""
    if low is None or high is None:
        return ""
    return f"{metres(low)} to {metres(high)}"


def number(value: float | None, digits: int = 3) -> str:
    """Return a number to some significant digits, a count with separators."""
    if value is None or (isinstance(value, float) and not math.isfinite(value)):
        return ""
    return f"{value:,}" if isinstance(value, int) else f"{value:.{digits}g}"


def percent(share: float | None, digits: int = 0) -> str:
    """Return a share as percent."""
    return "" if share is None else f"{100 * share:.{digits}f} %"


def clock(time_ns: int | None) -> str:
    """Return a time as date and time in UTC."""
    if time_ns is None:
        return ""
    try:
        return f"{datetime.fromtimestamp(time_ns / 1e9, UTC):%Y-%m-%d %H:%M:%S.%f}"[:-3]
    except (OverflowError, ValueError, OSError):
        return f"{time_ns:,} ns"


def _span_text(recordings: Sequence[Row]) -> str:
    starts = [r["start_time_ns"] for r in recordings if r["start_time_ns"] is not None]
    ends = [r["end_time_ns"] for r in recordings if r["end_time_ns"] is not None]
    if not starts or not ends:
        return ""
    return f"{clock(min(starts))[:16]} to {clock(max(ends))[:16]} UTC"
