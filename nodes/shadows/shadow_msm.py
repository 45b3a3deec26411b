"""Moment shadow maps."""

from __future__ import annotations

from typing import ClassVar

from rendergraph.api import param

from ._filtered_map import FilteredMap, filtered_lookup


class ShadowMSM(FilteredMap):
    """Shadows from the means of four powers of depth (Peters and Klein 2015).

    Two moments of `shadow_vsm` bound what lies before a receiver, and bleed light where casters lie over one another;
    four bound it more closely. The bound is the least that any distribution with these means has there, so surfaces
    are never darker than right, and never shadow themselves.
    """

    down: ClassVar[str] = "shadow_msm_down.frag"
    texel: ClassVar[str] = "rgba32f"

    lookup = filtered_lookup("shadow_msm.glsl")

    moment_bias: float = param(
        default=3e-5,
        min=1e-7,
        max=0.1,
        doc="How far the means are moved from those of one surface, which float cannot hold.",
    )
    light_bleeding: float = param(
        default=0.02,
        min=0,
        max=0.9,
        doc="Visibility up to this becomes 0, what is above is stretched to reach 1 again.",
    )
