"""Shadows by rays to the lights."""

from __future__ import annotations

from typing import Any

import numpy as np

from rendergraph.api import (
    ADD,
    Depth,
    Facts,
    Function,
    Input,
    Internal,
    Output,
    SceneData,
    ShadowLookup,
    ShadowMap,
    State,
    Steps,
    Visibility,
    define,
    param,
    structural,
)
from rendergraph.api import Any as AnyTexel

from ._casting import Casting

_MOST_RAYS = 128  # per pixel and step: drivers limit the duration of a step, and llvmpipe the iterations of its loops


def _light_texels(node: Any, facts: Facts) -> tuple[int, int]:
    return max(1, len(facts.lights)), 1


class TracedShadows(Casting):
    """Trace rays to the lights: exact shadows of all casters.

    A light without a size takes one ray per pixel and casts hard shadows. A light with a size is a disc that faces the
    point, with diameter `size` for point and spot lights and angular diameter `angle` for directional ones; visibility
    is the mean over `samples` rays to points on the disc. It includes what shadow maps miss: thin gaps, contact
    shadows, any number of lights, casters outside the picture, alpha masks. Rays see the scene as uploaded, so vertices
    that a plugin's shader moves cast shadows from their original positions.

    It is the twin of all shadow-map techniques and replaces them with `-s shadows.type=traced_shadows`. If a shadow map
    is connected, it only selects the lights; the map itself is not rendered.
    """

    scene = Input(SceneData, rays=True, doc="The scene.")
    shadow_map = Input(
        ShadowMap,
        kind="texture2d_array",
        size="any",
        optional=True,
        doc="Selects the lights; the map itself is not rendered.",
    )
    depth = Input(Depth, optional=True, doc="Depth of the picture, for `visibility`.")
    casters = Internal(AnyTexel, format="r8", size=_light_texels, kept=True)
    lookup = Function(
        ShadowLookup, "traced_shadows.glsl", reads=("scene", "casters"), doc="Visibility, for shaders to call."
    )
    visibility = Output(
        Visibility,
        kind="texture2d_array",
        format="r16",
        layers=lambda node, facts: len(node.lights(facts)),
        lights=lambda node, facts: node.lights(facts),
        needs=("depth",),
        doc="1 is lit, 0 in shadow; one layer per light.",
    )

    light: str | tuple[str, ...] = structural(
        default="all",
        doc="Lights that cast, unless a shadow map selects them: names, `all` without `casts_shadow: false`, or "
        "`auto`, the first of these.",
    )
    size: float = param(
        default=0.0, unit="m", min=0, max=100, doc="Diameter of point and spot lights; 0: hard shadows."
    )
    angle: float = param(
        default=0.0,
        unit="rad",
        min=0,
        max=1.5,
        doc="Angular diameter of directional lights; 0: hard shadows. The sun's is 0.0093.",
    )
    samples: int = define(default=16, min=1, max=1024, doc="Rays per pixel to a light that has a size.")
    animated: bool = define(default=True, doc="Trace different rays in each frame, to be averaged over frames.")

    def lights(self, facts: Facts) -> tuple[int, ...]:
        """Return the lights whose shadows are traced, as the scene's indices."""
        shadow_map = self.shadow_map.name
        if facts.connected(shadow_map):
            return tuple(dict.fromkeys(facts.input(shadow_map).lights))
        return super().lights(facts)

    def record(self, steps: Steps) -> None:
        """Record which lights cast, and the rays of every pixel if `visibility` is used."""
        lights = self.lights(steps.facts)
        casters = np.zeros((1, max(1, len(steps.facts.lights)), 1), np.uint8)
        casters[0, list(lights), 0] = 255
        steps.upload(self.casters, casters)
        starts = range(0, self.samples, _MOST_RAYS)
        for layer, light in enumerate(lights) if steps.used(self.visibility) else ():
            for first in starts:
                rays = {"FIRST_RAY": first, "PAST_RAY": first + _MOST_RAYS} if len(starts) > 1 else {}
                steps.fullscreen(
                    "map_visibility.frag",
                    out={"visibility": self.visibility.layer(layer)},
                    state=State(blend=ADD) if first else State(),
                    depth=self.depth,
                    shadow=self.lookup,
                    defines={"LIGHT": light, **rays},
                )
