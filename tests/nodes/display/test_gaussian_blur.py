"""The separable Gaussian against the reference and what holds for every blur."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

import rendergraph as rg

Floats = npt.NDArray[Any]
Draw = Callable[..., rg.Frame]
Noise = Callable[..., Floats]


def blurred(draw: Draw, picture: Floats, radius: int) -> Floats:
    text = f"""  blur: {{type: gaussian_blur, inputs: {{source: picture.radiance}}, params: {{radius: {radius}}}}}
outputs: {{image: blur.blurred}}"""
    return np.asarray(draw(picture, text)["image"])


@pytest.mark.parametrize(("radius", "name"), [(6, "gauss_s2_r6_clamp"), (15, "gauss_s5_r15_clamp")])
def test_reference_picture(draw: Draw, reference: dict[str, Floats], radius: int, name: str) -> None:
    image = blurred(draw, reference["picture"], radius)[..., :3]
    np.testing.assert_allclose(image, reference[name], rtol=2e-5, atol=1e-5)


@pytest.mark.parametrize("radius", [1, 4, 32, 128])
def test_a_point_becomes_the_kernel(draw: Draw, radius: int) -> None:
    point = np.zeros((9, 2 * radius + 3, 1), np.float32)
    point[:, radius + 1] = 1
    offsets = np.arange(-radius, radius + 1)
    weights = np.exp(-0.5 * (offsets / (radius / 3)) ** 2)
    image = blurred(draw, point, radius)[4, :, 0]
    assert image[0] == image[-1] == 0
    np.testing.assert_allclose(image[1:-1], weights / weights.sum(), rtol=1e-3, atol=1e-8)
    np.testing.assert_allclose(image[1:-1].sum(), 1, rtol=1e-6)


def test_a_flat_picture_stays(draw: Draw) -> None:
    flat = np.full((7, 5, 4), 3.25, np.float32)
    np.testing.assert_allclose(blurred(draw, flat, 9), flat, rtol=1e-6)


def test_no_radius_is_the_picture(draw: Draw, noise: Noise) -> None:
    picture = noise(11, 6)
    np.testing.assert_array_equal(blurred(draw, picture, 0)[..., :3], picture)


def test_both_axes_alike(draw: Draw, noise: Noise) -> None:
    picture = noise(21, 14)
    turned = blurred(draw, np.ascontiguousarray(picture.transpose(1, 0, 2)), 5).transpose(1, 0, 2)
    np.testing.assert_allclose(blurred(draw, picture, 5), turned, rtol=1e-5)


def test_light_is_kept_away_from_the_border(draw: Draw, noise: Noise) -> None:
    picture = np.zeros((40, 50, 3), np.float32)
    picture[12:28, 12:38] = noise(26, 16)
    np.testing.assert_allclose(
        blurred(draw, picture, 12)[..., :3].astype(np.float64).sum((0, 1)),
        picture.astype(np.float64).sum((0, 1)),
        rtol=1e-6,
    )
