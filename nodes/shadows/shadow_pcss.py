"""Percentage-closer soft shadows."""

from __future__ import annotations

from rendergraph.api import Function, Input, ShadowLookup, ShadowMap, define, param

from ._map_technique import MapTechnique


class ShadowPCSS(MapTechnique):
    """Soften shadows with the distance from the caster: percentage-closer soft shadows (Fernando 2005).

    A blocker search in the map finds the mean distance of the casters between the receiver and the light, from which
    the width of the penumbra follows; then depth tests are averaged over a disc of that width. The discs are rotated
    per pixel, which turns banding into noise. Each test uses the depth of the receiver's plane at its position, so that
    a wide disc does not shadow the surface itself. With a size of 0 it is a hard shadow.
    """

    shadow_map = Input(ShadowMap, kind="texture2d_array", size="any", doc="Depth from the lights.")
    lookup = Function(ShadowLookup, "shadow_pcss.glsl", reads=("shadow_map",), doc="Visibility, for shaders to call.")

    size: float = param(default=0.2, unit="m", min=0, max=100, doc="Diameter of point and spot lights.")
    angle: float = param(
        default=0.05,
        unit="rad",
        min=0,
        max=1.5,
        doc="Angular diameter of directional lights; the sun's is 0.0093.",
    )
    max_radius: float = param(default=48.0, unit="texels", min=0, max=512, doc="Maximum radius of search and filter.")
    searches: int = define(default=24, min=1, max=64, doc="Samples of the blocker search.")
    samples: int = define(default=32, min=1, max=64, doc="Depth tests of the filter.")
