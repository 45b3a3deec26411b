"""The filter over surfaces: against NumPy, and that it takes noise and leaves edges."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

import rendergraph as rg
from rendergraph.scene.cameras import view_matrices

Floats = npt.NDArray[np.float64]
SIZE = (64, 48)


def filtered(session: rg.Session, **params: Any) -> tuple[dict[str, Floats], Any]:
    """The lit Cornell box before and after, its depth and normals, bottom row first, and the camera."""
    node = {
        "type": "denoise",
        "inputs": {"source": "light.radiance", "depth": "gbuffer.depth", "normal": "gbuffer.normal"},
        "params": params,
    }
    ports = {"x": "smooth.denoised", "raw": "light.radiance", "depth": "gbuffer.depth", "normal": "gbuffer.normal"}
    pipeline = rg.load(
        "deferred",
        scene="cornell_box",
        size=SIZE,
        sets=["gbuffer.precision=full"],
        patches=[{"nodes": {"smooth": node}, "outputs": ports}],
    )
    frame = session.render(pipeline, outputs=list(ports))
    camera = view_matrices(next(iter(pipeline.link().scene.cameras.values())), SIZE)
    return {name: np.asarray(frame.arrays[name][::-1], np.float64) for name in ports}, camera


def test_a_pass_in_numpy(session: rg.Session) -> None:
    found, camera = filtered(session, passes=1, tolerance=0.02)
    depth, raw = found["depth"][..., 0], found["raw"]
    x, y = ((np.arange(side) + 0.5) / side * 2 - 1 for side in SIZE)
    near, far = 0.1, 20.0
    distance = np.where(depth > 0, near * far / np.maximum(depth * (far - near) + near, 1e-9), 0)
    p = camera.projection
    ndc_x, ndc_y = np.meshgrid(x, y)
    where = np.stack([ndc_x * distance / p[0, 0], ndc_y * distance / p[1, 1], -distance], -1)
    normal = found["normal"][..., :3] @ camera.view[:3, :3].T
    total, weighted = np.full(depth.shape, 4.0), 4 * raw
    for up in (-1, 0, 1):
        for right in (-1, 0, 1):
            if up == right == 0:
                continue
            rows, columns = np.arange(SIZE[1]) + up, np.arange(SIZE[0]) + right
            inside = ((rows >= 0) & (rows < SIZE[1]))[:, None] & ((columns >= 0) & (columns < SIZE[0]))
            there = np.ix_(rows % SIZE[1], columns % SIZE[0])
            off = ((where[there] - where) * normal).sum(-1) / (0.02 + 2.4e-7 * distance)
            facing = np.maximum((normal * normal[there]).sum(-1), 0) ** 8
            weight = (
                (1 if up * right else 2) * np.maximum(1 - off**2 / 4, 0) ** 4 * facing * inside * (distance[there] > 0)
            )
            total, weighted = total + weight, weighted + weight[..., None] * raw[there]
    expected = np.where((distance > 0)[..., None], weighted / total[..., None], raw)
    assert np.abs(found["x"] - raw).max() > 0.1
    np.testing.assert_allclose(found["x"][..., :3], expected[..., :3], rtol=4e-3, atol=2e-3)


@pytest.mark.parametrize("passes", [2, 3, 6])
def test_light_stays_on_its_surface(session: rg.Session, passes: int) -> None:
    """A wide filter mixes a surface's light with its own: what is red beside a white wall stays as red as it was."""
    found, _ = filtered(session, passes=passes, tolerance=0.01)
    reds = (found["normal"][..., 0] > 0.9) & (found["depth"][..., 0] > 0)  # the left wall and the boxes' sides
    whites = (found["normal"][..., 2] > 0.99) & (found["depth"][..., 0] > 0)
    assert np.abs(found["x"] - found["raw"]).max() > 0.1
    for surface in (reds, whites):
        before, after = (found[name][surface][:, :3].mean(axis=0) for name in ("raw", "x"))
        np.testing.assert_allclose(after, before, rtol=0.15, atol=5e-3)
