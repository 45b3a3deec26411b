"""Bloom against NumPy, its own parts, and the energy that went in."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

import rendergraph as rg

Floats = npt.NDArray[Any]
Draw = Callable[..., rg.Frame]
Noise = Callable[..., Floats]


def added(draw: Draw, picture: Floats, gain: str = "", **params: object) -> Floats:
    """What bloom adds, float64."""
    text = f"""  bloom: {{type: bloom, inputs: {{radiance: picture.radiance{gain}}}, params: {json.dumps(params)}}}
outputs: {{image: bloom.radiance, before: picture.radiance}}"""
    if gain:
        text = "  eye: {type: exposure, inputs: {radiance: picture.radiance}, params: {delta: 1e-9}}\n" + text
    frame = draw(picture, text)
    np.testing.assert_array_equal(frame["image"][..., 3], frame["before"][..., 3])
    return np.asarray(frame["image"][..., :3].astype(np.float64) - frame["before"][..., :3])


# --- the same in NumPy ------------------------------------------------------------------------------------------------


def bright(picture: Floats, threshold: float) -> Floats:
    luminance = (picture.astype(np.float64) @ [0.2126, 0.7152, 0.0722])[..., None]
    return np.asarray(picture * np.maximum(luminance - threshold, 0) / np.maximum(luminance, 1e-4))


def halving(size: int) -> Floats:
    """Rows: what part of each old texel a new one covers, from the overlap of intervals."""
    count = max(size // 2, 1)
    edges = np.arange(count + 1) * (size / count)
    old = np.arange(size)
    cover = np.minimum(edges[1:, None], old + 1) - np.maximum(edges[:-1, None], old)
    return np.asarray(np.maximum(cover, 0) * (count / size))


def gaussian(size: int, radius: int) -> Floats:
    offsets = np.arange(-radius, radius + 1)
    weights = np.exp(-0.5 * (offsets / max(radius / 3, 1e-9)) ** 2)
    matrix = np.zeros((size, size))
    for row in range(size):
        np.add.at(matrix[row], np.clip(row + offsets, 0, size - 1), weights / weights.sum())
    return matrix


def bilinear(size: int, count: int) -> Floats:
    """From `count` texels to `size`, clamped at the border."""
    place = np.clip((np.arange(size) + 0.5) * count / size - 0.5, 0, count - 1)
    low = np.minimum(np.floor(place).astype(int), max(count - 2, 0))
    matrix = np.zeros((size, count))
    np.add.at(matrix, (np.arange(size), low), 1 - (place - low))
    np.add.at(matrix, (np.arange(size), np.minimum(low + 1, count - 1)), place - low)
    return matrix


def along(rows: Floats, columns: Floats, picture: Floats) -> Floats:
    return np.asarray(np.einsum("ij,jkc,lk->ilc", rows, picture, columns))


def expected(picture: Floats, threshold: float, intensity: float, radius: int, levels: int) -> Floats:
    height, width = picture.shape[:2]
    level = bright(picture, threshold)
    total = np.zeros(picture.shape)
    for _ in range(levels):
        level = along(halving(level.shape[0]), halving(level.shape[1]), level)
        level = along(gaussian(level.shape[0], radius), gaussian(level.shape[1], radius), level)
        total += along(bilinear(height, level.shape[0]), bilinear(width, level.shape[1]), level)
    return total * intensity / levels


@pytest.mark.nightly(keep=4)
@pytest.mark.parametrize("size", [(64, 48), (61, 37), (7, 3)], ids=lambda s: f"{s[0]}x{s[1]}")
@pytest.mark.parametrize(("radius", "levels"), [(6, 1), (3, 2), (6, 3)])
def test_formula(draw: Draw, noise: Noise, size: tuple[int, int], radius: int, levels: int) -> None:
    picture = noise(*size)
    levels = min(levels, max(max(side // 2, 1) for side in size).bit_length())
    wanted = expected(picture, 1.5, 0.5, radius, levels)
    found = added(draw, picture, threshold=1.5, intensity=0.5, radius=radius, levels=levels)
    np.testing.assert_allclose(found, wanted, rtol=1e-4, atol=1e-5 * picture.max())


def test_reference_picture(draw: Draw, reference: dict[str, Floats]) -> None:
    """One level without blur is the bright pass of the reference, averaged 2 × 2 and drawn larger again."""
    found = added(draw, reference["picture"], intensity=1.0, radius=0, levels=1)
    half = reference["bright_pass"].astype(np.float64).reshape(32, 2, 48, 2, 3).mean((1, 3))
    wanted = along(bilinear(64, 32), bilinear(96, 48), half)
    np.testing.assert_allclose(found, wanted, rtol=1e-4, atol=1e-3)


@pytest.mark.parametrize("intensity", [0.1, 1.0])
def test_the_light_that_is_added_is_the_bright_light(draw: Draw, noise: Noise, intensity: float) -> None:
    picture = np.zeros((256, 288, 3), np.float32)
    picture[120:136, 136:152] = noise(16, 16) + 1
    total = added(draw, picture, intensity=intensity, threshold=1.0).sum((0, 1))
    np.testing.assert_allclose(total / intensity, bright(picture, 1.0).sum((0, 1)), rtol=1e-5)


def test_nothing_bright_is_the_same_picture(draw: Draw, noise: Noise) -> None:
    picture = noise(20, 14)
    assert np.all(added(draw, picture, threshold=1e6) == 0)
    assert np.all(added(draw, picture, intensity=0) == 0)


def test_a_glow_is_round_and_falls_off(draw: Draw) -> None:
    picture = np.zeros((96, 96, 3), np.float32)
    picture[44:52, 44:52] = 50
    glow = added(draw, picture)[..., 0]
    np.testing.assert_allclose(glow, glow.T, rtol=1e-4, atol=1e-5)
    np.testing.assert_allclose(glow, glow[::-1], rtol=1e-4, atol=1e-5)
    beside, diagonal = glow[48, 48 + 20], glow[48 + 14, 48 + 14]
    assert abs(beside - diagonal) < 0.1 * beside
    assert np.all(np.diff(glow[48, 48:]) <= 1e-6)


def test_exposure_moves_the_threshold_not_the_glow(draw: Draw, noise: Noise) -> None:
    """A scene 8 times brighter, exposed the same, glows 8 times brighter."""
    picture = noise(40, 30) + np.float32(0.01)
    once, more = (added(draw, picture * factor, ", gain: eye.gain", threshold=1.5) for factor in (1.0, 8.0))
    np.testing.assert_allclose(more, 8 * once, rtol=1e-4, atol=1e-5 * picture.max())
