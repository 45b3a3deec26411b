"""What the techniques share that filter a shadow map before anybody looks it up."""

from __future__ import annotations

from typing import ClassVar

from rendergraph.api import Function, Internal, ShadowLookup, Steps, param

from ._map_technique import MapTechnique, map_layers


class FilteredMap(MapTechnique):
    """Base of the techniques that make something of depth that can be averaged.

    Each layer is averaged over a square of `2 radius + 1` texels a side, one axis after the other, so that 15×15 texels
    cost 30 taps. `across` names the fragment shader of the first axis, which reads depth and writes `filtered`, what
    the technique keeps of it, and `covered`, the share of texels where anything is. Nothing is kept of an empty texel:
    what lies there is the receiver itself, at a depth only the lookup knows, or further away and of no matter.
    """

    across: ClassVar[str]
    texel: ClassVar[str] = "rg32f"

    filtered = Internal(
        kind="texture2d_array",
        format=lambda node, facts: node.texel,
        size="shadow_map",
        layers=map_layers,
        view="shadow_map",
        lights="shadow_map",
    )
    covered = Internal(kind="texture2d_array", format="r16", size="shadow_map", layers=map_layers)
    rows = Internal(format=lambda node, facts: node.texel, size="shadow_map")
    covered_rows = Internal(format="r16", size="shadow_map")

    radius: int = param(
        default=7, unit="texels", min=0, max=64, doc="Half the filter's width: 7 averages 15×15 texels."
    )

    def record(self, steps: Steps) -> None:
        """Two steps a layer, which share the texture between them."""
        for layer in range(steps.desc(self.filtered).layers):
            steps.fullscreen(
                self.across,
                out={"filtered": self.rows, "covered": self.covered_rows},
                shadow_map=self.shadow_map.layer(layer).sampled(),
                defines={"LAYER": layer},
            )
            steps.fullscreen(
                "filtered_map_up.frag",
                rows=self.rows,
                covered_rows=self.covered_rows,
                out={"filtered": self.filtered.layer(layer), "covered": self.covered.layer(layer)},
            )
        super().record(steps)


def filtered_lookup(shader: str) -> Function:
    """The function of a technique that reads the filtered map with the hardware's filter."""
    reads = (FilteredMap.filtered.sampled("linear"), FilteredMap.covered.sampled("linear"))
    return Function(ShadowLookup, shader, reads=reads, doc="Visibility, for shaders to call.")
