"""Deferred lighting by all lights at once."""

from __future__ import annotations

from rendergraph.api import Output, Radiance, Steps

from ._image_lighting import ImageLighting, gbuffer_samples
from ._lighting import DIFFUSE


class DeferredLighting(ImageLighting):
    """Light the surfaces of a G-buffer by all lights of the scene, in one full-screen pass.

    Each pixel is shaded once, regardless of the depth complexity: the cost is that of the geometry plus pixels times
    lights. A G-buffer contains no transparent surfaces; they are drawn over the picture, back to front. It contains no
    layers either: surfaces with a coat, sheen or iridescence are drawn once more, as by `forward_lighting`. The picture
    is the same as that of `forward_lighting`.
    """

    radiance = Output(
        Radiance,
        format="rgba16f",
        samples=gbuffer_samples,
        doc="Scene-linear radiance; alpha is 1 on surfaces and 0 on the background.",
    )
    diffuse = Output(Radiance, format="rgba16f", samples=gbuffer_samples, doc=DIFFUSE)

    def record(self, steps: Steps) -> None:
        """Record the lighting step, then the backdrop and transparent surfaces."""
        super().record(steps)
        reads = self.gbuffer_reads(steps) | self.direct_reads(steps) | self.ambient_reads(steps) | self.air_reads(steps)
        defines = {**self.per_sample(steps), **self.backdrop_defines(steps)}
        steps.fullscreen("deferred_lighting.frag", out=self.color_targets(steps), defines=defines, **reads)
        self.draw_backdrop_and_transparent(steps)
