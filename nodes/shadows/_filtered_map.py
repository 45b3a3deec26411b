"""What the techniques share that filter a shadow map before anybody looks it up."""

from __future__ import annotations

from typing import Any, ClassVar

from rendergraph.api import Facts, Function, Internal, Node, Part, Port, ShadowLookup, State, Steps, param

from ._map_technique import MapTechnique, map_layers

BANDS = 4
"""What a map is filtered in, one after the other."""


def band_size(node: Node, facts: Facts) -> tuple[int, int]:
    """Width and height of a band of a connected shadow map."""
    desc = facts.input("shadow_map").desc if facts.connected("shadow_map") else None
    return (desc.width, -(-desc.height // BANDS)) if desc is not None else (1, 1)


class FilteredMap(MapTechnique):
    """Base of the techniques that make something of depth that can be averaged.

    Each layer is averaged over a square of `2 radius + 1` texels a side, one axis after the other, so that 15×15 texels
    cost 30 taps. `down` names the fragment shader of the first axis, which reads depth and writes `filtered`, what the
    technique keeps of it, and `covered`, the share of texels where anything is; `across` the second's, a mean. Nothing
    is kept of an empty texel: what lies there is the receiver itself, at a depth only the lookup knows, or further away
    and of no matter. What takes several layers of `filtered` makes `at_once` of them from one look at the depth, in
    `filtered`, `filtered_1` and so on.

    Columns come first, for then a band of rows needs nothing of its neighbours: what lies between the two axes is held
    for a quarter of the map at a time.
    """

    down: ClassVar[str]
    across: ClassVar[str] = "filtered_map_across.frag"
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
    columns = Internal(
        kind="texture2d_array",
        format=lambda node, facts: node.texel,
        size=band_size,
        layers=lambda node, facts: min(node.at_once, node.parts()),
    )
    covered_columns = Internal(format="r16", size=band_size)

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
        """Columns, then rows, of a band and a few parts of a layer after the other; they share what is between."""
        covered, band = steps.desc(self.covered), steps.desc(self.covered_columns)
        for layer in range(covered.layers):
            for first in range(0, self.parts(), self.at_once):
                for row in range(0, covered.height, band.height):
                    self._band(steps, layer, range(first, min(first + self.at_once, self.parts())), row)
        super().record(steps)

    def _band(self, steps: Steps, layer: int, parts: range, first_row: int) -> None:
        band = steps.desc(self.covered_columns)
        down: dict[str, Port | Part] = {
            f"filtered_{i}" if i else "filtered": self.columns.layer(i) for i in range(len(parts))
        }
        if parts[0] == 0:
            down["covered"] = self.covered_columns
        steps.fullscreen(
            self.down,
            out=down,
            shadow_map=self.shadow_map.layer(layer).sampled(),
            first_row=first_row,
            defines={"LAYER": layer, "FIRST_PART": parts[0], "PARTS": len(parts)},
        )
        for i, part in enumerate(parts):
            columns: dict[str, Any] = {"columns": self.columns.layer(i).sampled()}
            across: dict[str, Port | Part] = {"filtered": self.filtered.layer(layer * self.parts() + part)}
            if part == 0:
                columns["covered_columns"], across["covered"] = self.covered_columns, self.covered.layer(layer)
            state = State(scissor=(0, first_row, band.width, band.height))
            steps.fullscreen(self.across, out=across, state=state, first_row=first_row, **columns)


def filtered_lookup(shader: str) -> Function:
    """The function of a technique that reads the filtered map with the hardware's filter."""
    reads = (FilteredMap.filtered.sampled("linear"), FilteredMap.covered.sampled("linear"))
    return Function(ShadowLookup, shader, reads=reads, doc="Visibility, for shaders to call.")
