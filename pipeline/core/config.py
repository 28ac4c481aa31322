"""The configuration: one frozen tree, its defaults with their reasons, and the TOML that overrides.

The file that a user writes (or `stadimeter calibrate` writes) is `camera.toml`:

    [detect]                       # any table of this module, any of its fields
    method = "motion"

    [[camera]]                     # facts about a camera that its recordings lack
    name = "nikon_d5300"
    focal_length_mm = 50.0

    [[calibration]]                # see `pipeline.core.records.Calibration`
    method = "size"
    object_class = "levelling_staff"
    dimension = "width"
    parameters = [{ name = "object_size_m", value = 0.060, std_error = 0.001 }]
"""

from __future__ import annotations

import math
import tomllib
import types
import typing
from collections.abc import Mapping
from dataclasses import MISSING, dataclass, fields, is_dataclass, make_dataclass, replace
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pipeline.core.arrays import NAN
from pipeline.core.calibration import Calibration, Dimension
from pipeline.core.errors import UsageError, Where
from pipeline.core.exposure import FIELDS
from pipeline.core.records import KnownLength
from pipeline.core.setting_bounds import impossible_settings
from pipeline.core.stature import WALKING_M, adults_of, adults_of_anywhere

# A hand-held EXIF clock ticks in whole seconds, a camera driver in microseconds; half a frame
# period at 25 frames/s is the longest time over which an exposure still belongs to one frame only.
EXPOSURE_TOLERANCE_S = 0.020

# Motion is found on pictures reduced to a half, a quarter or an eighth while their shorter side stays at
# least this long: a person of a tenth of the picture's height is then two dozen pixels tall.
MIN_SIDE_PX = 256


@dataclass(frozen=True, slots=True)
class Limits:
    """Bounds on what a file may claim and on the work that it may cause.

    Claims are checked before memory is taken. Work is bounded by counts and not by a clock, so that
    the same file gives the same result on every machine; see docs/promises.md for the time it takes.
    """

    record_bytes: int = 256 * 1024**2  # one MCAP record; a 4K raw frame is 33 MB
    chunk_bytes: int = 128 * 1024**2  # one chunk, decompressed; writers make them of 1 to 50 MB
    message_bytes: int = 16 * 1024**2  # one that is no picture: parsed, it takes some 30 times that
    schema_bytes: int = 2 * 1024**2  # one schema; a set of messages with all its imports is 100 kB
    all_schema_bytes: int = 64 * 1024**2
    metadata_bytes: int = 1024**2  # of a channel; of all metadata records together
    name_bytes: int = 1024  # a topic, the name of a schema, an encoding, a frame_id
    channels: int = 4096
    cameras: int = 64  # topics with pictures; each has a detector, with a background of its own
    sources: int = 1024  # topics and frame_ids that bring exposure, calibration, truth, boxes
    objects: int = 10_000  # boxes or true objects in one message
    tracked_objects: int = 1000  # in one picture; to follow n of them takes n x n numbers
    waiting_bytes: int = 256 * 1024**2  # pictures that wait, encoded, for what belongs to them
    waiting_values: int = 100_000  # of one source, that wait for a picture
    image_pixels: int = 100_000_000  # one picture; the largest sensors of today
    image_scans: int = 100  # of one JPEG, usually 10; each is a pass over the whole picture
    # Work of one file: so much for any file, and so much more for each MB (10^6 bytes) that it has.
    unpacked_bytes: int = 1024**3  # that compressed chunks become, in all
    unpacked_bytes_per_mb: int = 100 * 10**6  # black raw pictures shrink to a hundredth in zstd
    records: int = 500_000  # read, in all, messages among them
    records_per_mb: int = 200_000  # a message of one number takes some 10 bytes, compressed
    search_places: int = 20_000  # that are tried, in all, to find records behind damage
    search_places_per_mb: int = 20_000


