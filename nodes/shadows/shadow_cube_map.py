"""Shadows of a point light from a depth cube map."""

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

from ._light_views import distance_range, receiving_box
from ._map_technique import MapTechnique

_FACES = ((0, 1, 2, -1), (0, -1, 2, 1), (1, 1, 0, 1), (1, -1, 0, 1), (2, 1, 0, 1), (2, -1, 0, -1))
"""For each face of a cube map: the axis of its direction and its sign, the axis to its right and its sign."""


def point_lights(node: ShadowCubeMap, facts: Facts) -> tuple[int, ...]:
    """Return the index of the first point light that the node's `light` selects, if there is one."""
    if node.light == "auto":
        return tuple(n for n, one in enumerate(facts.lights) if one.type == "point" and one.casts_shadow)[:1]
    return tuple(n for n in facts.casting(node.light) if facts.lights[n].type == "point")[:1]


class ShadowCubeMap(MapTechnique):
    """Shadow one point light by a depth cube map, drawn in one pass and looked up by direction (Gerasimov 2004).

    The sampler selects the face and filters across face borders, so the faces need no margin. That is the only
    advantage over the six layers of `shadow_cube`. The map holds a single light, the filtered techniques cannot
    prefilter it, and each of them would need a separate lookup for it.
    """

    shadow_map = DROPPED
    views = Views(lights=lambda node, facts: point_lights(node, facts) * 6, public=False, doc="Views of the six faces.")
    cube = Internal(
        ShadowMap,
        kind="texture_cube",
        format="depth32f",
        view="views",
        clear=0.0,
        size=lambda node, facts: (node.resolution, node.resolution),
        doc="Window depth from the light, 0 on the background.",
    )
    lookup = Function(
        ShadowLookup,
        "shadow_cube_map.glsl",
        reads=(cube.sampled("linear", compare=True),),
        doc="Visibility, for shaders to call.",
    )

    light: str = structural(default="auto", doc="Name of a point light; `auto` is the first that casts shadows.")
    resolution: int = structural(default=1024, unit="texels", min=1, max=16384, doc="Side of each face.")
    taps: int = define(default=3, min=1, max=16, doc="Bilinearly weighted tests along a side; 1 is a hard shadow.")

    def shadowed(self, facts: Facts) -> tuple[int, ...]:
        """Return the light, as the scene's index."""
        return point_lights(self, facts)

    def record(self, steps: Steps) -> None:
        """Record one layered pass over the casters, as in `shadow_cube`."""
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
        """Set a view of 90° per face, in the order and orientation that samplers expect."""
        scene = frame.scene
        facts = Facts((1, 1), lights=tuple(scene.lights))
        for index in point_lights(self, facts):
            light = scene.lights[index]
            near, far = distance_range(light, receiving_box(scene, light))
            perspective = projection.perspective(math.pi / 2, 1.0, near, far)
            views = []
            for axis, sign, right_axis, right_sign in _FACES:
                matrix = projection.view_along(
                    sign * np.eye(3)[axis], right_sign * np.eye(3)[right_axis], light.position
                )
                views.append(
                    ViewMatrices(matrix, perspective, (self.resolution, self.resolution), near, far, light=index)
                )
            frame.set_views(self.views, views)
