"""Exponential shadow maps."""

from __future__ import annotations

from typing import ClassVar

from rendergraph.api import param

from ._filtered_map import FilteredMap, filtered_lookup


class ShadowESM(FilteredMap):
    """Approximate the depth test by an exponential of depth (Annen, Mertens, Seidel, Flerackers and Kautz 2008).

    The step of the depth test is replaced by `exp(exponent · (z - t))`, clamped to 1, for a caster at depth z in front
    of a receiver at t. This is the product of a factor of the map and one of the receiver, so the map's factor can be
    filtered once per frame, in a single channel. Its logarithm is stored (Salvi 2008), so that neither range nor
    exponent is limited. Light leaks up to about 3 / `exponent` metres behind a caster. Where the filter region contains
    surfaces farther away than the receiver, the shadow's edge recedes, and it recedes more with a larger exponent.
    """

    vertical_shader: ClassVar[str] = "shadow_esm_vertical.frag"
    horizontal_shader: ClassVar[str] = "shadow_esm_horizontal.frag"
    texel_format: ClassVar[str] = "r32f"

    lookup = filtered_lookup("shadow_esm.glsl")

    exponent: float = param(
        default=5.0, unit="1/m", min=0.01, max=10000, doc="Steepness of the approximated depth test."
    )
