"""Soft shadows of lights that have a size."""

from __future__ import annotations

from rendergraph.api import Function, Input, ShadowLookup, ShadowMap, define, param

from ._map_technique import MapTechnique


class ShadowPCSS(MapTechnique):
    """Shadows that are hard where things touch and softer the farther a caster is (Fernando 2005).

    What is in the way within the cone to the light is looked for in the map, its mean distance gives the width of the
    penumbra, and so wide a disc of depth tests is averaged. The discs are turned at every pixel, which makes noise of
    what would be bands, and each test is made against the receiver's own plane, so that a wide disc does not find the
    surface itself. With a size of 0 it is the hard shadow.
    """

    shadow_map = Input(ShadowMap, kind="texture2d_array", size="any", doc="Depth as the lights see it.")
    lookup = Function(ShadowLookup, "shadow_pcss.glsl", reads=("shadow_map",), doc="Visibility, for shaders to call.")

    size: float = param(default=0.2, unit="m", min=0, max=100, doc="Width of point and spot lights.")
    angle: float = param(
        default=0.05,
        unit="rad",
        min=0,
        max=1.5,
        doc="Width of directional lights as seen from the scene; the sun's is 0.0093.",
    )
    max_radius: float = param(default=48.0, unit="texels", min=0, max=512, doc="The widest disc that is looked at.")
    searches: int = define(default=24, min=1, max=64, doc="Points at which casters are looked for.")
    samples: int = define(default=32, min=1, max=64, doc="Depth tests of the filter.")
