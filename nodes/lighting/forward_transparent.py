"""Surfaces with alpha blending, over a picture of the opaque ones."""

from __future__ import annotations

from rendergraph.api import Depth, InOut, Input, Radiance, Steps

from ._lighting import Lighting


class ForwardTransparent(Lighting):
    """Surfaces with alpha blending, lit and laid over a picture, back to front.

    What lights opaque surfaces does this too, in the same way and as its last step. As a node of its own it comes
    after whatever else continues the radiance, a sky or light between surfaces: `blended: false` there leaves these
    surfaces to it. They are ordered by their objects' centres, and seen as the depth was that hides them.
    """

    depth = Input(Depth, use="depth_test", doc="Depth of the opaque surfaces, with their view; tested, not written.")
    radiance = InOut(Radiance, doc="Scene-linear radiance; alpha is coverage, and colour is multiplied with it.")

    def record(self, steps: Steps) -> None:
        """One step."""
        if steps.draws("transparent"):
            super().record(steps)
        self.blend(steps, {"radiance": self.radiance}, self.lookup, self.depth, view=self.depth)
