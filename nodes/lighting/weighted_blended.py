"""Surfaces with alpha blending in any order, as a weighted mean."""

from __future__ import annotations

from typing import Literal

from rendergraph.api import ADD, PREMULTIPLIED, Blend, Internal, State, Steps, define, param

from ._image_lighting import samples_stored
from ._lighting import Lighting
from .forward_transparent import ForwardTransparent

_HIDE = Blend("zero", "one_minus_src_color")


class WeightedBlended(ForwardTransparent):
    """Surfaces with alpha blending, lit and laid over a picture as the weighted mean of their colours, in no order.

    Sums and products do not ask for order. How much of the background is left is the product of what each surface
    leaves, and exact; the colour before it is the mean of theirs, weighed by opacity and by a function that falls with
    distance and stands in for the order (McGuire and Bavoil 2013). One pass, no sorting, and nothing pops as things
    move. A single layer is exact, and so are several of one colour; of others the nearer shows more, though rarely as
    much as it should.
    """

    accumulation = Internal(format="rgba32f", samples=samples_stored, clear=0.0)
    revealage = Internal(format="r16f", samples=samples_stored, clear=1.0)

    weight: Literal["distance_squared", "distance_cubed", "distance_fourth", "window_depth", "opacity"] = define(
        default="distance_cubed",
        doc="How it falls: equations 7, 8, 9 and 10 of the paper, or by opacity alone, whatever the distance.",
    )
    unit: float = param(
        default=1.0,
        unit="m",
        min=1e-6,
        max=1e6,
        doc="What the first three take for 1; they are made for 0.1 to 500 of it.",
    )

    def record(self, steps: Steps) -> None:
        """One pass over the geometry into a sum and a product, and one that lays the mean over the picture."""
        if not steps.draws("transparent"):
            self.blend(steps, {"radiance": self.radiance}, self.lookup)  # nothing, and says so
            return
        Lighting.record(self, steps)
        steps.geometry(
            "weighted_blended.frag",
            out={"accumulation": self.accumulation, "revealage": self.revealage},
            objects="transparent",
            view=self.depth,
            state=State(blend=(ADD, _HIDE), depth_write=False),
            depth=self.depth,
            **self.lights_of(steps, self.lookup),
        )
        steps.fullscreen(
            "weighted_composite.frag",
            out={"radiance": self.radiance},
            state=State(blend=PREMULTIPLIED),
            accumulation=self.accumulation,
            revealage=self.revealage,
        )
