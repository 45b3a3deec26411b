"""Depth as lights see it."""

from __future__ import annotations

from rendergraph.api import Facts, Frame, Node, Output, ShadowMap, State, Steps, Views, structural

from ._light_views import layer_lights, light_views


def _lights(node: ShadowMapNode, facts: Facts) -> tuple[int, ...]:
    return layer_lights(node.light, facts.lights)


class ShadowMapNode(Node):
    """Depth seen from lights: what every shadow-map technique starts from.

    A directional light's layer is fitted to what the camera can see of the scene and to what casts, and reaches back
    along the light to everything that may cast into the picture; a spot light's is its cone; a point light has six
    layers, the faces of a cube. The layers stand in the scene's order of lights.
    """

    views = Views(lights=_lights, doc="The lights' views, one a layer.")
    shadow_map = Output(
        ShadowMap,
        kind="texture2d_array",
        format="depth32f",
        view="views",
        clear=1.0,
        size=lambda node, facts: (node.resolution, node.resolution),
        doc="Window depth from each light, 1 where nothing is.",
    )

    light: str | tuple[str, ...] = structural(
        default="auto",
        doc="Lights that cast: names, or of those whose `casts_shadow` the scene does not switch off `all`, or `auto`: "
        "the first directional, else the first spot light.",
    )
    resolution: int = structural(default=2048, unit="texels", min=1, max=16384, doc="Side of each layer.")
    slope_bias: float = structural(
        default=0.0, unit="texels", min=0, max=64, doc="Polygon offset by slope; readers have an offset of their own."
    )

    def record(self, steps: Steps) -> None:
        """One pass a layer over what casts; back faces of single-sided materials are left out."""
        offset = (self.slope_bias, 0.0) if self.slope_bias else None
        for layer in range(steps.desc(self.shadow_map).layers):
            steps.geometry(
                "<depth.frag>",
                vertex="<depth.vert>",
                out=self.shadow_map.layer(layer),
                view=self.views,
                view_index=layer,
                objects="casters",
                materials="alpha",
                state=State(polygon_offset=offset),
            )

    def update(self, frame: Frame) -> None:
        """Fit the views to where the lights and the camera are now."""
        table = layer_lights(self.light, frame.scene.lights)
        frame.set_views(self.views, light_views(table, frame.scene, frame.camera, self.resolution))
