"""Occlusion at two sizes against the same at the picture's own."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest

from .conftest import Occlusion

Floats = npt.NDArray[np.float64]

STUDY = """objects:
  floor: {shape: plane, size: [20, 20]}
  wall: {shape: box, size: [4, 2, 0.1], at: [0, 1, -0.6]}
  ball: {shape: sphere, radius: 0.5, at: [0.9, 0.5, 0.3]}
  post1: {shape: cylinder, radius: 0.03, height: 1.5, at: [-0.9, 0.75, 0]}
  post2: {shape: cylinder, radius: 0.03, height: 1.5, at: [-0.6, 0.75, 0.3]}
  post3: {shape: cylinder, radius: 0.03, height: 1.5, at: [-0.2, 0.75, 0.5]}
cameras: {main: {eye: [0, 2.2, 4], target: [0, 0.5, 0], fov_y_degrees: 40, near: 0.1, far: 60}}
"""
CORNER = """objects:
  floor: {shape: plane, size: [20, 20]}
  wall: {shape: box, size: [20, 8, 0.1], at: [0, 4, -1]}
cameras: {main: {eye: [4, 4, 4], target: [0, 0.2, 0], fov_y_degrees: 40, near: 0.1, far: 60}}
"""
SIZE = (96, 72)
TECHNIQUES = pytest.mark.parametrize("technique", ["hemisphere", "disc", "hbao", "gtao"])


@pytest.fixture
def apart(occlusion: Occlusion) -> Occlusion:
    """`apart(technique, **params)`: how far two sizes are off the whole one, per pixel."""

    def difference(technique: str, **params: float) -> Floats:
        both = (occlusion(technique, STUDY, SIZE, samples=128, radius=0.5, scale=scale, **params) for scale in (0.5, 1))
        two, whole = both
        assert whole.min() < 0.6
        return np.asarray(np.abs(two - whole))

    return difference


@pytest.mark.nightly(keep=1)
@TECHNIQUES
def test_edges_and_contacts_are_those_of_the_whole_size(apart: Occlusion, technique: str) -> None:
    """Posts two texels wide, silhouettes before others and before nothing, corners: no halo, nothing leaks."""
    two = apart(technique)
    assert two.max() < 0.2
    assert np.quantile(two, 0.99) < 0.04
    mean = np.sqrt((two**2).mean())
    assert mean < 0.01
    assert mean < 0.4 * np.sqrt((apart(technique, contrast=1) ** 2).mean())


@pytest.mark.nightly(keep=1)
@TECHNIQUES
@pytest.mark.parametrize("axis", [0, 1])
def test_what_is_interpolated_is_smooth(occlusion: Occlusion, technique: str, axis: int) -> None:
    """Where nothing is marked, slopes change from pixel to pixel no more than at full size: weights are the right way.

    Of four that share, full size makes stairs, two sizes do not.
    """
    both = (
        occlusion(technique, CORNER, SIZE, samples=128, radius=1.5, **more)
        for more in ({"contrast": 1, "scale": 0.5}, {"scale": 1})
    )
    two, whole = (np.sqrt((np.diff(picture, 2, axis) ** 2).mean()) for picture in both)
    assert two < (1.3 if technique == "hemisphere" else 0.6) * whole  # turned round they are 1.4 and more


@pytest.mark.parametrize("technique", ["disc", "hbao", "gtao"])
def test_slopes_are_interpolated_and_contacts_drawn(occlusion: Occlusion, technique: str) -> None:
    """Row by row of a floor before a wall: the same as at full size beside the corner alone."""
    scene = CORNER.replace("eye: [4, 4, 4]", "eye: [0, 4, 4]")
    two, whole = (occlusion(technique, scene, SIZE, samples=128, radius=1.5, scale=scale) for scale in (0.5, 1))
    open_, same = whole.mean(axis=1), np.isclose(two, whole, atol=1e-6).mean(axis=1)
    corner = int(open_.argmin())
    assert same[corner - 2 : corner + 3].min() > 0.9
    slope = (open_ > 0.7) & (open_ < 0.95)
    assert slope.sum() > 12
    assert same[slope].max() < 0.1
    assert np.abs(two - whole)[slope].mean() < 0.02


@pytest.mark.parametrize("technique", ["hbao", "gtao"])
def test_fewer_arms_of_reduced_pixels_find_as_much(occlusion: Occlusion, technique: str) -> None:
    """Floor and wall seen aslant, all interpolated, against 16 arms a pixel: `gtao`'s slices count by their weights."""
    scene = CORNER.replace("eye: [4, 4, 4], target: [0, 0.2, 0]", "eye: [4, 0.6, 0.5], target: [0, 0.4, -0.9]")
    two = occlusion(technique, scene, SIZE, samples=32, radius=1.5, scale=0.5, contrast=1)
    whole = occlusion(technique, scene, SIZE, samples=128, radius=1.5, scale=1)
    shade = whole < 0.97
    assert shade.mean() > 0.4
    assert abs((two - whole)[shade].mean()) < 0.006  # 0.015 if each pixel's slices counted alike
    assert np.sqrt(((two - whole)[shade] ** 2).mean()) < 0.035


def test_without_a_blur_every_pixel_is_its_own(occlusion: Occlusion) -> None:
    """Noise is not interpolated: pixel by pixel the picture that knows of no other size."""
    two, whole = (occlusion("hemisphere", STUDY, SIZE, radius=0.5, blur=0, scale=scale) for scale in (0.5, 1))
    assert whole.std() > 0.1
    np.testing.assert_array_equal(two, whole)
