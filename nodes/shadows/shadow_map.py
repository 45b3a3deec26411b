"""Shadow maps: depth rendered from lights."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from rendergraph.api import (
    Facts,
    Frame,
    Input,
    Output,
    ShadowMap,
    State,
    Steps,
    View,
    ViewMatrices,
    Views,
    casting_lights,
    structural,
)

from ._casting import Casting
from ._light_views import layer_lights, light_views


def _lights(node: ShadowMapNode, facts: Facts) -> tuple[int, ...]:
    return layer_lights(node.light, facts.lights, node.layers)


class ShadowMapNode(Casting):
    """Render depth from lights, the input of every shadow-map technique.

    A directional light has one layer. It is fitted to the visible part of the scene and to the casters, and extends
    towards the light to include everything that may cast a shadow into the picture. A spot light has one layer, fitted
    in the same way within its cone. A point light has six layers, the faces of a cube. Layers are in the scene's order
    of lights.
    """

    seen_from = Input(
        View,
        kind="view",
        optional=True,
        doc="View that the shadows are fitted to; the pipeline's camera by default.",
    )
    views = Views(lights=_lights, doc="Views of the lights, one per layer.")
    shadow_map = Output(
        ShadowMap,
        kind="texture2d_array",
        format="depth32f",
        view="views",
        clear=0.0,
        size=lambda node, facts: (node.resolution, node.resolution),
        doc="Window depth from each light, 0 on the background.",
    )

    resolution: int = structural(default=2048, unit="texels", min=1, max=16384, doc="Side of each layer.")
    slope_bias: float = structural(
        default=0.0,
        unit="texels",
        min=0,
        max=64,
        doc="Slope-scaled polygon offset; the techniques have a separate offset.",
    )

    def record(self, steps: Steps) -> None:
        """Record one pass per layer over the casters, without face culling, because open meshes cast shadows, too.

        Back faces of closed meshes are culled for directional lights; other lights may lie inside a mesh.
        """
        offset = (-self.slope_bias, 0.0) if self.slope_bias else None
        for layer, light in enumerate(_lights(self, steps.facts)):
            is_directional = steps.lights[light].type == "directional"
            steps.geometry(
                "<depth.frag>",
                vertex="<depth.vert>",
                out=self.shadow_map.layer(layer),
                view=self.views,
                view_index=layer,
                objects="casters",
                materials="alpha",
                state=State(cull="solid" if is_directional else "none", polygon_offset=offset),
            )

    def update(self, frame: Frame) -> None:
        """Fit the views to the current lights and camera."""
        lights = frame.scene.lights
        frame.set_views(
            self.views,
            [
                replace(view, light=index)
                for index in casting_lights(self.light, lights)
                for view in self.light_views(lights[index], frame)
            ],
        )

    def layers(self, kind: str) -> int:
        """Return the number of layers of a kind of light."""
        return 6 if kind == "point" else 1

    def light_views(self, light: Any, frame: Frame) -> Sequence[ViewMatrices]:
        """Return the views of one light, one per layer."""
        return light_views(light, frame.scene, self.eye(frame), self.resolution)

    def eye(self, frame: Frame) -> ViewMatrices:
        """Return the view that the shadows are fitted to."""
        return next(iter(frame.views(self.seen_from)), frame.camera)
