"""The table of areas against integration, straight edges against what they cover, and what is no edge."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import rendergraph as rg

LONGEST = 32


def height(shape: int, x: Any, whole: int) -> Any:
    """How high above the edge the line of a shape lies, 0 at its left end to `whole` at the right."""
    left, right = (0.5 * (end - 1) for end in divmod(shape, 3))
    if left * right < 0:
        return left + (right - left) * x / whole
    return np.where(x < whole / 2, left * (1 - 2 * x / whole), right * (2 * x / whole - 1))


def test_areas_are_integrals_of_lines(session: rg.Session) -> None:
    areas = session.render(rg.load("smaa", size=(32, 18)), taps=["aa.area_table"])["aa.area_table"]
    areas = np.asarray(areas[::-1], np.float64)  # the bottom row first
    side = LONGEST + 1
    assert areas.shape[:2] == (side, 9 * side)
    rng = np.random.default_rng(3)
    for shape in range(9):
        for before, after in rng.integers(0, side, (12, 2)):
            x = before + (np.arange(4000) + 0.5) / 4000
            y = height(shape, x, before + after + 1)
            expected = [np.maximum(y, 0).mean(), np.maximum(-y, 0).mean()]
            np.testing.assert_allclose(areas[after, shape * side + before, :2], expected, atol=1e-4)


def stairs(rise: float, turned: bool) -> tuple[Any, Any]:
    """A half-plane as pixels see it, and as they cover it."""
    y, x = np.mgrid[0:320, 0:320] / 10 + 0.05
    fine = (y - 16 > rise * (x - 16)).astype(float)
    exact, hard = fine.reshape(32, 10, 32, 10).mean(axis=(1, 3)), fine[5::10, 5::10]
    return (exact.T, hard.T) if turned else (exact, hard)


TEXT = """  show: {type: float_tonemap, inputs: {radiance: picture.radiance}, params: {curve: none}}
  aa: {type: smaa, inputs: {source: show.color}}
outputs: {image: aa.color, plain: show.color}"""


def light(c: Any) -> Any:
    return np.where(c > 0.04045, ((c + 0.055) / 1.055) ** 2.4, c / 12.92)


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("rise", [1 / 8, -1 / 5, 0.4])
def test_stairs_become_a_slope(draw: Any, rise: float, turned: bool) -> None:
    """In display light, where a mean is the area that is covered."""
    exact, hard = stairs(rise, turned)
    frame = draw(np.where(hard > 0, 0.6, 0.05)[..., None].astype(np.float32), TEXT)
    shown = light(frame["image"][..., 0].astype(float))
    low, high = (light(float(value)) for value in (frame["plain"][..., 0].min(), frame["plain"][..., 0].max()))
    inner = np.s_[2:-2, 14:-14] if not turned else np.s_[14:-14, 2:-2]  # both ends of each step are in the picture
    off = [np.abs(found - exact)[inner].mean() for found in (hard, (shown - low) / (high - low))]
    assert off[1] < 0.5 * off[0]
    assert (frame["image"][..., 3] == 1).all()


def test_what_is_no_stair_stays_as_it_is(draw: Any) -> None:
    """Even areas, slow gradients, and edges that run along the pixels."""
    picture = np.full((24, 24, 1), 0.2, np.float32)
    picture[:, 12:] = 0.6
    picture[:12] *= np.linspace(1, 1.3, 24, dtype=np.float32)[None, :, None]
    frame = draw(picture, TEXT)
    np.testing.assert_array_equal(frame["image"], frame["plain"])
