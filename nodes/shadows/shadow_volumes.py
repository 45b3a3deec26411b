"""Shadow volumes counted in the stencil."""

from __future__ import annotations

from rendergraph.api import Depth, Input, Internal, State, Steps

from ._casting import visibility_of_lights
from ._volumes import INSIDE_VOLUMES, CountsVolumes


class ShadowVolumes(CountsVolumes):
    """Compute hard shadows that are exact at every pixel, by shadow volumes.

    There is no map, no resolution and no bias. The cost is the fill rate of the volumes, front and back faces for each
    light. Casters must be closed meshes; alpha masks are ignored.
    """

    twin = "traced_shadows"

    depth = Input(Depth, doc="Depth of the opaque surfaces, from the pipeline's camera.")
    marks = Internal(Depth, format="depth32f_stencil8", clear=0.0)
    visibility = visibility_of_lights()

    def record(self, steps: Steps) -> None:
        """Record the volumes and the visibility of each light, which also clears the stencil for the next."""
        # A copy, because other steps may read the depth, which has no stencil.
        steps.fullscreen("<copy_depth.frag>", out=self.marks, depth=self.depth)
        for layer in range(len(self.lights(steps.facts))):
            self.count(steps, layer, self.marks, self.depth)
            steps.fullscreen(
                "shadow_volumes.frag",
                out={"visibility": self.visibility.layer(layer), "marks": self.marks},
                state=State(depth_test=False, depth_write=False, stencil=INSIDE_VOLUMES),
                region=layer,
                depth=self.depth,
            )
