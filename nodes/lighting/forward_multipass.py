"""Lighting while the geometry is drawn, once a light."""

from __future__ import annotations

from rendergraph.api import ADD, Output, Radiance, State, Steps

from ._lighting import DIFFUSE, GeometryLighting, background_texel, samples_drawn


class ForwardMultipass(GeometryLighting):
    """Radiance of the scene, drawn once for what needs no light and once more for each light, added up.

    How many lights became possible before shaders could loop: every light costs all the geometry again and every
    fragment that is seen, L (V + F). Passes after the first are drawn where depth is equal to what the first left.
    Surfaces with alpha blending cannot be added up light by light; they come last, under all lights at once.
    """

    radiance = Output(
        Radiance,
        format="rgba32f",
        clear=background_texel,
        samples=samples_drawn,
        doc="Scene-linear radiance, float32: half floats would lose a step with every light. Alpha is coverage.",
    )
    diffuse = Output(Radiance, format="rgba32f", clear=background_texel, samples=samples_drawn, doc=DIFFUSE)

    def record(self, steps: Steps) -> None:
        """Ambient and emitted light first, then each light, then what is blended."""
        super().record(steps)
        self.light_opaque(steps, "forward_multipass.frag", defines={"FIRST_PASS": 1}, **self.around(steps))
        added = State(blend=ADD, depth_func="equal", depth_write=False)
        for light in range(len(steps.lights) if self.wants_lights(steps) else 0):
            self.light_opaque(steps, "forward_multipass.frag", state=added, per_light=light, light=light)
        self.blend_after(steps)