@dataclass(frozen=True, slots=True)
class IngestConfig:
    """Options of assembling frames from messages."""

    exposure_tolerance_s: float = EXPOSURE_TOLERANCE_S
    reorder_s: float = 0.25  # messages later than this behind the newest are not waited for
    every: int = 1  # of a camera's pictures, every so manieth is measured
    # The frame of transforms whose plane z = 0 is the ground; empty: one that is by convention.
    ground_frame: str = ""


@dataclass(frozen=True, slots=True)
class DetectConfig:
    """Options of detection."""

    method: str = "auto"  # auto, or a row of `pipeline.detect.DETECTORS`
    # How much of the recording is seen before the first answer: someone walking at 1 m/s leaves
    # every spot within it, so the median of its pictures shows the background.
    learning_s: float = 15.0
    min_side_px: int = MIN_SIDE_PX
    # The smallest object, as a share of the picture's height: below it, one pixel of error at the
    # foot or head is more than a tenth of the object in most recordings.
    min_height: float = 0.04
    # A network that is given beside the method motion looks at every so manieth frame, and tells which
    # tracks are people.
    verify_every: int = 5
    # What follows is of a network (the method onnx, or beside motion). Relative paths start at the
    # camera file's folder.
    model: str = ""
    model_family: str = "auto"  # see `pipeline.detect.network.families`
    model_classes: tuple[str, ...] = ()  # by index, where the file does not name them
    model_backend: str = "auto"  # auto, onnxruntime, opencv
    model_input_px: int = 0  # side of the input where the file leaves it open; 0: the usual one
    classes: tuple[str, ...] = ("person",)  # which of the network's classes are kept
    min_score: float = 0.4  # between the 0.25 of YOLO's own tools and the 0.5 of RT-DETR's
    # Of two boxes that share more (intersection over union) the worse is the same person again. Two
    # people side by side a shoulder's width apart share a quarter to a third.
    max_overlap: float = 0.6


@dataclass(frozen=True, slots=True)
class TrackConfig:
    """Options of joining observations into tracks."""

    coast_s: float = 2.0  # a walker passes behind a van or a tree within two seconds
    coast_new_s: float = 0.5  # a track that is not confirmed yet is not worth waiting for
    min_count: int = 5  # fewer observations are noise: a bird, a flicker
    min_duration_s: float = 0.4  # or they all came at once
    # Once all is seen, tracks are linked, gaps of up to a second filled, and boxes smoothed. Boxes that
    # the recording or a region of interest gives are left as they are.
    offline: bool = True

    def noisy(self, count: int, duration_s: float) -> bool:
        """Return whether a track was seen too seldom or too briefly to be an object."""
        return count < self.min_count or duration_s < self.min_duration_s


@dataclass(frozen=True, slots=True)
class SizePrior:
    """The true size of a class of objects: mean and spread of the population."""

    object_class: str
    dimension: Dimension
    mean_m: float
    std_m: float
    source: str = ""
    object_count: int = 0  # of which mean and spread were taken; 0: not a sample
    mean_std_m: float = NAN  # how far the mean of those who are here may lie off `mean_m`
    as_boxes_show: bool = (
        False  # of people who walk, as boxes are drawn; else of them when standing
    )

    @property
    def walking_mean_m(self) -> float:
        """The mean of people as boxes show them when they walk."""
        return self.mean_m if self.as_boxes_show else self.mean_m + WALKING_M

    @property
    def mean_uncertainty_m(self) -> float:
        """Deviation of the mean: as stated, else by the size of the sample, else as of adults."""
        if math.isfinite(self.mean_std_m):
            return self.mean_std_m
        if self.object_count:
            return self.std_m / math.sqrt(self.object_count)
        anywhere = adults_of_anywhere()
        return self.mean_m * anywhere.mean_std_m / anywhere.mean_m

    @property
    def any_std_m(self) -> float:
        """The deviation of one object, whichever such population it is of, as far as that is said."""
        return math.hypot(self.std_m, 0.0 if math.isnan(self.mean_std_m) else self.mean_std_m)


