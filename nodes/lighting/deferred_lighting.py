"""Lighting of a G-buffer, all lights at once."""

from __future__ import annotations

from rendergraph.api import Output, Radiance, Steps

from ._image_lighting import ImageLighting, samples_stored
from ._lighting import DIFFUSE


class DeferredLighting(ImageLighting):
    """Radiance of a G-buffer's surfaces under all lights of the scene, in one full-screen pass.

    Each pixel is shaded once, whatever the geometry behind it: the cost is that of the geometry plus pixels times
    lights. Surfaces with alpha blending, which a G-buffer does not hold, are drawn over that, back to front. The
    picture is `forward_lighting`'s.
    """

    radiance = Output(
        Radiance,
        format="rgba16f",
        samples=samples_stored,
        doc="Scene-linear radiance; alpha is 1 where a surface is and 0 where nothing is.",
    )
    diffuse = Output(Radiance, format="rgba16f", samples=samples_stored, doc=DIFFUSE)

    def record(self, steps: Steps) -> None:
        """A step that reads what shading model and terms need, the environment behind, and what is blended."""
        super().record(steps)
        reads = {**self.surface(steps), **self.shadows(steps), **self.ambient_light(steps)}
        defines = {**self.per_sample(steps), **self.backdrop_defines(steps)}
        steps.fullscreen("deferred_lighting.frag", out=self.pictures(steps), defines=defines, **reads)
        self.blend_over(steps)
