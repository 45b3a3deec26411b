"""Textures in a corner: the values they have there, and a picture that is as it was elsewhere."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

import rendergraph as rg

SIZE = (90, 60)


def drawn(session: rg.Session, tap: str, **params: Any) -> tuple[npt.NDArray[Any], npt.NDArray[Any], npt.NDArray[Any]]:
    """The picture with a texture in it, that before, and the texture, all with the top row first."""
    port = "layers" if tap.startswith("sun") else "source"
    node = {"type": "show_texture", "inputs": {"color": "display.color", port: tap}, "params": params}
    patch = {"nodes": {"shown": node}, "outputs": {"image": "shown.color"}}
    loaded = rg.load("deferred", size=SIZE, scene="lantern", sets=("sun.resolution=17",)).patch(patch)
    frame = session.render(loaded, taps=("display.color", tap), warm_up=False)
    return frame["image"], frame["display.color"], frame.arrays[tap]


def test_normals_stand_in_the_corner(session: rg.Session) -> None:
    """Of half the height, nearest texels: 28 rows within margins of 2, and a line around them."""
    after, before, normals = drawn(session, "gbuffer.normal", corner="upper_left", height=0.5)
    tile = after[2:30, 2:44, :3].astype(float) / 255
    y, x = (np.arange(28) + 0.5) / 28 * 60, (np.arange(42) + 0.5) / 42 * 90
    expected = normals[y.astype(int)][:, x.astype(int), :3] * 0.5 + 0.5
    step = 0.51 if session.device.software else 0.6  # how GPUs round to 8 bits
    np.testing.assert_allclose(tile, expected, atol=step / 255)
    assert np.ptp(tile, axis=(0, 1)).min() > 0.3
    assert (after[1, 1:45] == 255).all()
    assert (after[30, 1:45] == 255).all()
    after[1:31, 1:45] = before[1:31, 1:45]
    np.testing.assert_array_equal(after, before)


@pytest.mark.parametrize("spread", [(0.0, 1.0), (0.1, 0.4)])
def test_six_faces_are_a_grid_of_distances(session: rg.Session, spread: tuple[float, float]) -> None:
    """Three columns of two, the first face at the upper left; a perspective view's depth becomes a distance."""
    after, _, faces = drawn(session, "sun.shadow_map", height=1.0, low=spread[0], high=spread[1])
    far = 0.0
    for number, face in enumerate(faces[..., 0].astype(float)):
        row, column = divmod(number, 3)
        tile = after[2 + 28 * row : 30 + 28 * row, 4 + 28 * column : 32 + 28 * column, 0].astype(float) / 255
        inner = ((np.arange(28) + 0.5) / 28 * 17).astype(int)
        depth = face[inner][:, inner]
        # near / (near + d (far - near)) … with the room's near plane a thousandth of the far one.
        share = np.where(depth > 0, (1 / np.maximum(depth * 999 + 1, 1e-9) - 1e-3) / (1 - 1e-3), 1.0)
        expected = np.clip((share - spread[0]) / (spread[1] - spread[0]), 0, 1)
        np.testing.assert_allclose(tile, expected, atol=0.6 / 255)
        far = max(far, float(np.ptp(expected)))
    assert far > 0.5


def test_nothing_connected_leaves_the_picture(session: rg.Session) -> None:
    patch = {"nodes": {"shown": {"type": "show_texture", "inputs": {"color": "display.color"}}}}
    loaded = rg.load("deferred", size=(16, 12)).patch(patch).patch({"outputs": {"image": "shown.color"}})
    frame = session.render(loaded, taps=("display.color",), warm_up=False)
    np.testing.assert_array_equal(frame["image"], frame["display.color"])