# Adults of no stated country (`pipeline.core.stature` derives the figures).
ADULT = SizePrior(
    "person",
    Dimension.HEIGHT,
    *adults_of_anywhere()[:2],
    source="adults of any country, shod, as boxes show them (NCD-RisC 2020)",
    mean_std_m=adults_of_anywhere().mean_std_m,
    as_boxes_show=True,
)
POPULATION_MEAN_M, POPULATION_MEAN_STD_M = ADULT.mean_m, ADULT.mean_std_m


def adult_of(country: str) -> SizePrior:
    """Return the stature of the adults of a country, by its two letters in ISO 3166-1.

    Raises:
        KeyError: no statures of such a country are known.
    """
    mean_m, std_m, mean_std_m = adults_of(country)
    source = f"adults of {country.upper()}, shod, as boxes show them (NCD-RisC 2020)"
    return SizePrior(
        "person",
        Dimension.HEIGHT,
        mean_m,
        std_m,
        source=source,
        mean_std_m=mean_std_m,
        as_boxes_show=True,
    )


@dataclass(frozen=True, slots=True)
class EstimateConfig:
    """Options of estimates of depth."""

    extrapolate: bool = False  # use a calibration outside the range in which it was fitted
    upright: tuple[str, ...] = ("person",)  # classes that stand upright before the camera
    # How other things are turned while no pose is known, one standard deviation: in the picture (hung
    # up or put down by eye, and the camera's own roll), and out of it (facing the camera, roughly).
    # These two are assumed, not measured.
    turn_std_deg: float = 3.0
    slant_std_deg: float = 10.0


if TYPE_CHECKING:

    @dataclass(frozen=True, slots=True, init=False)
    class ExposureFields:
        """Topic, field and unit ("/diag.exposure us") of each exposure value, by its name."""

        def __init__(self, **places: str) -> None:
            """Take the place of each value of `pipeline.core.exposure.FIELDS` that has one."""

else:  # a field of text for each row of the table
    ExposureFields = make_dataclass(
        "ExposureFields",
        [(name, str, "") for name in FIELDS],
        frozen=True,
        slots=True,
        namespace={"__module__": __name__},
    )
NO_EXPOSURE_FIELDS = ExposureFields()


@dataclass(frozen=True, slots=True)
class TimelineConfig:
    """Options of timelines (`--rrd`, `stadimeter review`)."""

    preview_px: int | None = None  # the longer side of their pictures; None: as recorded
    split_s: float = 3600.0  # a file an hour: with previews about as much as a viewer holds


@dataclass(frozen=True, slots=True)
class KnownPerson:
    """A person of known height in one recording of a camera (`calibrate --known-height`)."""

    recording_id: str  # the key of the recording, as in the database
    track_id: int
    height_m: float  # standing, with shoes
    std_m: float = 0.01


