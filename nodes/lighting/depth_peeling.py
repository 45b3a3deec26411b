"""Order-independent transparency by depth peeling."""

from __future__ import annotations

from typing import Any, Literal

from rendergraph.api import (
    PREMULTIPLIED,
    Depth,
    Facts,
    Input,
    Internal,
    Output,
    Radiance,
    State,
    Steps,
    structural,
)

from ._image_lighting import gbuffer_samples
from ._lighting import UNDER, Lighting
from .forward_transparent import ForwardTransparent

_MAX_AUTO_LAYERS = 8


def max_layers(facts: Facts) -> int:
    """Return an upper bound on the number of transparent surfaces along a ray, from the shapes of all objects."""
    return sum(one.most_layers for one in facts.drawn("transparent"))


class DepthPeeling(ForwardTransparent):
    """Light transparent surfaces and blend them over a picture, sorted by depth at every pixel.

    Each pass draws all transparent surfaces and keeps the nearest fragment behind the previous layer. The layers are
    peeled off from front to back (Everitt 2001) and composited under each other. Intersecting surfaces are ordered per
    pixel, which sorting objects cannot do. The requested layers are exact; surfaces behind them are missing. There are
    no more passes than the scene can have layers, and once a pass draws nothing, the device skips the remaining ones.
    """

    depth = Input(
        Depth, samples="any", doc="Depth of the opaque surfaces, with its view; hides transparent surfaces behind them."
    )
    peeled = Output(
        Radiance,
        format="rgba32f",
        clear=0.0,
        samples=gbuffer_samples,
        doc="The layers alone, premultiplied; alpha is opacity. Float32, as half floats would be rounded per layer.",
    )
    layer = Internal(Radiance, format="rgba16f", samples=gbuffer_samples, clear=0.0)
    even_depth = Internal(Depth, format="depth32f", samples=gbuffer_samples, clear=0.0)
    odd_depth = Internal(Depth, format="depth32f", samples=gbuffer_samples, clear=0.0)

    layers: Literal["auto"] | int = structural(
        default="auto",
        min=1,
        max=64,
        doc="Number of layers, from the nearest; surfaces behind them are missing. `auto`: as many as the scene's "
        f"surfaces can have, at most {_MAX_AUTO_LAYERS}.",
    )

    def record(self, steps: Steps) -> None:
        """Record a geometry pass per layer, composited under the previous ones, then blend all over the picture."""
        if not steps.draws("transparent"):
            if steps.used(self.peeled):
                steps.clear(self.peeled)
            self.draw_transparent(steps, {"radiance": self.radiance}, self.lookup)  # records that nothing is drawn
            return
        Lighting.record(self, steps)
        lit = self.lighting_reads(steps, self.lookup)
        bound = max_layers(steps.facts)
        count = min(bound, _MAX_AUTO_LAYERS) if self.layers == "auto" else min(bound, self.layers)
        for number in range(count):
            nearest, previous = (self.odd_depth, self.even_depth) if number % 2 else (self.even_depth, self.odd_depth)
            reads: dict[str, Any] = {"depth": self.depth, **lit, **({"previous_depth": previous} if number else {})}
            if number > 0:
                steps.clear(self.layer)
            if number > 1:
                steps.clear(nearest)
            steps.geometry(
                "depth_peeling.frag",
                out={"layer": self.layer, "nearest": nearest},
                objects="transparent",
                view=self.depth,
                defines={"PEELED": 1} if number else {},
                label=f"layer {number + 1}",
                if_drawn=f"layer {number}" if number else "",
                **reads,
            )
            steps.fullscreen(
                "composite.frag",
                out={"color": self.peeled},
                state=State(blend=UNDER),
                label=f"under {number + 1}",
                if_drawn=f"layer {number + 1}",
                source=self.layer,
            )
        if steps.used(self.radiance):
            steps.fullscreen(
                "composite.frag", out={"color": self.radiance}, state=State(blend=PREMULTIPLIED), source=self.peeled
            )
