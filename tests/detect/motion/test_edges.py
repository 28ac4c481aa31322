"""Ends of silhouettes to a fraction of a pixel, with contact shadows and without."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from pipeline.detect.motion.edges import ends_of
from pipeline.detect.motion.shadow import ShadowLight

FINE = 8
GROUND, CLOTH = 150.0, 40.0


def figure(top: float, bottom: float, *, contact: float = 1.0, size: int = 160):
    """Return picture, ground and cover of a figure, drawn larger and averaged down."""
    cover = np.zeros((size * FINE, size * FINE), np.uint8)
    shade = np.zeros_like(cover)
    tall, x = bottom - top, size / 2

    def at(*values: float) -> tuple[int, ...]:
        return tuple(round(v * FINE) for v in values)

    head = 0.065 * tall
    cv2.circle(cover, at(x, top + head), at(head)[0], 255, -1)
    cv2.rectangle(
        cover,
        at(x - 0.12 * tall, top + 0.15 * tall),
        at(x + 0.12 * tall, top + 0.5 * tall),
        255,
        -1,
    )
    for side in (-0.06, 0.06):
        cv2.rectangle(
            cover,
            at(x + (side - 0.04) * tall, top + 0.5 * tall),
            at(x + (side + 0.04) * tall, bottom),
            255,
            -1,
        )
    cv2.rectangle(cover, at(0, bottom), at(size, size), 0, -1)
    cv2.ellipse(shade, at(x, bottom), at(0.2 * tall, 0.05 * tall), 0, 0, 360, 255, -1)
    small = (size, size)
    cover = cv2.resize(cover, small, interpolation=cv2.INTER_AREA) / 255.0
    shade = cv2.resize(shade, small, interpolation=cv2.INTER_AREA) / 255.0
    picture = GROUND * (1 - (1 - contact) * shade)
    picture = picture * (1 - cover) + CLOTH * cover
    soft = cv2.blur(cv2.GaussianBlur(picture, (0, 0), 0.6), (3, 3))
    image = np.repeat(soft[..., None], 3, axis=2).round().astype(np.uint8)
    return image, np.full_like(image, round(GROUND))


@pytest.mark.parametrize("contact", [1.0, 0.82])
@pytest.mark.parametrize("tall", [40.0, 100.0])
def test_ends_are_found_to_a_fraction_of_a_pixel(tall: float, contact: float) -> None:
    errors, light = [], ShadowLight()
    for fraction in np.arange(0, 1, 0.125):
        top, bottom = 20 + fraction, 20 + fraction + tall
        image, ground = figure(top, bottom, contact=contact)
        differs = cv2.absdiff(image, ground)[..., 0]
        mask = cv2.compare(differs, 10, cv2.CMP_GT)
        x, y, w, h = cv2.boundingRect(mask)

        def unshaded(parts, image=image, ground=ground):
            return light.unshaded_in(image, ground, parts)

        [ends] = ends_of(mask, differs, unshaded, [(x, y, x + w, y + h)])
        assert ends is not None
        (_, found_top, _, found_bottom), (_, top_std, _, bottom_std) = ends
        errors.append([found_top - top, found_bottom - bottom])
        assert abs(errors[-1][0]) < 2 * top_std
        assert abs(errors[-1][1]) < 2 * bottom_std
    assert np.abs(np.mean(errors, axis=0)).max() < 0.6
    assert np.std(errors, axis=0).max() < 0.25


def test_what_is_no_silhouette_has_no_ends() -> None:
    mask = np.zeros((50, 50), np.uint8)
    mask[20:22, 10:40] = 255
    assert ends_of(mask, mask, lambda parts: [], [(10, 20, 40, 22)]) == [None]
