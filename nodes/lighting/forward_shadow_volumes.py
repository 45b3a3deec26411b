"""Forward lighting in one pass per light, with shadow volumes."""

from __future__ import annotations

from rendergraph.api import ADD, DROPPED, Depth, Output, State, Steps

from ..shadows._volumes import CLEAR_COUNT, OUTSIDE_VOLUMES, CountsVolumes
from ._lighting import GeometryLighting, rendered_samples
from .forward_multipass import ForwardMultipass


class ForwardShadowVolumes(CountsVolumes, ForwardMultipass):
    """Light the scene in a first pass without lights and one additive pass per light outside its shadow volumes.

    Before each pass, the light's shadow volumes are counted in the stencil of the picture's own depth buffer, and the
    pass is drawn where the count is 0. No fragment in shadow is lit, and no shadow texture is needed. The stencil
    counts per sample, so shadow edges are antialiased with multisampling.
    """

    depth = DROPPED
    surface_depth = Output(
        Depth,
        format="depth32f_stencil8",
        clear=0.0,
        samples=rendered_samples,
        doc="Depth of the nearest opaque surface, with the stencil that counts volumes.",
    )

    def record(self, steps: Steps) -> None:
        """Record ambient light and emission, then volumes and lighting of each light, then transparent surfaces."""
        GeometryLighting.record(self, steps)
        self.draw_opaque(steps, "forward_multipass.frag", defines={"FIRST_PASS": 1}, **self.ambient_reads(steps))
        casting = self.lights(steps.facts)
        for light in range(len(steps.lights) if self.wants_lights(steps) else 0):
            layer = casting.index(light) if light in casting else None
            if layer is not None:
                self.count(steps, layer, self.surface_depth)
            self.draw_opaque(
                steps,
                "forward_multipass.frag",
                state=State(
                    blend=ADD,
                    depth_func="equal",
                    depth_write=False,
                    stencil=OUTSIDE_VOLUMES if layer is not None else None,
                ),
                region=layer,
                per_light=light,
                light=light,
            )
            if layer is not None:
                state = State(depth_test=False, depth_write=False, stencil=CLEAR_COUNT)
                steps.fullscreen("clear_stencil.frag", out=self.surface_depth, state=state, region=layer)
        self.draw_backdrop_and_transparent(steps)
