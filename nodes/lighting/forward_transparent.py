"""Transparent surfaces, blended over a picture of the opaque ones."""

from __future__ import annotations

from rendergraph.api import Depth, InOut, Input, Radiance, Steps

from ._lighting import Lighting


class ForwardTransparent(Lighting):
    """Light transparent surfaces and blend them over a picture, back to front.

    The lighting nodes do the same as their last step. As a separate node it can follow other passes that continue the
    radiance, such as a sky or indirect light; `blended: false` makes the lighting node leave these surfaces to it.
    Objects are sorted by their centres, and drawn with the view of the depth.
    """

    depth = Input(Depth, use="depth_test", doc="Depth of the opaque surfaces, with its view; tested but not written.")
    radiance = InOut(Radiance, doc="Scene-linear premultiplied radiance; alpha is coverage.")

    def record(self, steps: Steps) -> None:
        """Record the pass over transparent surfaces."""
        if steps.draws("transparent"):
            super().record(steps)
        self.draw_transparent(steps, {"radiance": self.radiance}, self.lookup, self.depth, view=self.depth)
