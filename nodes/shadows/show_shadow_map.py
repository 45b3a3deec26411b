"""Visualisation of a shadow map on the surfaces of the scene."""

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
    """Show a shadow map over a finished picture, projected onto the scene: its texels, layers or depth.

    Surfaces are tinted by the layer that a lookup uses, blended where two layers overlap. Surfaces outside the light's
    map are unchanged. Texels are a checkerboard; shadow edges have visible steps where its squares are larger than
    pixels.
    """

    shadow_map = Input(ShadowMap, kind="texture2d_array", size="any", doc="Depth from the lights.")
    depth = Input(Depth, samples="any", doc="Depth of the picture.")
    color = InOut(DisplayColor, doc="The picture.")

    light: str = structural(default="auto", doc="Light whose map is shown; `auto` is the first of the map.")
    shown: Literal["texels", "layers", "both", "depth"] = define(
        default="both",
        doc="Texels as squares, a colour per layer, both, or the depth in the map, with near depths dark.",
    )
    opacity: float = param(default=0.4, min=0, max=1, doc="Opacity of the overlay.")
    texels: int = param(default=8, min=1, max=1024, unit="texels", doc="Texels along a side of a square.")

    def record(self, steps: Steps) -> None:
        """Record one step over the picture."""
        map_lights = steps.facts.input("shadow_map").lights
        if self.light == "auto":
            shown = map_lights[:1]
        else:
            shown = tuple(index for index in steps.facts.casting(self.light) if index in map_lights)
            if not shown:
                raise SceneError(f"light '{self.light}' has no shadow map here", self.light)
        if shown:
            steps.fullscreen(
                "show_shadow_map.frag",
                out=self.color,
                state=State(blend=ALPHA),
                defines={"LIGHT": shown[0]},
                shadow_map=self.shadow_map,
                depth=self.depth,
                bias=0.0,
                normal_offset=0.0,
            )
