"""Variance shadow maps."""

from __future__ import annotations

from typing import ClassVar

from rendergraph.api import param

from ._filtered_map import FilteredMap, filtered_lookup


class ShadowVSM(FilteredMap):
    """Shadows from the mean and the variance of depth (Donnelly and Lauritzen 2006).

    Depth is squared and both are averaged once a frame, however many pixels look them up; the share of the filter that
    lets light through is then at most `variance / (variance + (t - mean)²)` for a receiver at t behind the mean
    (Chebyshev's inequality, one-sided), and that bound is the answer. It is exact for one flat caster over one flat
    receiver. Where casters lie over one another it is too high, and light bleeds into the lower shadow;
    `light_bleeding` cuts that off, and darkens all penumbrae a little.
    """

    down: ClassVar[str] = "shadow_vsm_down.frag"

    lookup = filtered_lookup("shadow_vsm.glsl")

    min_variance: float = param(
        default=1e-6, min=0, max=1, doc="Least variance, depth being 0 to 1 over the range of the light's view."
    )
    light_bleeding: float = param(
        default=0.1,
        min=0,
        max=0.99,
        doc="Visibility up to this becomes 0, what is above is stretched to reach 1 again.",
    )
