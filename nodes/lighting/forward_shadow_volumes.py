"""Lighting while the geometry is drawn, once a light, where no shadow volume is."""

from __future__ import annotations

from rendergraph.api import ADD, DROPPED, Depth, Output, State, Steps

from ..shadows._volumes import LIT, WIPE, CountsVolumes
from ._lighting import GeometryLighting, samples_drawn
from .forward_multipass import ForwardMultipass


class ForwardShadowVolumes(CountsVolumes, ForwardMultipass):
    """Radiance of the scene, drawn once for what needs no light and once more for each light where it is not shadowed.

    Before each pass the light's shadow volumes are counted in the stencil of the picture's own depth, and the pass is
    drawn where the count is 0: no fragment in shadow is lit, and no texture of shadows is needed. Samples of a pixel
    are counted one by one, so that edges of shadows are smooth with several.
    """

    depth = DROPPED
    surface_depth = Output(
        Depth,
        format="depth32f_stencil8",
        clear=0.0,
        samples=samples_drawn,
        doc="Depth of the nearest opaque surface, with the stencil that volumes are counted in.",
    )

    def record(self, steps: Steps) -> None:
        """Ambient and emitted light first, then volumes and light by turns, then what is blended."""
        GeometryLighting.record(self, steps)
        self.light_opaque(steps, "forward_multipass.frag", defines={"FIRST_PASS": 1}, **self.around(steps))
        casting = self.lights(steps.facts)
        for light in range(len(steps.lights) if self.wants_lights(steps) else 0):
            layer = casting.index(light) if light in casting else None
            if layer is not None:
                self.count(steps, layer, self.surface_depth)
            self.light_opaque(
                steps,
                "forward_multipass.frag",
                state=State(
                    blend=ADD, depth_func="equal", depth_write=False, stencil=LIT if layer is not None else None
                ),
                region=layer,
                per_light=light,
                light=light,
            )
            if layer is not None:
                state = State(depth_test=False, depth_write=False, stencil=WIPE)
                steps.fullscreen("clear_stencil.frag", out=self.surface_depth, state=state, region=layer)
        self.blend_after(steps)
