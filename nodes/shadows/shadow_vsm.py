"""Variance shadow maps."""

from __future__ import annotations

from typing import ClassVar

from rendergraph.api import param

from ._filtered_map import FilteredMap, filtered_lookup


class ShadowVSM(FilteredMap):
    """Bound the shadow by mean and variance of depth (Donnelly and Lauritzen 2006).

    Depth and squared depth are averaged once per frame, however many pixels look them up. For a receiver at depth t
    behind the mean, the fraction of the filter region that does not occlude it is at most
    `variance / (variance + (t - mean)²)` (one-sided Chebyshev inequality), and this bound is used as the visibility. It
    is exact for a planar caster over a planar receiver. Where shadows of several casters overlap it is too high, and
    light bleeds into the lower shadow; `light_bleeding` removes that, and darkens all penumbrae a little.
    """

    vertical_shader: ClassVar[str] = "shadow_vsm_vertical.frag"

    lookup = filtered_lookup("shadow_vsm.glsl")

    min_variance: float = param(
        default=1e-6, min=0, max=1, doc="Minimum variance; depth is 0 to 1 over the range of the light's view."
    )
    light_bleeding: float = param(
        default=0.1,
        min=0,
        max=0.99,
        doc="Visibility up to this value becomes 0; the range above is rescaled to 0 to 1.",
    )
