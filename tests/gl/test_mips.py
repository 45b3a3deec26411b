"""Levels of pictures of light: each texel is the mean of what it covers."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest

import rendergraph as rg
from rendergraph.gl import textures
from rendergraph.textures import TextureDesc, full_mip_count


def _halves(side: int) -> npt.NDArray[np.float64]:
    """Rows that average a side's texels, by how much of each a texel below covers."""
    below = max(1, side // 2)
    edges = np.linspace(0, side, below + 1)
    texels = np.arange(side)
    cover = np.minimum(edges[1:, None], texels + 1) - np.maximum(edges[:-1, None], texels)
    rows: npt.NDArray[np.float64] = np.clip(cover, 0, None) * (below / side)
    return rows


@pytest.mark.parametrize("format", ["rgba16f", "rgba32f"])
@pytest.mark.parametrize("size", [(16, 8), (13, 6), (1, 7), (1, 1)])
def test_levels_are_exact_means(gl: rg.Session, format: str, size: tuple[int, int]) -> None:
    width, height = size
    texels = np.random.default_rng(7).random((height, width, 4)).astype(np.float16).astype(np.float32)
    desc = TextureDesc("texture2d", format, width, height, mips=full_mip_count(width, height))
    device = gl.device
    with device.current():
        texture = textures.create(device, desc)
        textures.upload(device, texture, texels)
        textures.fill_mips(device, texture)
        levels = [textures.read(device, texture, mip=mip)[0] for mip in range(desc.mips)]
        textures.delete(device, texture)
    expected = texels.astype(np.float64)[::-1]  # the top row is read first
    for mip, level in enumerate(levels):
        if mip:
            expected = np.einsum("ya,xb,abc->yxc", _halves(expected.shape[0]), _halves(expected.shape[1]), expected)
        np.testing.assert_allclose(level, expected, atol=1e-6 if format == "rgba32f" else 2e-3)
    assert levels[-1].shape == (1, 1, 4)
