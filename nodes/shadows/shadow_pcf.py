"""Shadow maps with percentage-closer filtering."""

from __future__ import annotations

from rendergraph.api import Function, ShadowLookup, define

from ._map_technique import MapTechnique


class ShadowPCF(MapTechnique):
    """Shadows from a map by percentage-closer filtering.

    The mean of N×N depth tests one texel apart, each weighted bilinearly (Reeves, Salesin and Cook 1987): soft by about
    N texels, whatever the distance of the caster. With one tap the plain hard shadow of a single test.
    """

    lookup = Function(ShadowLookup, "shadow_pcf.glsl", reads=("shadow_map",), doc="Visibility, for shaders to call.")

    taps: int = define(default=3, min=1, max=16, doc="Tests along a side: 4 means 4×4, 1 is the plain hard shadow.")
