"""Convolution shadow maps."""

from __future__ import annotations

from typing import ClassVar

from rendergraph.api import define, param

from ._filtered_map import FilteredMap, filtered_lookup


class ShadowConvolution(FilteredMap):
    """Shadows from the Fourier series of the depth test, filtered term by term (Annen, Mertens, Bekaert et al. 2007).

    Each term is a product of a part for the map's depth and one for the receiver's, so the map's parts can be averaged
    beforehand, and unlike an exponential they stay small. Few terms make a slow step: light leaks in close behind a
    caster, over about 1 / (2 `terms`) of the range of the light's view, and rings beyond that. Two terms are a texture
    of four channels.
    """

    down: ClassVar[str] = "shadow_convolution_down.frag"
    texel: ClassVar[str] = "rgba16_snorm"
    at_once: ClassVar[int] = 4

    lookup = filtered_lookup("shadow_convolution.glsl")

    terms: int = define(default=8, min=1, max=16, doc="Of the series; memory and time go with them.")
    offset: float = param(
        default=1.0, min=0, max=4, doc="How far receivers are moved to the light: 1 makes lit faces wholly lit."
    )

    def parts(self) -> int:
        """A texture for two terms."""
        return (self.terms + 1) // 2
