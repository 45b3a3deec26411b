"""A map over the scene: every pixel has the colour of the texel and the layer that its point lies in."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest

import rendergraph as rg

SIZE = (96, 64)
SHOWN: dict[str, Any] = {
    "type": "show_shadow_map",
    "inputs": {"depth": "gbuffer.depth", "shadow_map": "sun.shadow_map", "color": "display.color"},
}


def painted(session: rg.Session, scene: str, *sets: str, shown: str = "depth") -> rg.Frame:
    """The map alone over a picture: opaque."""
    loaded = rg.load("shadow-pcf", size=SIZE, scene=scene, sets=sets)
    node = SHOWN | {"params": {"shown": shown, "opacity": 1.0, "texels": 1}}
    loaded = loaded.patch({"nodes": {"shown": node}, "outputs": {"image": "shown.color"}})
    return session.render(loaded, taps=("display.color", "gbuffer.depth"), warm_up=False)


def test_texels_lie_where_the_map_has_them(session: rg.Session, look: Any) -> None:
    """Black and white in turns, by the place that NumPy finds for each pixel in the light's map."""
    seen = look("shadow-pcf", size=SIZE, resolution=32)
    picture = painted(session, "shadow_study", "sun.resolution=32", shown="texels")
    texel = seen.places[..., :2] * 32
    inside = seen.seen & np.all((texel > 0) & (texel < 32), axis=-1)
    clear = inside & np.all(np.abs(texel - np.round(texel)) > 1e-3, axis=-1)
    even = (np.floor(texel).astype(int).sum(axis=-1) & 1) * 255
    shown = picture["image"][::-1, :, 0]
    assert clear.sum() > 1000
    np.testing.assert_array_equal(shown[clear], even[clear])
    outside = seen.seen & np.any((texel < -1e-3) | (texel > 32 + 1e-3), axis=-1)
    assert outside.sum() > 30
    np.testing.assert_array_equal(shown[outside], picture["display.color"][::-1, :, 0][outside])


def test_layers_follow_distance(session: rg.Session) -> None:
    """Four cascades on a road: their colours come one after the other with growing distance, and are blended."""
    picture = painted(session, "avenue", "sun.type=shadow_cascaded", "sun.resolution=128", shown="layers")
    colors = np.array([(0.90, 0.25, 0.20), (0.25, 0.75, 0.30), (0.25, 0.45, 0.95), (0.95, 0.80, 0.20)])
    depth = picture.arrays["gbuffer.depth"][..., 0].astype(float)
    apart = np.abs(picture["image"][:, :, np.newaxis, :3] / 255 - colors).max(axis=-1)
    layers = [depth[(apart[..., layer] < 3e-3) & (depth > 0)] for layer in range(4)]
    assert min(map(len, layers)) > 5
    for near, far in pairwise(layers):
        assert near.min() > far.max()
    changed = (picture["image"] != picture["display.color"]).any(axis=-1)
    assert (changed & (apart.min(axis=-1) > 0.02)).any()  # between two


def test_a_light_without_a_map_is_said(session: rg.Session) -> None:
    node = SHOWN | {"params": {"light": "bulb"}}
    loaded = rg.load("shadow-pcf", size=(16, 12)).patch({"nodes": {"shown": node}, "outputs": {"image": "shown.color"}})
    with pytest.raises(rg.errors.RendergraphError, match="the scene has no light 'bulb'"):
        session.render(loaded)