@dataclass(frozen=True, slots=True)
class CameraConfig:
    """Facts about a camera beside its recordings; NaN is unknown.

    What it states goes before what a recording says; what it leaves open is the recording's.
    """

    name: str
    # With these the pose of their recording is found anew, so that what follows from them is exact.
    known_person: tuple[KnownPerson, ...] = ()
    # Lengths that fix the scale of a pose from walkers, and that a given pose is checked by.
    known_length: tuple[KnownLength, ...] = ()
    country: str = ""  # whose people pass: two letters (ISO 3166-1); empty: that of the file
    focal_length_mm: float = NAN
    f_number: float = NAN
    focus_distance_m: float = NAN
    blur_floor_px: float = (
        NAN  # how soft a sharp edge is (sigma) without diffraction, stored pixels
    )
    blur_floor_std_px: float = 0.0
    pixel_pitch_x_um: float = NAN
    pixel_pitch_y_um: float = NAN
    # Hints, for what a data sheet says instead; see `pipeline.core.sensors`.
    focal_length_35mm_mm: float = NAN  # of the lens that sees the same angle before 35 mm film
    hfov_deg: float = NAN  # the angle from the left edge of the picture to the right one
    sensor: str = ""  # a name in `pipeline.core.sensors.table`, such as 1/2.8
    fx_px: float = NAN
    fy_px: float = NAN
    cx_px: float = NAN
    cy_px: float = NAN
    focal_std_px: float = 0.0  # of a focal length that walkers told; 0: a calibration's
    # of its error with those of height, tilt and roll
    focal_correlation: tuple[float, ...] = ()
    distortion_model: str = ""
    distortion: tuple[float, ...] = ()
    camera_height_m: float = NAN
    camera_height_std_m: float = 0.0
    tilt_deg: float = NAN
    tilt_std_deg: float = 0.0
    roll_deg: float = 0.0
    roll_std_deg: float = 0.0
    pose_correlation: tuple[float, ...] = ()  # height with tilt, height with roll, tilt with roll
    roi_xyxy_px: tuple[float, ...] = ()  # the paper's cropping: one object fills this region
    exposure: ExposureFields = NO_EXPOSURE_FIELDS  # other channels, before exposure messages

    def __post_init__(self) -> None:
        """Refuse correlations that are none."""
        for name in ("pose_correlation", "focal_correlation"):
            given = getattr(self, name)
            if given and not (len(given) == 3 and all(-1.0 <= v <= 1.0 for v in given)):
                raise ValueError(f"{name} must be three numbers from -1 to 1, not {list(given)}")


@dataclass(frozen=True, slots=True)
class ClassName:
    """A class as the recordings write it, such as "0" or "Fussgaenger", and the name that is used."""

    stated: str
    object_class: str


@dataclass(frozen=True, slots=True)
class Config:
    """Everything that a run can be told."""

    country: str = ""  # whose people pass the cameras: two letters (ISO 3166-1); empty: unknown
    limits: Limits = Limits()
    ingest: IngestConfig = IngestConfig()
    detect: DetectConfig = DetectConfig()
    track: TrackConfig = TrackConfig()
    estimate: EstimateConfig = EstimateConfig()
    timeline: TimelineConfig = TimelineConfig()
    camera: tuple[CameraConfig, ...] = ()
    size_prior: tuple[SizePrior, ...] = (ADULT,)
    class_name: tuple[ClassName, ...] = ()
    calibration: tuple[Calibration, ...] = ()

    @property
    def stature(self) -> SizePrior | None:
        """The prior on the height of walkers: that of people, else the first on any height."""
        heights = [p for p in self.size_prior if p.dimension is Dimension.HEIGHT]
        people = [p for p in heights if p.object_class == ADULT.object_class]
        return next(iter(people + heights), None)

    def of_camera(self, name: str) -> Config:
        """Return the configuration with the stature of the people who pass a camera.

        A prior that the camera file states goes before the statures of a country.
        """
        country = self.camera_named(name).country or self.country
        if not country:
            return self
        others = tuple(p for p in self.size_prior if p != ADULT)
        if any(
            p.object_class == ADULT.object_class and p.dimension is ADULT.dimension for p in others
        ):
            return self
        return replace(self, size_prior=(adult_of(country), *others))

    def of_recording(self, recording_id: str) -> Config:
        """Return the configuration without the people who are known in other recordings."""
        cameras = tuple(
            replace(
                c, known_person=tuple(k for k in c.known_person if k.recording_id == recording_id)
            )
            for c in self.camera
        )
        return replace(self, camera=cameras)

    def naming(self, camera: str, topic: str | None) -> Config:
        """Return the configuration with what it states of a topic stated of the camera on it.

        An entry that names the camera itself goes first.
        """
        if topic is None or topic == camera:
            return self
        named = any(c.name == camera for c in self.camera)
        cameras = tuple(
            replace(c, name=camera) if c.name == topic and not named else c for c in self.camera
        )
        fitted = tuple(
            replace(c, camera=camera) if c.camera == topic else c for c in self.calibration
        )
        if repr(cameras) == repr(self.camera) and fitted == self.calibration:
            return self
        return replace(self, camera=cameras, calibration=fitted)

    def camera_named(self, name: str) -> CameraConfig:
        """Return the entry of a camera, or an empty one."""
        return next((c for c in self.camera if c.name == name), CameraConfig(name))


