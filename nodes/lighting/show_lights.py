"""Lights and what their shadow maps see, as lines over the picture."""

from __future__ import annotations

from typing import Any

import numpy as np

from rendergraph.api import (
    ALPHA,
    Depth,
    DisplayColor,
    Frame,
    InOut,
    Input,
    Internal,
    Node,
    ShadowMap,
    State,
    Steps,
    define,
    param,
    structural,
)

_ICON_LINES = 96  # of a light's sign, and
_FRUSTUM_LINES = 12


class ShowLights(Node):
    """Where the lights are, and the frusta of a shadow map's views, as lines over a finished picture.

    A point light is a ball, a spot light the cones of its light with a disc, and a directional light, which is nowhere,
    a disc with rays beside the scene. Each has its light's colour, each frustum that of its layer, as `show_shadow_map`
    has it. Lines behind something shine through faintly.
    """

    depth = Input(Depth, use="depth_test", doc="Depth of the opaque surfaces, seen by the pipeline's camera.")
    shadow_map = Input(
        ShadowMap, kind="texture2d_array", size="any", optional=True, doc="Whose views are drawn, a frustum a layer."
    )
    color = InOut(DisplayColor, doc="The picture.")
    bounds = Internal(kind="buffer", bytes=32)

    icons: bool = structural(default=True, doc="Signs for the lights; without them frusta alone.")
    ranges: bool = define(default=False, doc="The ball that a point light's range is, too.")
    size: float = param(default=0.04, min=0, max=1, doc="Of a light's sign, as a share of the scene's extent.")
    width: float = param(default=1.5, min=0.5, max=16, unit="pixels", doc="Of the lines.")
    through: float = param(default=0.25, min=0, max=1, doc="Opacity of lines that are behind something.")

    def record(self, steps: Steps) -> None:
        """Lines in front of everything, then those behind."""
        drawn: list[tuple[str, str, int, int, dict[str, Any]]] = []
        if self.icons and steps.lights:
            drawn.append(("icons", "light_icons.vert", _ICON_LINES, len(steps.lights), {"bounds": self.bounds}))
        if steps.connected(self.shadow_map) and (layers := steps.desc(self.shadow_map).layers):
            drawn.append(("frusta", "light_frusta.vert", _FRUSTUM_LINES, layers, {"shadow_map": self.shadow_map}))
        for what, vertex, lines, instances, reads in drawn:
            for hidden in (False, True):
                steps.draw(
                    "wide_lines.frag",
                    vertex=vertex,
                    geometry="wide_lines.geom",
                    vertices=2 * lines,
                    instances=instances,
                    topology="lines",
                    out=self.color,
                    view=self.depth,
                    state=State(depth_func="less" if hidden else "gequal", depth_write=False, cull="none", blend=ALPHA),
                    defines={"HIDDEN": int(hidden)},
                    label=f"{what}, {'hidden' if hidden else 'seen'}",
                    depth=self.depth,
                    **reads,
                )

    def update(self, frame: Frame) -> None:
        """The scene's middle and half its extent: where a light stands that is nowhere, and how large signs are."""
        low, high = np.asarray(frame.scene.bounds, np.float64)
        values = np.zeros((2, 4), np.float32)
        values[0, :3], values[0, 3] = (low + high) / 2, np.linalg.norm(high - low) / 2
        frame.write(self.bounds, values)
