"""The scale prior: national statures as boxes show them."""

import numpy as np
import pytest

from pipeline.core.calibration import Dimension
from pipeline.core.camera_file import write_camera_file
from pipeline.core.config import ADULT, CameraConfig, Config, SizePrior, load_config
from pipeline.core.errors import UsageError
from pipeline.core.stature import MEAN_CM, adults_of, adults_of_anywhere


def test_a_mixed_crowd_is_drawn_as_the_statures_say() -> None:
    random = np.random.default_rng(1)
    found = adults_of("GB")
    means = []
    everybody = []
    for _ in range(4000):
        share = np.clip(random.normal(0.5, 0.2), 0, 1)
        worn = random.normal(0.025, 0.01) + random.normal(0.015, 0.01) + random.normal(-0.01, 0.01)
        margin = random.normal(0, 0.02)
        means.append(share * 1.782 + (1 - share) * 1.639 + worn + margin)
        sex = np.where(random.uniform(size=20) < 0.5, 1.782, 1.639)
        everybody.append(sex + random.normal(0, 0.066, 20))
    assert found.mean_m == pytest.approx(np.mean(means), abs=0.003)
    assert found.mean_std_m == pytest.approx(np.std(means), rel=0.06)
    assert found.std_m == pytest.approx(np.std(everybody), rel=0.03)


def test_the_wide_default_holds_the_countries_that_are_large() -> None:
    wide = adults_of_anywhere()
    assert wide.mean_m == pytest.approx(1.74, abs=0.01)
    assert wide.mean_std_m == pytest.approx(0.06, abs=0.005)
    for country in ("CN", "IN", "US", "ID", "BR", "NG", "DE", "NL", "JP"):
        assert abs(adults_of(country).mean_m - wide.mean_m) < 2 * wide.mean_std_m
        assert adults_of(country).mean_std_m < wide.mean_std_m


def test_men_are_taller_than_women_in_every_row() -> None:
    assert len(MEAN_CM) > 190
    for men_cm, women_cm in MEAN_CM.values():
        assert 4 < men_cm - women_cm < 18


def test_a_country_gives_the_prior_of_a_camera(tmp_path) -> None:
    path = tmp_path / "camera.toml"
    path.write_text(
        'country = "nl"\n[[camera]]\nname = "here"\n[[camera]]\nname = "there"\ncountry = "IN"\n'
    )
    config = load_config(path)
    assert config.of_camera("here").stature.mean_m == adults_of("NL").mean_m
    assert config.of_camera("there").stature.mean_m == adults_of("IN").mean_m
    assert config.of_camera("another").stature.mean_m == adults_of("NL").mean_m
    assert Config().of_camera("here").stature == ADULT
    again = tmp_path / "again.toml"
    write_camera_file(again, config)
    assert repr(load_config(again)) == repr(config)


def test_a_prior_that_is_stated_goes_before_a_country() -> None:
    mine = SizePrior("person", Dimension.HEIGHT, 1.6, 0.05)
    config = Config(country="NL", size_prior=(mine,))
    assert config.of_camera("cam").stature == mine
    car = SizePrior("car", Dimension.WIDTH, 1.8, 0.1)
    both = Config(country="NL", size_prior=(car,)).of_camera("cam")
    assert both.stature.mean_m == adults_of("NL").mean_m
    assert car in both.size_prior


@pytest.mark.parametrize(
    "text", ['country = "XX"\n', '[[camera]]\nname = "a"\ncountry = "Narnia"\n']
)
def test_a_country_that_is_none_is_refused_with_its_key(tmp_path, text) -> None:
    path = tmp_path / "camera.toml"
    path.write_text(text)
    with pytest.raises(UsageError, match="country is"):
        load_config(path)


def test_every_prior_of_people_states_how_sure_its_mean_is() -> None:
    assert ADULT.any_std_m == pytest.approx(np.hypot(ADULT.std_m, adults_of_anywhere().mean_std_m))
    assert CameraConfig("cam").country == ""
