"""What two sizes are made of against NumPy: the even mean, where it bends, and what is put between its pixels."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from rendergraph.nodes.occlusion._screen_space import reduced_size
from rendergraph.nodes.occlusion.gtao import GTAO

import rendergraph as rg
from rendergraph.api import Any as AnyTexel
from rendergraph.api import Output

from .test_pieces import RADIUS, Floats, drawn, flipped, places, positions, same_surface

CONTRAST = 0.2


class ShownHorizons(GTAO):
    """The same with its scratch textures to look at."""

    full_surfaces = Output(AnyTexel, format="rgba32f", size="depth", view="depth", doc="Surfaces.")  # type: ignore[assignment]
    unfiltered = Output(AnyTexel, format="r16f", size=reduced_size, doc="Before the mean.")  # type: ignore[assignment]
    averaged = Output(AnyTexel, format="r16", size=reduced_size, doc="After it.")  # type: ignore[assignment]
    marked = Output(AnyTexel, format="r32f", size=reduced_size, doc="The same, -1 where it bends.")  # type: ignore[assignment]


def moved(texels: Floats, up: int, right: int) -> Floats:
    """What lies that many texels away; 0 outside of the picture."""
    wide = np.pad(texels, ((2, 2), (2, 2), *((0, 0),) * (texels.ndim - 2)))
    return np.asarray(wide[2 + up :, 2 + right :][: texels.shape[0], : texels.shape[1]])


@pytest.mark.parametrize("size", [(64, 48), (81, 61)])
def test_two_sizes_in_numpy(session: rg.Session, tmp_path: Path, size: tuple[int, int]) -> None:
    text = f"""
  ao:
    type: shown_horizons
    inputs: {{depth: g.depth, normal: g.normal}}
    params: {{radius: {RADIUS}, contrast: {CONTRAST}}}
outputs: {{occlusion: ao.occlusion, full_surfaces: ao.full_surfaces, unfiltered: ao.unfiltered, averaged: ao.averaged, marked: ao.marked}}
"""
    frame, camera = drawn(session, tmp_path, size, text, ShownHorizons)
    found, unfiltered, mean, bent = (
        flipped(frame, name)[..., 0] for name in ("occlusion", "unfiltered", "averaged", "marked")
    )
    whole = flipped(frame, "full_surfaces")
    height, width = mean.shape
    where = positions(whole[..., 3], *places(size, size), camera)
    x, y = (
        np.round(place * side - 0.5).astype(int)
        for place, side in zip(places((width, height), size), size, strict=True)
    )
    at, surface = where[np.ix_(y, x)], whole[np.ix_(y, x)]
    there = surface[..., 3] > 0

    # Nine quads: the middle one counts half along each axis, the nearer neighbour three eighths. The farther one is
    # seen where the pixel beside sees it.
    total, weighted = np.zeros(mean.shape), np.zeros(mean.shape)
    ahead = [np.where(np.arange(n) % 2, 1, -1) for n in mean.shape]
    for ways in np.ndindex(3, 3):
        lines = [np.arange(len(side)) + (0, 2, -3)[way] * side for side, way in zip(ahead, ways, strict=True)]
        k = np.ix_(*(np.clip(line, 0, len(line) - 1) for line in lines))
        inside = np.logical_and.outer(*((line >= 0) & (line < len(line)) for line in lines))
        weight = same_surface(at[k] - at, surface[..., :3], surface[k][..., :3]) * inside
        weight *= np.prod([(0.5, 0.375, 0.125)[way] for way in ways])
        total, weighted = total + weight, weighted + weight * unfiltered[k]
    assert np.abs(mean - unfiltered)[there].max() > 0.02
    np.testing.assert_allclose(mean[there], (weighted / np.maximum(total, 1e-9))[there], atol=1e-3)

    # The second difference, of a plane's end the doubled first.
    bend = np.zeros(mean.shape)
    for axis in ((1, 0), (0, 1)):
        rise, sides = np.zeros(mean.shape), np.zeros(mean.shape)
        for away in np.array([axis, axis]) * [[2], [-2]]:
            off = ((moved(at, *away) - at) * surface[..., :3]).sum(-1)
            facing = (moved(surface, *away)[..., :3] * surface[..., :3]).sum(-1)
            near = (np.abs(off) < 0.1 * RADIUS) & (facing > 0.87)
            rise, sides = rise + near * (moved(mean, *away) - mean), sides + near
        rise[sides == 0] = 1  # what is narrow
        bend = np.maximum(bend, np.abs(rise) * np.select([sides == 2, sides == 1], [1, 2], 1))
    assert 0.05 < (bend > CONTRAST)[there].mean() < 0.6
    clear = there & (np.abs(bend - CONTRAST) > 1e-5)
    np.testing.assert_allclose(bent[clear], np.where(bend > CONTRAST, -1, mean)[clear], atol=1e-5)

    # Between the four texels around; what says too little is drawn, and with it the four pixels it is drawn with.
    low = [np.searchsorted(line, np.arange(n) // 2 * 2, "right") - 1 for line, n in ((y, size[1]), (x, size[0]))]
    total, weighted, asks = (np.zeros(found.shape) for _ in range(3))
    for corner in np.ndindex(2, 2):
        shares, texels = [], []
        for line, first, side in zip((y, x), low, corner, strict=True):
            ends = [np.clip(first + end, 0, len(line) - 1) for end in (side, 1 - side)]
            own, other = line[ends[0]], line[ends[1]]
            share = np.clip((other - np.arange(len(first))) / np.where(own == other, 1, other - own), 0, 1)
            shares.append(np.where(own == other, 0.5, share))
            texels.append(ends[0])
        k = np.ix_(*texels)
        off = ((at[k] - where) * whole[..., :3]).sum(-1)
        same = (np.abs(off) < 0.1 * RADIUS) & ((surface[k][..., :3] * whole[..., :3]).sum(-1) > 0.87)
        weight = np.outer(*shares) * same
        total, weighted = total + weight, weighted + weight * bent[k]
        asks = np.maximum(asks, (weight > 0) & (bent[k] < 0))
    marked = ((asks > 0) | (total < 1e-3)) & (whole[..., 3] > 0)
    marked = np.pad(marked, ((0, size[1] % 2), (0, size[0] % 2)))
    quads = marked.reshape(marked.shape[0] // 2, 2, -1, 2).max((1, 3))
    kept = ~np.kron(quads, np.ones((2, 2), bool))[: size[1], : size[0]] & (whole[..., 3] > 0)
    assert 0.3 < kept[whole[..., 3] > 0].mean() < 0.9
    np.testing.assert_allclose(found[kept], weighted[kept] / total[kept], atol=1e-4)
    other = (whole[..., 3] > 0) & ~kept & (total > 1e-3)
    assert np.mean(np.abs(found[other] - weighted[other] / total[other]) > 1e-3) > 0.9
