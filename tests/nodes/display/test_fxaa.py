"""Edges of finished pictures: straight ones become what they cover, and what is no edge stays."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import rendergraph as rg

TEXT = """  show: {type: float_tonemap, inputs: {radiance: picture.radiance}, params: {curve: none}}
  aa: {type: fxaa, inputs: {source: show.color}}
outputs: {image: aa.color, plain: show.color}"""


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("rise", [1 / 8, -1 / 5])
def test_stairs_become_a_slope(draw: Any, rise: float, turned: bool) -> None:
    """A half-plane whose edge rises one pixel in five or eight, against the area that it covers of each pixel."""
    y, x = np.mgrid[0:320, 0:320] / 10 + 0.05
    fine = (y - 16 > rise * (x - 16)).astype(float)
    exact = fine.reshape(32, 10, 32, 10).mean(axis=(1, 3))
    hard = fine[5::10, 5::10]
    if turned:
        exact, hard = exact.T, hard.T
    picture = np.where(hard > 0, 0.6, 0.05)[..., None].astype(np.float32)
    frame = draw(picture, TEXT)
    low, high = frame["plain"][..., 0].min(), frame["plain"][..., 0].max()
    shown = (frame["image"][..., 0] - low) / (high - low)
    inner = np.s_[2:-2, 14:-14] if not turned else np.s_[14:-14, 2:-2]  # both ends of each step are in the picture
    off = [np.abs(found - exact)[inner].mean() for found in (hard, shown)]
    assert off[1] < 0.6 * off[0]
    assert (frame["image"][..., 3] == 1).all()


def test_what_is_no_edge_stays_as_it_is(draw: Any, noise: Any) -> None:
    """Even areas, slow gradients, and edges that run along the pixels."""
    picture = np.full((24, 24, 1), 0.2, np.float32)
    picture[:, 12:] = 0.6
    picture[:12] *= np.linspace(1, 1.3, 24, dtype=np.float32)[None, :, None]
    frame = draw(picture, TEXT)
    far = np.s_[2:9, 2:9]
    np.testing.assert_array_equal(frame["image"][far], frame["plain"][far])
    below = np.s_[16:, 2:-2]
    np.testing.assert_allclose(frame["image"][below], frame["plain"][below], atol=0.02)


@pytest.mark.parametrize(("bright", "dark", "smooth"), [(0.4, 0.32, True), (0.9, 0.82, False), (0.03, 0.01, False)])
def test_an_edge_differs_by_a_share_of_what_is_brighter(draw: Any, bright: float, dark: float, smooth: bool) -> None:
    """A pixel that stands out by a fifth is smoothed, by a tenth not, and by 0.02 of white not in the dark either."""
    shown = np.full((9, 9, 1), dark)
    shown[4, 4] = bright
    radiance = np.where(shown > 0.04045, ((shown + 0.055) / 1.055) ** 2.4, shown / 12.92)
    frame = draw(radiance.astype(np.float32), TEXT)
    assert (frame["image"][4, 4, 0] != frame["plain"][4, 4, 0]) == smooth


@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize("scene", ["shadow_study", "stairs"])
def test_pictures_come_nearer_to_those_of_more_pixels(session: rg.Session, scene: str) -> None:
    def shown(pipeline: str, size: tuple[int, int]) -> Any:
        c = session.render(rg.load(pipeline, scene=scene, size=size), outputs=["image"])["image"][..., :3] / 255
        return np.where(c > 0.04045, ((c + 0.055) / 1.055) ** 2.4, c / 12.92)

    exact = shown("forward", (640, 360)).reshape(90, 4, 160, 4, 3).mean(axis=(1, 3))
    off = [float(((shown(name, (160, 90)) - exact) ** 2).mean()) for name in ("forward", "fxaa")]
    assert off[1] < 0.8 * off[0]
