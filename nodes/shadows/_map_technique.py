"""What every shadow-map technique shares: both forms of its result, and the offset against self-shadowing."""

from __future__ import annotations

from typing import ClassVar

from rendergraph.api import Depth, Facts, Function, Input, Node, Output, ShadowMap, Steps, Visibility, param


def shadowed_lights(facts: Facts) -> tuple[int, ...]:
    """The lights a connected shadow map knows, each once, in its order."""
    return tuple(dict.fromkeys(facts.input("shadow_map").lights)) if facts.connected("shadow_map") else ()


def map_layers(node: Node, facts: Facts) -> int:
    """How many layers a connected shadow map has."""
    desc = facts.input("shadow_map").desc if facts.connected("shadow_map") else None
    return desc.layers if desc is not None else 0


class MapTechnique(Node):
    """Base of the techniques that read a shadow map.

    A technique declares `lookup`, a `Function` of its own include, and what that reads. Its include defines
    `map_visibility` and `MAP_HALF_WIDTH` and ends with `#include "map_shadow.glsl"`, which makes `shadow()` of them.
    `record` steps that prepare internal textures come first, then `super().record(steps)`.
    """

    shadow_map = Input(ShadowMap, kind="texture2d_array", size="any", compare=True, doc="Depth as the lights see it.")
    depth = Input(Depth, optional=True, doc="Depth of the picture, for `visibility`.")
    lookup: ClassVar[Function]
    visibility = Output(
        Visibility,
        kind="texture2d_array",
        format="r16",
        layers=lambda node, facts: len(node.shadowed(facts)),
        lights=lambda node, facts: node.shadowed(facts),
        needs=("depth",),
        doc="1 lit, 0 shadowed, one layer a light.",
    )

    bias: float = param(default=0.5, unit="texels", min=0, max=64, doc="How far a point is moved towards the light.")
    normal_offset: float = param(
        default=1.0,
        min=0,
        max=64,
        doc="How far a point is moved along its normal: 1 is just enough for a flat surface at any slope.",
    )

    def shadowed(self, facts: Facts) -> tuple[int, ...]:
        """The lights it knows, as the scene's indices."""
        return shadowed_lights(facts)

    def record(self, steps: Steps) -> None:
        """Evaluate the function at every pixel, where anybody looks at that."""
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
