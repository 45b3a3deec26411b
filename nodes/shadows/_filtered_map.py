"""Base of the techniques that filter a shadow map before it is looked up."""

from __future__ import annotations

from typing import Any, ClassVar

from rendergraph.api import Facts, Function, Internal, Node, Part, Port, ShadowLookup, State, Steps, param

from ._map_technique import MapTechnique, map_layers

BANDS = 4
"""Number of bands of rows in which a map is filtered, one after the other."""


def band_size(node: Node, facts: Facts) -> tuple[int, int]:
    """Return the width and height of a band of the connected shadow map."""
    desc = facts.input("shadow_map").desc if facts.connected("shadow_map") else None
    return (desc.width, -(-desc.height // BANDS)) if desc is not None else (1, 1)


class FilteredMap(MapTechnique):
    """Base of the techniques that filter a function of depth.

    A separable box filter averages each layer over `2 radius + 1` texels per side, so that 15×15 texels cost 30 taps.
    `vertical_shader` reads depth and writes the average of the technique's function along columns (`filtered_map`)
    and the fraction of covered texels (`coverage`); `horizontal_shader` averages along rows. Texels that the map does
    not cover are left out of the average: lookups treat them as if they lay at the receiver. A technique with several
    layers of `filtered_map` per layer of the map writes `layers_per_step` of them at once, to `filtered_map`,
    `filtered_map_1` and so on.

    Columns come first, because a band of rows then depends on no other band: the intermediate textures have only a
    quarter of the map's size.
    """

    vertical_shader: ClassVar[str]
    horizontal_shader: ClassVar[str] = "filtered_map_horizontal.frag"
    texel_format: ClassVar[str] = "rg32f"
    layers_per_step: ClassVar[int] = 1

    filtered_map = Internal(
        kind="texture2d_array",
        format=lambda node, facts: node.texel_format,
        size="shadow_map",
        layers=lambda node, facts: map_layers(node, facts) * node.layers_per_map_layer(),
    )
    coverage = Internal(
        kind="texture2d_array",
        format="r16",
        size="shadow_map",
        layers=map_layers,
        view="shadow_map",
        lights="shadow_map",
    )
    filtered_columns = Internal(
        kind="texture2d_array",
        format=lambda node, facts: node.texel_format,
        size=band_size,
        layers=lambda node, facts: min(node.layers_per_step, node.layers_per_map_layer()),
    )
    coverage_columns = Internal(format="r16", size=band_size)

    radius: int = param(
        default=2,
        unit="texels",
        min=0,
        max=64,
        doc="Radius of the filter: 2 averages 5×5 texels, as many as 4×4 taps of PCF read.",
    )

    def layers_per_map_layer(self) -> int:
        """Return the number of layers of `filtered_map` per layer of the shadow map."""
        return 1

    def record(self, steps: Steps) -> None:
        """Record the column filter, then the row filter, for each band and layer, with shared intermediate textures."""
        coverage, band = steps.desc(self.coverage), steps.desc(self.coverage_columns)
        for layer in range(coverage.layers):
            for first in range(0, self.layers_per_map_layer(), self.layers_per_step):
                for row in range(0, coverage.height, band.height):
                    self._band(
                        steps, layer, range(first, min(first + self.layers_per_step, self.layers_per_map_layer())), row
                    )
        super().record(steps)

    def _band(self, steps: Steps, layer: int, parts: range, first_row: int) -> None:
        band = steps.desc(self.coverage_columns)
        targets: dict[str, Port | Part] = {
            f"filtered_map_{i}" if i else "filtered_map": self.filtered_columns.layer(i) for i in range(len(parts))
        }
        if parts[0] == 0:
            targets["coverage"] = self.coverage_columns
        steps.fullscreen(
            self.vertical_shader,
            out=targets,
            shadow_map=self.shadow_map.layer(layer).sampled(),
            first_row=first_row,
            defines={"LAYER": layer, "FIRST_PART": parts[0], "PARTS": len(parts)},
        )
        for i, part in enumerate(parts):
            filtered_columns: dict[str, Any] = {"filtered_columns": self.filtered_columns.layer(i).sampled()}
            rows: dict[str, Port | Part] = {
                "filtered_map": self.filtered_map.layer(layer * self.layers_per_map_layer() + part)
            }
            if part == 0:
                filtered_columns["coverage_columns"], rows["coverage"] = (
                    self.coverage_columns,
                    self.coverage.layer(layer),
                )
            state = State(scissor=(0, first_row, band.width, band.height))
            steps.fullscreen(self.horizontal_shader, out=rows, state=state, first_row=first_row, **filtered_columns)


def filtered_lookup(shader: str) -> Function:
    """Return the function of a technique that reads the filtered map with bilinear filtering."""
    reads = (FilteredMap.filtered_map.sampled("linear"), FilteredMap.coverage.sampled("linear"))
    return Function(ShadowLookup, shader, reads=reads, doc="Visibility, for shaders to call.")
