"""Lights and the frusta of their shadow maps, as lines over the picture."""

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

_ICON_LINES = 96
_FRUSTUM_LINES = 12


class ShowLights(Node):
    """Show icons of the lights and the frusta of a shadow map's views, as lines over a finished picture.

    A point light is a ball, a spot light is a disc with its cones, and a directional light, which has no position, is a
    disc with rays beside the scene. Icons have the colour of their light, and frusta that of their layer as in
    `show_shadow_map`. Hidden lines are drawn faintly.
    """

    depth = Input(Depth, use="depth_test", doc="Depth of the opaque surfaces, seen by the pipeline's camera.")
    shadow_map = Input(
        ShadowMap,
        kind="texture2d_array",
        size="any",
        optional=True,
        doc="Shadow map whose views are drawn, one frustum per layer.",
    )
    color = InOut(DisplayColor, doc="The picture.")
    bounds = Internal(kind="buffer", bytes=32)

    icons: bool = structural(default=True, doc="Draw icons of the lights; otherwise only frusta.")
    ranges: bool = define(default=False, doc="Draw the range of point lights as a ball.")
    size: float = param(default=0.04, min=0, max=1, doc="Size of icons, as a fraction of the scene's extent.")
    width: float = param(default=1.5, min=0.5, max=16, unit="pixels", doc="Line width.")
    through: float = param(default=0.25, min=0, max=1, doc="Opacity of hidden lines.")

    def record(self, steps: Steps) -> None:
        """Record visible lines, then hidden ones."""
        drawn: list[tuple[str, str, int, int, dict[str, Any]]] = []
        if self.icons and steps.lights:
            drawn.append(("icons", "light_icons.vert", _ICON_LINES, len(steps.lights), {"bounds": self.bounds}))
        if steps.connected(self.shadow_map) and (layers := steps.desc(self.shadow_map).layers):
            drawn.append(("frusta", "light_frusta.vert", _FRUSTUM_LINES, layers, {"shadow_map": self.shadow_map}))
        for kind, vertex, lines, instances, reads in drawn:
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
                    label=f"{kind}, {'hidden' if hidden else 'visible'}",
                    depth=self.depth,
                    **reads,
                )

    def update(self, frame: Frame) -> None:
        """Upload the scene's centre and half its extent, which place directional lights and scale icons."""
        low, high = np.asarray(frame.scene.bounds, np.float64)
        values = np.zeros((2, 4), np.float32)
        values[0, :3], values[0, 3] = (low + high) / 2, np.linalg.norm(high - low) / 2
        frame.write(self.bounds, values)
