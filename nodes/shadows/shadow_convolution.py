"""Convolution shadow maps."""

from __future__ import annotations

from typing import ClassVar

from rendergraph.api import define, param

from ._filtered_map import FilteredMap, filtered_lookup


class ShadowConvolution(FilteredMap):
    """Approximate the depth test by a Fourier series, filtered term by term (Annen, Mertens, Bekaert et al. 2007).

    Each term is the product of a factor of the map's depth and one of the receiver's depth, so the map's factors can be
    filtered before the lookup. Unlike exponentials, these factors are bounded. With few terms the step is not steep:
    behind a caster, light leaks over about 1 / (2 `terms`) of the depth range of the light's view, with ringing beyond.
    Two terms share a four-channel texture.
    """

    vertical_shader: ClassVar[str] = "shadow_convolution_vertical.frag"
    texel_format: ClassVar[str] = "rgba16_snorm"
    layers_per_step: ClassVar[int] = 4

    lookup = filtered_lookup("shadow_convolution.glsl")

    terms: int = define(
        default=8, min=1, max=16, doc="Number of terms of the series; memory and time are proportional to it."
    )
    offset: float = param(
        default=1.0, min=0, max=4, doc="Offset of receivers towards the light; 1 makes lit surfaces fully lit."
    )

    def layers_per_map_layer(self) -> int:
        """Return the number of textures, each with two terms."""
        return (self.terms + 1) // 2
