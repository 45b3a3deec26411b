"""A shadow map thrown back onto the scene, to look at."""

from __future__ import annotations

from typing import Literal

from rendergraph.api import (
    ALPHA,
    Depth,
    DisplayColor,
    InOut,
    Input,
    Node,
    SceneError,
    ShadowMap,
    State,
    Steps,
    define,
    param,
    structural,
)


class ShowShadowMap(Node):
    """A shadow map laid over a finished picture, where it lies in the scene: its texels, layers or depth.

    Surfaces are tinted as lookups find them: by the layer that a point is looked up in, blended where two layers are.
    What the light's map does not hold stays as it is. Texels are a chequered pattern, a square a texel: where squares
    are larger than pixels, shadows have steps.
    """

    shadow_map = Input(ShadowMap, kind="texture2d_array", size="any", doc="Depth as the lights see it.")
    depth = Input(Depth, samples="any", doc="Depth of the picture.")
    color = InOut(DisplayColor, doc="The picture.")

    light: str = structural(default="auto", doc="Whose map; `auto` is the first that the map holds.")
    shown: Literal["texels", "layers", "both", "depth"] = define(
        default="both",
        doc="Texels as squares, a colour for each layer, both, or the depth in the map, near ones dark.",
    )
    opacity: float = param(default=0.4, min=0, max=1, doc="Of what is laid over.")
    texels: int = param(default=8, min=1, max=1024, unit="texels", doc="Along a side of a square.")

    def record(self, steps: Steps) -> None:
        """One step over the picture."""
        held = steps.facts.input("shadow_map").lights
        if self.light == "auto":
            wanted = held[:1]
        else:
            wanted = tuple(index for index in steps.facts.casting(self.light) if index in held)
            if not wanted:
                raise SceneError(f"light '{self.light}' has no shadow map here", self.light)
        if wanted:
            steps.fullscreen(
                "show_shadow_map.frag",
                out=self.color,
                state=State(blend=ALPHA),
                defines={"LIGHT": wanted[0]},
                shadow_map=self.shadow_map,
                depth=self.depth,
                bias=0.0,
                normal_offset=0.0,
            )
