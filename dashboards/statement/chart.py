"""Chart of the heights of single frames, as SVG that needs no script."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

Row = Mapping[str, Any]

WIDE, TALL = 760, 260
LEFT, RIGHT, TOP, BOTTOM = 52, 12, 12, 34
MOST_POINTS = 600


def heights_chart(frames: Sequence[Row], low_m: float, high_m: float, best_m: float) -> str:
    """Return heights over time, each with its interval, and that of the track as a band.

    The axis holds the band and all but the wildest of the single heights.
    """
    known = [f for f in frames if f["height_m"] is not None and math.isfinite(f["height_m"])]
    known = known[:: max(1, -(-len(known) // MOST_POINTS))]
    if len(known) < 2:
        return ""
    start_ns = known[0]["capture_time_ns"]
    times = [(f["capture_time_ns"] - start_ns) / 1e9 for f in known]
    values = sorted(f["height_m"] for f in known)
    inner = values[len(values) // 50], values[-1 - len(values) // 50]
    bottom, top = min(low_m, inner[0]) - 0.05, max(high_m, inner[1]) + 0.05
    span_s = max(times[-1], 1e-9)

    def x(time_s: float) -> float:
        return LEFT + (WIDE - LEFT - RIGHT) * time_s / span_s

    def y(height: float) -> float:
        share = (min(max(height, bottom), top) - bottom) / (top - bottom)
        return TALL - BOTTOM - (TALL - BOTTOM - TOP) * share

    parts = [
        f'<svg viewBox="0 0 {WIDE} {TALL}" role="img" '
        f'aria-label="Heights of {len(known)} frames over time">',
        f'<rect class="band" x="{LEFT}" y="{y(high_m):.1f}" width="{WIDE - LEFT - RIGHT}" '
        f'height="{y(low_m) - y(high_m):.1f}"/>',
        f'<line class="best" x1="{LEFT}" x2="{WIDE - RIGHT}" y1="{y(best_m):.1f}" y2="{y(best_m):.1f}"/>',
    ]
    for tick in _ticks(bottom, top):
        parts.append(
            f'<line class="grid" x1="{LEFT}" x2="{WIDE - RIGHT}" y1="{y(tick):.1f}" y2="{y(tick):.1f}"/>'
            f'<text x="{LEFT - 6}" y="{y(tick) + 4:.1f}" text-anchor="end">{tick:.2f}</text>'
        )
    for time_s, frame in zip(times, known, strict=True):
        cut = not bottom <= frame["height_m"] <= top
        parts.append(
            f'<circle class="{"cut" if cut else "dot"}" cx="{x(time_s):.1f}" '
            f'cy="{y(frame["height_m"]):.1f}" r="2.2"/>'
        )
    parts.append(f'<text x="{LEFT}" y="{TALL - 8}">0 s</text>')
    parts.append(
        f'<text x="{WIDE - RIGHT}" y="{TALL - 8}" text-anchor="end">{span_s:.1f} s</text></svg>'
    )
    return "".join(parts)


def _ticks(low: float, high: float) -> list[float]:
    step = next((s for s in (0.02, 0.05, 0.1, 0.2, 0.5, 1.0) if (high - low) / s <= 8), 2.0)
    first = math.ceil(low / step)
    return [n * step for n in range(first, math.floor(high / step) + 1)]
