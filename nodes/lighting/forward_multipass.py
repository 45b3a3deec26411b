"""Forward lighting in one pass per light."""

from __future__ import annotations

from rendergraph.api import ADD, Output, Radiance, State, Steps

from ._lighting import DIFFUSE, GeometryLighting, background_texel, rendered_samples


class ForwardMultipass(GeometryLighting):
    """Light the scene in a first pass without lights and one additive pass per light.

    This is how scenes with many lights were rendered before shaders could loop. Every light draws all V vertices and
    shades all F visible pixels again, so L lights cost L (V + F). Passes after the first use an equal depth test.
    Transparent surfaces cannot be added up light by light, so they are drawn last, lit by all lights at once.
    """

    radiance = Output(
        Radiance,
        format="rgba32f",
        clear=background_texel,
        samples=rendered_samples,
        doc="Scene-linear radiance; alpha is coverage. Float32, because half floats would be rounded after each light.",
    )
    diffuse = Output(Radiance, format="rgba32f", clear=background_texel, samples=rendered_samples, doc=DIFFUSE)

    def record(self, steps: Steps) -> None:
        """Record ambient light and emission, then each light, then transparent surfaces."""
        super().record(steps)
        self.draw_opaque(steps, "forward_multipass.frag", defines={"FIRST_PASS": 1}, **self.ambient_reads(steps))
        added = State(blend=ADD, depth_func="equal", depth_write=False)
        for light in range(len(steps.lights) if self.wants_lights(steps) else 0):
            self.draw_opaque(steps, "forward_multipass.frag", state=added, per_light=light, light=light)
        self.draw_backdrop_and_transparent(steps)
