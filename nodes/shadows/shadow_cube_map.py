"""Shadows of a point light from a true cube map."""

from __future__ import annotations

import math

import numpy as np

from rendergraph.api import (
    DROPPED,
    Facts,
    Frame,
    Function,
    Internal,
    ShadowLookup,
    ShadowMap,
    State,
    Steps,
    ViewMatrices,
    Views,
    define,
    projection,
    structural,
)

from ._light_views import reach
from ._map_technique import MapTechnique

_FACES = ((0, 1, 2, -1), (0, -1, 2, 1), (1, 1, 0, 1), (1, -1, 0, 1), (2, 1, 0, 1), (2, -1, 0, -1))
"""Of each face of a cube map the axis it looks along and its sign, the axis to its right and its sign."""


def point_lights(node: ShadowCubeMap, facts: Facts) -> tuple[int, ...]:
    """The first point light that the node's `light` means, as the scene's index; none where there is none."""
    if node.light == "auto":
        return tuple(n for n, one in enumerate(facts.lights) if one.type == "point" and one.casts_shadow)[:1]
    return tuple(n for n in facts.casting(node.light) if facts.lights[n].type == "point")[:1]


class ShadowCubeMap(MapTechnique):
    """Shadows of one point light by a cube map of depth, drawn in one pass and looked up by direction (Gerasimov 2004).

    Nobody chooses a face: the sampler does, and filters from one face to the next, so that faces need no margin. That
    is the map's only advantage over `shadow_cube`'s six layers. It holds one light, its texels cannot be averaged
    beforehand by any of the filters, and every technique would need a lookup of its own for it.
    """

    shadow_map = DROPPED
    views = Views(lights=lambda node, facts: point_lights(node, facts) * 6, public=False, doc="The faces'.")
    cube = Internal(
        ShadowMap,
        kind="texture_cube",
        format="depth32f",
        view="views",
        clear=0.0,
        size=lambda node, facts: (node.resolution, node.resolution),
        doc="Window depth from the light, 0 where nothing is.",
    )
    lookup = Function(
        ShadowLookup,
        "shadow_cube_map.glsl",
        reads=(cube.sampled("linear", compare=True),),
        doc="Visibility, for shaders to call.",
    )

    light: str = structural(default="auto", doc="A point light's name; `auto` is the first that casts.")
    resolution: int = structural(default=1024, unit="texels", min=1, max=16384, doc="Side of each face.")
    taps: int = define(default=3, min=1, max=16, doc="Tests along a side, weighted bilinearly; 1 is the hard shadow.")

    def shadowed(self, facts: Facts) -> tuple[int, ...]:
        """The light it knows."""
        return point_lights(self, facts)

    def record(self, steps: Steps) -> None:
        """One layered pass over what casts, as `shadow_cube` has it."""
        if self.shadowed(steps.facts):
            steps.geometry(
                "<depth.frag>",
                vertex="shadow_cube.vert",
                geometry="shadow_cube.geom",
                out=self.cube,
                view=self.views,
                view_index=None,
                in_place=True,
                objects="casters",
                materials="alpha",
                state=State(cull="none"),
            )
        super().record(steps)

    def update(self, frame: Frame) -> None:
        """A view of 90° a face, in the order and with the axes that samplers know."""
        scene = frame.scene
        facts = Facts((1, 1), lights=tuple(scene.lights))
        for index in point_lights(self, facts):
            light = scene.lights[index]
            near, far = reach(light, np.asarray(scene.bounds, np.float64))
            perspective = projection.perspective(math.pi / 2, 1.0, near, far)
            views = []
            for along, sign, right, turn in _FACES:
                matrix = projection.view_along(sign * np.eye(3)[along], turn * np.eye(3)[right], light.position)
                views.append(
                    ViewMatrices(matrix, perspective, (self.resolution, self.resolution), near, far, light=index)
                )
            frame.set_views(self.views, views)
