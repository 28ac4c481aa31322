"""Bounds of every setting: impossible values are refused with their key and what would be possible.

The bounds refuse what cannot be, not what is unusual. Ends are included, but for those marked as open.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields, is_dataclass
from typing import Any

from pipeline.core.exposure import FIELDS
from pipeline.core.sensors.table import like, sensor_named
from pipeline.core.stature import MEAN_CM

INFINITY = math.inf


@dataclass(frozen=True, slots=True)
class Bound:
    """The lowest and the highest possible value of a setting, in its unit."""

    low: float
    high: float
    above_low: bool = False  # whether the lowest value itself is impossible
    zero_is_open: bool = False  # whether zero stands for "decide by yourself"

    def holds(self, value: float) -> bool:
        """Return whether a value is possible; an infinite one is only where the bound is infinite."""
        if self.zero_is_open and value == 0:
            return True
        above = value > self.low if self.above_low else value >= self.low
        return above and value <= self.high

    def __str__(self) -> str:
        low = f"{'more than' if self.above_low else 'at least'} {self.low:g}"
        text = low if math.isinf(self.high) else f"{low} and at most {self.high:g}"
        return f"0 or {text}" if self.zero_is_open else text


# A day: no clock of a camera is compared over more.
_SECONDS = Bound(0.0, 86_400.0)
_SHARE = Bound(0.0, 1.0)
_COUNT = Bound(1.0, 1e15)
_FOCAL_PX = Bound(1.0, 1e8)
# A camera on a satellite is 36,000 km up; the plane of the ground ends long before.
_HEIGHT_M = Bound(0.0, 1e5, above_low=True)
_LENGTH_M = Bound(0.0, 1e4, above_low=True)
_LENGTH_STD_M = Bound(0.0, 1e4)
_DEVIATION_DEG = Bound(0.0, 90.0)

_LENS = {
    name: Bound(*FIELDS[name].bounds)
    for name in (
        "focal_length_mm",
        "focal_length_35mm_mm",
        "f_number",
        "focus_distance_m",
        "pixel_pitch_x_um",
        "pixel_pitch_y_um",
    )
}

BOUNDS: Mapping[str, Mapping[str, Bound]] = {
    "IngestConfig": {
        "exposure_tolerance_s": _SECONDS,
        "reorder_s": _SECONDS,
        "every": Bound(1, 1_000_000),
    },
    "DetectConfig": {
        "learning_s": Bound(0.0, 86_400.0, above_low=True),
        "min_side_px": Bound(16, 100_000),
        "min_height": Bound(0.0, 1.0, above_low=True),
        "model_input_px": Bound(32, 16_384, zero_is_open=True),
        "min_score": _SHARE,
        "max_overlap": _SHARE,
    },
    "TrackConfig": {
        "coast_s": _SECONDS,
        "coast_new_s": _SECONDS,
        "min_count": _COUNT,
        "min_duration_s": _SECONDS,
    },
    # Beyond these a box says next to nothing of a height.
    "EstimateConfig": {"turn_std_deg": Bound(0.0, 15.0), "slant_std_deg": Bound(0.0, 30.0)},
    "TimelineConfig": {
        "preview_px": Bound(16, 100_000),
        "split_s": Bound(0.0, INFINITY, above_low=True),
    },
    "CameraConfig": {
        **_LENS,
        "blur_floor_px": Bound(0.0, 1000.0),
        "blur_floor_std_px": Bound(0.0, 1000.0),
        # No plane picture shows half a turn; beyond 170 degrees a pinhole camera says nothing.
        "hfov_deg": Bound(0.1, 170.0),
        "fx_px": _FOCAL_PX,
        "fy_px": _FOCAL_PX,
        "cx_px": Bound(-1e6, 1e6),
        "cy_px": Bound(-1e6, 1e6),
        "focal_std_px": Bound(0.0, 1e8),
        "camera_height_m": _HEIGHT_M,
        "camera_height_std_m": Bound(0.0, 1e5),
        "tilt_deg": Bound(-90.0, 90.0),
        "tilt_std_deg": _DEVIATION_DEG,
        "roll_deg": Bound(-180.0, 180.0),
        "roll_std_deg": _DEVIATION_DEG,
    },
    "KnownPerson": {"height_m": Bound(0.2, 3.0), "std_m": Bound(0.0, 1.0, above_low=True)},
    "KnownLength": {
        "length_m": _LENGTH_M,
        "std_m": _LENGTH_STD_M,
        "std_px": Bound(0.0, 1000.0, above_low=True),
    },
    "SizePrior": {
        "mean_m": _LENGTH_M,
        "std_m": _LENGTH_STD_M,
        "mean_std_m": _LENGTH_STD_M,
        "object_count": Bound(0.0, 1e15),
    },
    "Calibration": {
        "residual_std_m": Bound(0.0, 1e6),
        "observation_count": Bound(0.0, 1e15),
        "depth_min_m": Bound(0.0, 1e6),
        "depth_max_m": Bound(0.0, 1e6),
    },
    "Parameter": {
        "value": Bound(-1e9, 1e9),
        "std_error": Bound(0.0, 1e9),
        "f_number": Bound(*FIELDS["f_number"].bounds),
    },
}

# The tallest and the shortest person on record are 2.72 and 0.55 m tall; a mean stature lies between.
STATURE = Bound(0.5, 2.75)


def impossible_settings(config: object) -> list[str]:
    """Return a sentence for each setting that is impossible, with its key and its bound.

    Args:
        config: a `Config`, or any table of one; NaN and None are unknown, and are not examined.
    """
    return [*_out_of_bounds(config, ""), *_contradictions(config)]


def _out_of_bounds(node: Any, place: str) -> Iterator[str]:
    bounds = BOUNDS.get(type(node).__name__, {})
    if type(node).__name__ == "Limits":
        bounds = {f.name: _COUNT for f in fields(node)}
    for f in fields(node):
        value, key = getattr(node, f.name), f"{place}.{f.name}" if place else f.name
        if is_dataclass(value):
            yield from _out_of_bounds(value, key)
        elif isinstance(value, tuple):
            for index, item in enumerate(value):
                if is_dataclass(item):
                    yield from _out_of_bounds(item, f"{key}[{index}]")
                elif isinstance(item, float) and not math.isfinite(item):
                    yield f"{key}[{index}] is {item:g}; it must be finite"
        elif isinstance(value, int | float) and not isinstance(value, bool):
            bound = bounds.get(f.name)
            if bound and not math.isnan(value) and not bound.holds(value):
                yield f"{key} is {value:g}; it must be {bound}"


def _contradictions(config: Any) -> Iterator[str]:
    """Settings that are possible alone, but not together."""
    names: set[str] = set()
    yield from _country(config, "country")
    for index, camera in enumerate(getattr(config, "camera", ())):
        key = f"camera[{index}]"
        yield from _country(camera, f"{key}.country")
        if camera.sensor and sensor_named(camera.sensor) is None:
            yield f"{key}.sensor {camera.sensor!r} is not known; known are {_quoted(camera.sensor)}"
        if not camera.name:
            yield f"{key}.name is empty; it must be a frame_id or a topic of images"
        if camera.name in names:
            yield f"{key}.name {camera.name!r} is there twice; keep one entry a camera"
        names.add(camera.name)
        if camera.camera_height_std_m > camera.camera_height_m:
            yield (
                f"{key}.camera_height_std_m is {camera.camera_height_std_m:g}; it must be at most "
                f"camera_height_m, {camera.camera_height_m:g}"
            )
        yield from _region(camera.roi_xyxy_px, f"{key}.roi_xyxy_px")
        for number, known in enumerate(camera.known_length):
            yield from _segment(known, f"{key}.known_length[{number}]")
    for index, prior in enumerate(getattr(config, "size_prior", ())):
        yield from _prior(prior, f"size_prior[{index}]")
    for index, fitted in enumerate(getattr(config, "calibration", ())):
        if fitted.depth_min_m > fitted.depth_max_m:
            yield f"calibration[{index}].depth_min_m must be at most depth_max_m"


def _quoted(name: str) -> str:
    return ", ".join(f'"{known}"' for known in like(name))


def _country(table: Any, key: str) -> Iterator[str]:
    code = getattr(table, "country", "")
    if code and code.upper() not in MEAN_CM:
        yield f'{key} is {code!r}; it must be two letters of ISO 3166-1, such as "GB" or "DE"'


def _region(edges: tuple[float, ...], key: str) -> Iterator[str]:
    if edges and not (len(edges) == 4 and edges[0] < edges[2] and edges[1] < edges[3]):
        yield f"{key} is {list(edges)}; it must be [left, top, right, bottom], left before right"


def _segment(known: Any, key: str) -> Iterator[str]:
    ends = known.points_px
    if len(ends) != 4 or ends[:2] == ends[2:]:
        yield f"{key}.points_px is {list(ends)}; it must be [x, y, x, y] of two points that are apart"
    elif known.upright and not ends[1] > ends[3]:
        yield f"{key}.points_px is {list(ends)}; the foot must come first, below the upper end"
    if known.std_m > known.length_m > 0:
        yield f"{key}.std_m is {known.std_m:g}; it must be at most length_m, {known.length_m:g}"


def _prior(prior: Any, key: str) -> Iterator[str]:
    if not prior.object_class:
        yield f"{key}.object_class is empty"
    for name in ("std_m", "mean_std_m"):
        value = getattr(prior, name)
        if value > prior.mean_m > 0:
            yield f"{key}.{name} is {value:g}; it must be at most mean_m, {prior.mean_m:g}"
    is_stature = prior.object_class == "person" and prior.dimension == "height"
    if is_stature and not STATURE.holds(prior.mean_m):
        yield f"{key}.mean_m is {prior.mean_m:g}; the mean stature of people must be {STATURE}"