def load_config(path: Path | None) -> Config:
    """Read a `camera.toml` and refuse what cannot be; None gives the defaults.

    Raises:
        UsageError: the file cannot be read, holds a key or value that means nothing here, or says
            something impossible.
    """
    if path is None:
        return Config()
    config = read_config(path)
    refuse_impossible_settings(config, path)
    return config


def refuse_impossible_settings(config: Config, path: Path | None = None) -> None:
    """Check every setting against its bounds (`pipeline.core.setting_bounds`).

    Raises:
        UsageError: names the keys that are impossible, and what would be possible.
    """
    problems = impossible_settings(config)
    if problems:
        raise UsageError(
            "; ".join(problems), where=Where(path), remedy="Correct or remove these settings"
        )


def read_config(path: Path) -> Config:
    """Read a `camera.toml` as it is, without a look at its numbers.

    Raises:
        UsageError: the file cannot be read, or holds a key or value that means nothing here.
    """
    try:
        tree = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise UsageError(
            f"cannot read the camera file: {error.strerror}", where=Where(path)
        ) from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise UsageError(f"not valid TOML: {error}", where=Where(path)) from error
    try:
        config: Config = build(Config, tree, "")
    except ValueError as error:
        raise UsageError(
            str(error), where=Where(path), remedy="The README lists the keys of camera.toml"
        ) from error
    if config.detect.model:
        model = str(path.parent / config.detect.model)
        config = replace(config, detect=replace(config.detect, model=model))
    return config


def build(kind: Any, value: Any, place: str) -> Any:
    """Return `value` as a `kind`, checked all the way down; errors name the key."""
    origin = typing.get_origin(kind)
    if is_dataclass(kind):
        return _build_dataclass(kind, value, place)
    if origin is tuple:
        if not isinstance(value, list):
            raise ValueError(f"{place} must be an array")
        item = typing.get_args(kind)[0]
        return tuple(build(item, v, f"{place}[{i}]") for i, v in enumerate(value))
    if origin is types.UnionType:
        return build(typing.get_args(kind)[0], value, place)
    if isinstance(kind, type) and issubclass(kind, StrEnum):
        if value not in list(kind):
            raise ValueError(f"{place} must be one of {', '.join(kind)}, not {value!r}")
        return kind(value)
    if kind is float and isinstance(value, int | float) and not isinstance(value, bool):
        if math.isnan(value):
            raise ValueError(f"{place} is NaN; leave out what is unknown")
        return float(value)
    if kind is int and isinstance(value, int) and not isinstance(value, bool):
        return value
    if isinstance(kind, type) and type(value) is kind:
        return value
    raise ValueError(f"{place} must be a {getattr(kind, '__name__', kind)}, not {value!r}")


def _build_dataclass(kind: Any, value: Any, place: str) -> Any:
    if not isinstance(value, Mapping):
        raise ValueError(f"{place or 'the file'} must be a table")
    hints = typing.get_type_hints(kind)
    known = {f.name: f for f in fields(kind)}
    prefix = f"{place}." if place else ""
    for key in value:
        if key not in known:
            raise ValueError(f"unknown key {prefix}{key}; known are {', '.join(known)}")
    for name, f in known.items():
        if name not in value and f.default is MISSING and f.default_factory is MISSING:
            raise ValueError(f"{prefix}{name} is missing")
    return kind(**{key: build(hints[key], v, prefix + key) for key, v in value.items()})
