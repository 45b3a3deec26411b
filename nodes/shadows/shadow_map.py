"""Depth as lights see it."""

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
    """Depth seen from lights: what every shadow-map technique starts from.

    A directional light's layer is fitted to what the camera can see of the scene and to what casts, and reaches back
    along the light to everything that may cast into the picture; a spot light's is fitted alike within its cone; a
    point light has six layers, the faces of a cube. The layers stand in the scene's order of lights.
    """

    seen_from = Input(
        View,
        kind="view",
        optional=True,
        doc="The view whose picture the shadows are for; the pipeline's camera by default.",
    )
    views = Views(lights=_lights, doc="The lights' views, one a layer.")
    shadow_map = Output(
        ShadowMap,
        kind="texture2d_array",
        format="depth32f",
        view="views",
        clear=0.0,
        size=lambda node, facts: (node.resolution, node.resolution),
        doc="Window depth from each light, 0 where nothing is.",
    )

    resolution: int = structural(default=2048, unit="texels", min=1, max=16384, doc="Side of each layer.")
    slope_bias: float = structural(
        default=0.0, unit="texels", min=0, max=64, doc="Polygon offset by slope; readers have an offset of their own."
    )

    def record(self, steps: Steps) -> None:
        """One pass a layer over what casts, from both sides: what has no back is in the light's way all the same.

        Of solid things the sun sees front faces alone; other lights may stand within them.
        """
        offset = (-self.slope_bias, 0.0) if self.slope_bias else None
        for layer, light in enumerate(_lights(self, steps.facts)):
            sun = steps.lights[light].type == "directional"
            steps.geometry(
                "<depth.frag>",
                vertex="<depth.vert>",
                out=self.shadow_map.layer(layer),
                view=self.views,
                view_index=layer,
                objects="casters",
                materials="alpha",
                state=State(cull="solid" if sun else "none", polygon_offset=offset),
            )

    def update(self, frame: Frame) -> None:
        """Fit the views to where the lights and the eye are now."""
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
        """How many layers a light of a kind has."""
        return 6 if kind == "point" else 1

    def light_views(self, light: Any, frame: Frame) -> Sequence[ViewMatrices]:
        """The views of one light, as many as `layers` says."""
        return light_views(light, frame.scene, self.eye(frame), self.resolution)

    def eye(self, frame: Frame) -> ViewMatrices:
        """The view that the shadows are for."""
        return next(iter(frame.views(self.seen_from)), frame.camera)
