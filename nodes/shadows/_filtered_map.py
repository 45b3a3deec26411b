"""What the techniques share that filter a shadow map before anybody looks it up."""

from __future__ import annotations

from typing import Any, ClassVar

from rendergraph.api import Function, Internal, Part, Port, ShadowLookup, Steps, param

from ._map_technique import MapTechnique, map_layers


class FilteredMap(MapTechnique):
    """Base of the techniques that make something of depth that can be averaged.

    Each layer is averaged over a square of `2 radius + 1` texels a side, one axis after the other, so that 15×15 texels
    cost 30 taps. `across` names the fragment shader of the first axis, which reads depth and writes `filtered`, what
    the technique keeps of it, and `covered`, the share of texels where anything is; `up` the second's, a mean. Nothing
    is kept of an empty texel: what lies there is the receiver itself, at a depth only the lookup knows, or further away
    and of no matter. What takes several layers of `filtered` makes `at_once` of them from one look at the depth, in
    `filtered`, `filtered_1` and so on.
    """

    across: ClassVar[str]
    up: ClassVar[str] = "filtered_map_up.frag"
    texel: ClassVar[str] = "rg32f"
    at_once: ClassVar[int] = 1

    filtered = Internal(
        kind="texture2d_array",
        format=lambda node, facts: node.texel,
        size="shadow_map",
        layers=lambda node, facts: map_layers(node, facts) * node.parts(),
    )
    covered = Internal(
        kind="texture2d_array",
        format="r16",
        size="shadow_map",
        layers=map_layers,
        view="shadow_map",
        lights="shadow_map",
    )
    rows = Internal(
        kind="texture2d_array",
        format=lambda node, facts: node.texel,
        size="shadow_map",
        layers=lambda node, facts: min(node.at_once, node.parts()),
    )
    covered_rows = Internal(format="r16", size="shadow_map")

    radius: int = param(
        default=2,
        unit="texels",
        min=0,
        max=64,
        doc="Half the filter's width: 2 averages 5×5 texels, as PCF's 4×4 taps do.",
    )

    def parts(self) -> int:
        """How many layers of `filtered` stand for one of the map."""
        return 1

    def record(self, steps: Steps) -> None:
        """Rows, then columns, a few parts of a layer after the other; they share the textures between."""
        for layer in range(steps.desc(self.covered).layers):
            shadow_map = self.shadow_map.layer(layer).sampled()
            for first in range(0, self.parts(), self.at_once):
                count = min(self.at_once, self.parts() - first)
                across: dict[str, Port | Part] = {
                    f"filtered_{i}" if i else "filtered": self.rows.layer(i) for i in range(count)
                }
                if first == 0:
                    across["covered"] = self.covered_rows
                steps.fullscreen(
                    self.across,
                    out=across,
                    shadow_map=shadow_map,
                    defines={"LAYER": layer, "FIRST_PART": first, "PARTS": count},
                )
                for i in range(count):
                    rows: dict[str, Any] = {"rows": self.rows.layer(i).sampled()}
                    up: dict[str, Port | Part] = {"filtered": self.filtered.layer(layer * self.parts() + first + i)}
                    if first + i == 0:
                        rows["covered_rows"], up["covered"] = self.covered_rows, self.covered.layer(layer)
                    steps.fullscreen(self.up, out=up, **rows)
        super().record(steps)


def filtered_lookup(shader: str) -> Function:
    """The function of a technique that reads the filtered map with the hardware's filter."""
    reads = (FilteredMap.filtered.sampled("linear"), FilteredMap.covered.sampled("linear"))
    return Function(ShadowLookup, shader, reads=reads, doc="Visibility, for shaders to call.")
