"""Shadow volumes counted in the stencil."""

from __future__ import annotations

from rendergraph.api import Depth, Input, Internal, State, Steps

from ._casting import visibility_of_lights
from ._volumes import IN_SHADOW, CountsVolumes


class ShadowVolumes(CountsVolumes):
    """Hard shadows that are exact at every pixel: what lies within a volume that a caster hides from the light.

    No map, no resolution, no bias; the cost is that of filling the volumes, twice for each light. Casters are closed
    meshes, and cast whole: an alpha mask cuts no holes.
    """

    depth = Input(Depth, doc="Depth of the opaque surfaces, seen by the pipeline's camera.")
    marks = Internal(Depth, format="depth32f_stencil8", clear=0.0)
    visibility = visibility_of_lights()

    def record(self, steps: Steps) -> None:
        """Volumes and what lies in them, light by light; the stencil is wiped for the next on the way."""
        # The depth may be read elsewhere meanwhile, and has no stencil.
        steps.fullscreen("<copy_depth.frag>", out=self.marks, depth=self.depth)
        for layer in range(len(self.lights(steps.facts))):
            self.count(steps, layer, self.marks, self.depth)
            steps.fullscreen(
                "shadow_volumes.frag",
                out={"visibility": self.visibility.layer(layer), "marks": self.marks},
                state=State(depth_test=False, depth_write=False, stencil=IN_SHADOW),
                region=layer,
                depth=self.depth,
            )
