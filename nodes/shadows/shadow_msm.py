"""Moment shadow maps."""

from __future__ import annotations

from typing import ClassVar

from rendergraph.api import param

from ._filtered_map import FilteredMap, filtered_lookup


class ShadowMSM(FilteredMap):
    """Bound the shadow by four moments of depth (Peters and Klein 2015).

    The two moments of `shadow_vsm` bound the shadow only loosely, so light bleeds where the shadows of several casters
    overlap. Four moments give a tighter bound. It is a lower bound of the shadow: surfaces are never too dark and never
    shadow themselves.
    """

    vertical_shader: ClassVar[str] = "shadow_msm_vertical.frag"
    texel_format: ClassVar[str] = "rgba32f"

    lookup = filtered_lookup("shadow_msm.glsl")

    moment_bias: float = param(
        default=1e-6,
        min=1e-7,
        max=0.1,
        doc="How far the moments are moved towards those of a uniform distribution, to counter rounding errors.",
    )
    light_bleeding: float = param(
        default=0.02,
        min=0,
        max=0.9,
        doc="Visibility up to this value becomes 0; the range above is rescaled to 0 to 1.",
    )
