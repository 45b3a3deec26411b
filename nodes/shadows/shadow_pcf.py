"""Shadow maps with percentage-closer filtering."""

from __future__ import annotations

from typing import Literal

from rendergraph.api import Facts, Function, Internal, ShadowLookup, Steps, define, structural

from ._map_technique import MapTechnique, map_layers

_TILE = 16  # texels of the map along a side that share a range of depths


def _tiles(node: ShadowPCF, facts: Facts) -> tuple[int, int]:
    desc = facts.input("shadow_map").desc if facts.connected("shadow_map") else None
    width, height = desc.size if desc is not None else (1, 1)
    return -(-width // _TILE), -(-height // _TILE)


class ShadowPCF(MapTechnique):
    """Filter the results of depth tests: percentage-closer filtering.

    The visibility is the mean of N×N depth tests one texel apart, each weighted bilinearly (Reeves, Salesin and Cook
    1987). Penumbrae are about N texels wide, regardless of the distance of the caster. With one tap it is a hard
    shadow.

    `kernel` sets the weights or the positions of the tests: equal weights; weights that decrease towards the border,
    which hides the square shape; a Poisson disc; or the disc rotated by a different angle per pixel, which turns
    banding into noise. `edges_only` first reads the range of depths in the kernel: a receiver in front of all of them
    or behind all of them needs no tests, and the picture is the same.
    """

    lookup = Function(
        ShadowLookup, "shadow_pcf.glsl", reads=("shadow_map", "depth_ranges"), doc="Visibility, for shaders to call."
    )
    depth_ranges = Internal(kind="texture2d_array", format="rg32f", size=_tiles, layers=map_layers)

    taps: int = define(default=3, min=1, max=16, doc="Tests along a side: 4 means 4×4, 1 is a hard shadow.")
    kernel: Literal["box", "tent", "poisson", "rotated"] = define(
        default="box", doc="Weights of the tests, or their positions on a disc of `taps` texels diameter."
    )
    samples: int = define(default=16, min=1, max=64, doc="Number of tests of the kernels `poisson` and `rotated`.")
    edges_only: bool = structural(default=False, doc="Filter only near shadow edges, which pays off for wide kernels.")

    def record(self, steps: Steps) -> None:
        """Record the ranges of depths, if they are used."""
        if self.edges_only and self.taps > 1:
            tiles = steps.desc(self.depth_ranges)
            for layer in range(tiles.layers):
                steps.fullscreen(
                    "shadow_pcf_ranges.frag",
                    out=self.depth_ranges.layer(layer),
                    defines={"REACH": self.taps // 2 + 2},
                    shadow_map=self.shadow_map.layer(layer).sampled(),
                    tiles=(float(tiles.width), float(tiles.height)),
                )
        super().record(steps)
