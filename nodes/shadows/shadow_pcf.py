"""Shadow maps with percentage-closer filtering."""

from __future__ import annotations

from typing import Literal

from rendergraph.api import Facts, Function, Internal, ShadowLookup, Steps, define, structural

from ._map_technique import MapTechnique, map_layers

_TILE = 16  # texels of the map along a side for which one range of depth is kept


def _tiles(node: ShadowPCF, facts: Facts) -> tuple[int, int]:
    desc = facts.input("shadow_map").desc if facts.connected("shadow_map") else None
    width, height = desc.size if desc is not None else (1, 1)
    return -(-width // _TILE), -(-height // _TILE)


class ShadowPCF(MapTechnique):
    """Shadows from a map by percentage-closer filtering.

    The mean of N×N depth tests one texel apart, each weighted bilinearly (Reeves, Salesin and Cook 1987): soft by about
    N texels, whatever the distance of the caster. With one tap the plain hard shadow of a single test.

    `kernel` says how the tests are weighed or where they lie: all alike; less towards the border, which hides the
    square; at points on a disc that follow no grid; at the same points turned by another angle at every pixel, which
    makes noise of what would be bands. `edges_only` looks first at the range of depth around: a receiver in front of
    all or behind all needs no tests, and the picture stays the same.
    """

    lookup = Function(
        ShadowLookup, "shadow_pcf.glsl", reads=("shadow_map", "edges"), doc="Visibility, for shaders to call."
    )
    edges = Internal(kind="texture2d_array", format="rg32f", size=_tiles, layers=map_layers)

    taps: int = define(default=3, min=1, max=16, doc="Tests along a side: 4 means 4×4, 1 is the plain hard shadow.")
    kernel: Literal["box", "tent", "poisson", "rotated"] = define(
        default="box", doc="Weights of the tests, or their places on a disc that is as wide as `taps` texels."
    )
    samples: int = define(default=16, min=1, max=64, doc="Tests of the kernels `poisson` and `rotated`.")
    edges_only: bool = structural(default=False, doc="Filter near shadow edges only; pays where kernels are wide.")

    def record(self, steps: Steps) -> None:
        """Ranges of depth where they are asked for."""
        if self.edges_only and self.taps > 1:
            tiles = steps.desc(self.edges)
            for layer in range(tiles.layers):
                steps.fullscreen(
                    "shadow_pcf_edges.frag",
                    out=self.edges.layer(layer),
                    defines={"REACH": self.taps // 2 + 2},
                    shadow_map=self.shadow_map.layer(layer).sampled(),
                    tiles=(float(tiles.width), float(tiles.height)),
                )
        super().record(steps)
