"""Exponential shadow maps."""

from __future__ import annotations

from typing import ClassVar

from rendergraph.api import param

from ._filtered_map import FilteredMap, filtered_lookup


class ShadowESM(FilteredMap):
    """Shadows from the mean of an exponential of depth (Annen, Mertens, Seidel, Flerackers and Kautz 2008).

    The step of the depth test is replaced by `exp(exponent · (z - t))`, at most 1, for something at depth z before a
    receiver at t. It is a product of a part for each, so the map's part is filtered once a frame, in a single channel;
    what is kept is its logarithm (Salvi 2008), so that neither range nor exponent is limited. Light leaks in close
    behind a caster, up to about 3 / `exponent` metres, and where the filter sees something farther off than the
    receiver the shadow's edge is eaten away, the more the larger the exponent.
    """

    down: ClassVar[str] = "shadow_esm_down.frag"
    across: ClassVar[str] = "shadow_esm_across.frag"
    texel: ClassVar[str] = "r32f"

    lookup = filtered_lookup("shadow_esm.glsl")

    exponent: float = param(default=5.0, unit="1/m", min=0.01, max=10000, doc="How steep the step of the test is.")
