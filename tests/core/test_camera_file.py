from __future__ import annotations

import math
from dataclasses import fields
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from pipeline.core.calibration import CalibratedMethod, Calibration, Dimension, Parameter
from pipeline.core.camera_file import merge, write_camera_file
from pipeline.core.config import (
    ADULT,
    CameraConfig,
    Config,
    DetectConfig,
    EstimateConfig,
    SizePrior,
    TrackConfig,
    load_config,
    read_config,
)
from pipeline.core.errors import UsageError
from pipeline.core.records import KnownLength

finite = st.floats(allow_nan=False)
unknown = st.one_of(st.just(float("nan")), finite)
text = st.text(st.characters(exclude_categories=["Cs"]), max_size=12)
parameters = st.builds(Parameter, text, finite, unknown, unknown)
calibrations = st.builds(
    Calibration,
    st.sampled_from(list(CalibratedMethod)),
    text,
    st.sampled_from(list(Dimension)),
    st.lists(parameters, max_size=3).map(tuple),
    text,
    unknown,
    st.integers(0, 10**9),
    *(unknown,) * 5,
    text,
)


lengths = st.builds(
    KnownLength, st.lists(finite, max_size=4).map(tuple), finite, finite, finite, st.booleans()
)


@st.composite
def cameras(draw):
    values = {"name": draw(text), "distortion": tuple(draw(st.lists(finite, max_size=5)))}
    for f in fields(CameraConfig):
        if f.type == "float" and draw(st.booleans()):
            values[f.name] = draw(finite)
    values["known_length"] = tuple(draw(st.lists(lengths, max_size=2)))
    return CameraConfig(**values)


priors = st.builds(
    SizePrior,
    text,
    st.sampled_from(list(Dimension)),
    finite,
    finite,
    text,
    st.integers(0, 99),
    st.just(math.nan) | finite,
)
configs = st.builds(
    Config,
    detect=st.builds(
        DetectConfig,
        method=st.sampled_from(["auto", "roi"]),
        learning_s=finite,
        min_height=finite,
        min_side_px=st.integers(0, 9999),
    ),
    track=st.builds(TrackConfig, finite, finite, st.integers(0, 99)),
    estimate=st.builds(EstimateConfig, st.booleans()),
    camera=st.lists(cameras(), max_size=2).map(tuple),
    size_prior=st.lists(priors, max_size=2).map(tuple),
    calibration=st.lists(calibrations, max_size=3).map(tuple),
)


@given(configs)
@settings(
    max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
def test_what_is_written_is_read_back(tmp_path: Path, config: Config):
    path = tmp_path / "camera.toml"
    path.unlink(missing_ok=True)
    write_camera_file(path, config)
    read = read_config(path)
    assert repr(read) == repr(config)
    write_camera_file(path, read)
    assert repr(read_config(path)) == repr(read)
    assert list(tmp_path.iterdir()) == [path]


EXISTING = """\
# The camera on the mast.
[detect]
method = "motion"  # it never moves

[[camera]]
# measured on 3 May
name = "mast"
fx_px = 1185.0

[[calibration]]
method = "size"
object_class = "van"
dimension = "width"
parameters = [{ name = "object_size_m", value = 1.9 }]

[[calibration]]
method = "size"
object_class = "staff"
dimension = "width"
parameters = [
    { name = "object_size_m", value = 0.05 },
]
"""


def size_of(value: float, object_class: str = "staff") -> Calibration:
    return Calibration(
        CalibratedMethod.SIZE, object_class, Dimension.WIDTH, (Parameter("object_size_m", value),)
    )


def test_an_existing_file_keeps_what_is_not_said_anew(tmp_path: Path):
    path = tmp_path / "camera.toml"
    path.write_text(EXISTING)
    write_camera_file(path, Config(calibration=(size_of(0.06),)))
    config, text = load_config(path), path.read_text()
    assert config.detect.method == "motion"
    assert config.camera_named("mast").fx_px == 1185.0
    sizes = {c.object_class: c.value("object_size_m") for c in config.calibration}
    assert sizes == {"van": 1.9, "staff": 0.06}
    for comment in ("# The camera on the mast.", "# it never moves", "# measured on 3 May"):
        assert comment in text


def test_a_camera_keeps_the_facts_that_are_not_stated_anew(tmp_path: Path):
    path = tmp_path / "camera.toml"
    path.write_text(EXISTING)
    write_camera_file(path, Config(camera=(CameraConfig("mast", tilt_deg=12.0),)))
    camera = load_config(path).camera_named("mast")
    assert (camera.fx_px, camera.tilt_deg) == (1185.0, 12.0)


@pytest.mark.parametrize(
    "old",
    [
        'calibration = [{ method = "size", object_class = "van", dimension = "width", '
        'parameters = [{ name = "object_size_m", value = 1.9 }] }]\n',
        'detect.method = "roi"\n[[calibration]]\nmethod = "size"\nobject_class = "van"\n'
        'dimension = "width"\nparameters = [\n{ name = "object_size_m", value = 1.9 },\n]\n',
        '[[camera]]\nname = "mast"\ndistortion = [\n0.1,\n0.2]\n',
        "size_prior = []\n",
        "",
        "# only a remark\n",
    ],
)
def test_files_in_unusual_forms_keep_their_meaning(tmp_path: Path, old: str):
    path = tmp_path / "camera.toml"
    path.write_text(old)
    before = load_config(path)
    new = Config(calibration=(size_of(0.06),))
    write_camera_file(path, new)
    assert repr(load_config(path)) == repr(merge(before, new))


def test_the_default_priors_stay_beside_a_new_one(tmp_path: Path):
    path = tmp_path / "camera.toml"
    child = SizePrior("child", Dimension.HEIGHT, 1.2, 0.2)
    write_camera_file(path, Config(size_prior=(ADULT, child)))
    assert load_config(path).size_prior == (ADULT, child)


def test_a_file_that_is_none_is_not_overwritten(tmp_path: Path):
    path = tmp_path / "camera.toml"
    path.write_text("this is no TOML")
    with pytest.raises(UsageError):
        write_camera_file(path, Config(calibration=(size_of(0.06),)))
    assert path.read_text() == "this is no TOML"


def test_what_must_be_known_cannot_be_nan(tmp_path: Path):
    with pytest.raises(UsageError, match="value"):
        write_camera_file(tmp_path / "c.toml", Config(calibration=(size_of(float("nan")),)))
    assert not list(tmp_path.iterdir())
