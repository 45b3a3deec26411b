"""Base of the shadow-map techniques: both forms of their result, and the offset against self-shadowing."""

from __future__ import annotations

from typing import ClassVar

from rendergraph.api import Depth, Facts, Function, Input, Node, Output, ShadowMap, Steps, Visibility, param


def shadowed_lights(facts: Facts) -> tuple[int, ...]:
    """Return the lights of the connected shadow map, each once, in order of layers."""
    return tuple(dict.fromkeys(facts.input("shadow_map").lights)) if facts.connected("shadow_map") else ()


def map_layers(node: Node, facts: Facts) -> int:
    """Return the number of layers of the connected shadow map."""
    desc = facts.input("shadow_map").desc if facts.connected("shadow_map") else None
    return desc.layers if desc is not None else 0


class MapTechnique(Node):
    """Base of the shadow-map techniques.

    A technique declares `lookup`, a `Function` with its own include and the ports that the include reads. The include
    defines `map_visibility` and `MAP_HALF_WIDTH` and ends with `#include "map_shadow.glsl"`, which defines `shadow()`.
    Its `record` first records steps that prepare internal textures, then calls `super().record(steps)`.
    """

    twin = "traced_shadows"

    shadow_map = Input(ShadowMap, kind="texture2d_array", size="any", compare=True, doc="Depth from the lights.")
    depth = Input(Depth, optional=True, doc="Depth of the picture, for `visibility`.")
    lookup: ClassVar[Function]
    visibility = Output(
        Visibility,
        kind="texture2d_array",
        format="r16",
        layers=lambda node, facts: len(node.shadowed(facts)),
        lights=lambda node, facts: node.shadowed(facts),
        needs=("depth",),
        doc="1 is lit, 0 in shadow; one layer per light.",
    )

    bias: float = param(default=0.5, unit="texels", min=0, max=64, doc="Offset of the receiver towards the light.")
    normal_offset: float = param(
        default=1.0,
        min=0,
        max=64,
        doc="Scale of the offset along the normal; 1 is just enough for a plane at any slope.",
    )

    def shadowed(self, facts: Facts) -> tuple[int, ...]:
        """Return the lights that the node shadows, as the scene's indices."""
        return shadowed_lights(facts)

    def record(self, steps: Steps) -> None:
        """Record the evaluation of the function at every pixel, if `visibility` is used."""
        if not steps.used(self.visibility):
            return
        for layer, light in enumerate(self.shadowed(steps.facts)):
            steps.fullscreen(
                "map_visibility.frag",
                out={"visibility": self.visibility.layer(layer)},
                depth=self.depth,
                shadow=self.lookup,
                defines={"LIGHT": light},
            )
