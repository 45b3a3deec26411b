"""Weighted blended order-independent transparency."""

from __future__ import annotations

from typing import Literal

from rendergraph.api import ADD, PREMULTIPLIED, Blend, Internal, State, Steps, define, param

from ._image_lighting import gbuffer_samples
from ._lighting import Lighting
from .forward_transparent import ForwardTransparent

_ATTENUATE = Blend("zero", "one_minus_src_color")


class WeightedBlended(ForwardTransparent):
    """Light transparent surfaces and blend the weighted mean of their colours over a picture, without sorting.

    Sums and products do not depend on order. The visibility of the background is the product of the surfaces'
    transmittances, which is exact. The colour in front of it is the mean of the surfaces' colours, weighted by opacity
    and by a function that falls with distance and approximates the order (McGuire and Bavoil 2013). It takes one pass
    without sorting, and nothing pops when objects move. A single layer is exact, and so are several layers of one
    colour. Otherwise nearer surfaces contribute more, though usually less than they should.
    """

    accumulation = Internal(format="rgba32f", samples=gbuffer_samples, clear=0.0)
    revealage = Internal(format="r16f", samples=gbuffer_samples, clear=1.0)

    weight: Literal["distance_squared", "distance_cubed", "distance_fourth", "window_depth", "opacity"] = define(
        default="distance_cubed",
        doc="Weight function: equations 7 to 10 of the paper, or opacity alone.",
    )
    unit: float = param(
        default=1.0,
        unit="m",
        min=1e-6,
        max=1e6,
        doc="Unit of distance for the first three functions, which are designed for 0.1 to 500 units.",
    )

    def record(self, steps: Steps) -> None:
        """Record a geometry pass into a sum and a product, and one that blends the mean over the picture."""
        if not steps.draws("transparent"):
            self.draw_transparent(steps, {"radiance": self.radiance}, self.lookup)  # records that nothing is drawn
            return
        Lighting.record(self, steps)
        steps.geometry(
            "weighted_blended.frag",
            out={"accumulation": self.accumulation, "revealage": self.revealage},
            objects="transparent",
            view=self.depth,
            state=State(blend=(ADD, _ATTENUATE), depth_write=False),
            depth=self.depth,
            **self.lighting_reads(steps, self.lookup),
        )
        steps.fullscreen(
            "weighted_composite.frag",
            out={"radiance": self.radiance},
            state=State(blend=PREMULTIPLIED),
            accumulation=self.accumulation,
            revealage=self.revealage,
        )
