"""Shadows by the light that they share, and bodies of any colour beside them."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.detect.motion.shadow import DEEPEST, NEUTRAL, UNIT, ShadowLight

FACTORS = np.array([0.72, 0.66, 0.62])
HEIGHT, WIDTH = 240, 320


def ground(random: np.random.Generator) -> np.ndarray:
    noise = random.normal(0, 1, (HEIGHT, WIDTH, 3))
    return np.clip(cv2.GaussianBlur(noise, (0, 0), 4) * 150 + [110, 125, 120], 40, 240)


def scenes(factors: np.ndarray | None, count: int = 12):
    """Yield ground, picture and the masks of bodies and shadows, of people with shadows to the right."""
    random = np.random.default_rng(3)
    plain = ground(random)
    for _ in range(count):
        picture = plain.copy()
        body, shade = (np.zeros((HEIGHT, WIDTH), np.uint8) for _ in range(2))
        for _ in range(3):
            x, foot = random.integers(30, WIDTH - 90), random.integers(110, HEIGHT - 10)
            cv2.rectangle(body, (x - 9, foot - 70), (x + 9, foot), 255, -1)
            cv2.rectangle(shade, (x + 6, foot - 12), (x + 55, foot), 255, -1)
            clothes = random.uniform(20, 220, 3)
            picture[foot - 70 : foot + 1, x - 9 : x + 10] = clothes
        shade[body > 0] = 0
        if factors is not None:
            picture[shade > 0] *= factors
        else:
            shade[:] = 0
        picture += random.normal(0, 1.5, picture.shape)
        yield plain.astype(np.uint8), np.clip(picture, 0, 255).astype(np.uint8), body, shade


def learned(factors: np.ndarray | None) -> ShadowLight:
    light = ShadowLight()
    for plain, picture, body, shade in scenes(factors):
        mask = body | shade
        outlines, _ = cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
        boxes = [(x, y, x + w, y + h) for x, y, w, h in map(cv2.boundingRect, outlines)]
        light.learn(cv2.divide(picture, plain, scale=UNIT), mask, boxes)
    light.fit()
    return light


def test_the_light_in_shadows_is_learned_and_found() -> None:
    light = learned(FACTORS)
    assert light.factors is not None
    np.testing.assert_allclose(light.factors, FACTORS, atol=0.02)
    for plain, picture, body, shade in scenes(FACTORS):
        found = light.find(cv2.divide(picture, plain, scale=UNIT))
        assert found is not None
        assert (found[cv2.erode(shade, np.ones((5, 5))) > 0] > 0).mean() > 0.95
        assert (found[body > 0] > 0).mean() < 0.1


def test_without_sun_nothing_is_shadow() -> None:
    light = learned(None)
    assert light.factors is None
    assert light.find(np.full((4, 4, 3), 90, np.uint8)) is None


@pytest.mark.parametrize("factors", [None, FACTORS])
@given(share=st.floats(0.0, DEEPEST), level=st.integers(60, 230))
def test_ground_in_any_shade_does_not_differ(
    factors: np.ndarray | None, share: float, level: int
) -> None:
    light = DULL if factors is None else SUNNY
    taken = 1 - np.asarray(NEUTRAL if light.factors is None else light.factors)
    then = np.full((3, 3, 3), level, np.uint8)
    now = np.clip(then * (1 - share * taken), 0, 255).round().astype(np.uint8)
    # bytes: half a level of rounding, on either side of the division
    assert light.unshaded(now, then).max() <= 4


def test_shoes_differ_in_every_shade() -> None:
    then = np.full((2, 2, 3), 150, np.uint8)
    for shoe in ((25, 25, 28), (230, 230, 230), (40, 40, 140)):
        now = np.full((2, 2, 3), shoe, np.uint8)
        assert SUNNY.unshaded(now, then).min() > 20
        assert DULL.unshaded(now, then).min() > 20


SUNNY, DULL = learned(FACTORS), ShadowLight()
