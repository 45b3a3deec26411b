"""Surfaces with alpha blending, layer by layer from the eye on."""

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

from ._image_lighting import samples_stored
from ._lighting import UNDER, Lighting
from .forward_transparent import ForwardTransparent

_MOST_LAYERS = 8  # that `auto` takes


def most_layers(facts: Facts) -> int:
    """How many surfaces with alpha blending a line of sight can meet: a bound from shapes, wherever they stand."""
    return sum(one.most_layers for one in facts.drawn("transparent"))


class DepthPeeling(ForwardTransparent):
    """Surfaces with alpha blending, lit and laid over a picture in the order of their depth at every single pixel.

    A pass draws all of them and keeps the nearest at each pixel; the next one draws all again and keeps the nearest
    behind that: layer by layer they are peeled off (Everitt 2001) and laid one under the other. Where surfaces cross,
    each pixel has its own order, which no sorting of objects gives. As many layers as are asked for are exact, and what
    lies behind them is not there. There are no more passes than the scene's surfaces can make layers, and after one
    that has found nothing left the device leaves out the rest.
    """

    depth = Input(Depth, samples="any", doc="Depth of the opaque surfaces, with their view; what is behind is hidden.")
    peeled = Output(
        Radiance,
        format="rgba32f",
        clear=0.0,
        samples=samples_stored,
        doc="The layers alone, premultiplied, alpha their opacity; float32, as half floats would lose a step a layer.",
    )
    layer = Internal(Radiance, format="rgba16f", samples=samples_stored, clear=0.0)
    even = Internal(Depth, format="depth32f", samples=samples_stored, clear=0.0)
    odd = Internal(Depth, format="depth32f", samples=samples_stored, clear=0.0)

    layers: Literal["auto"] | int = structural(
        default="auto",
        min=1,
        max=64,
        doc="Layers from the eye on, which are exact; what is behind them is left out. `auto`: as many as the scene's "
        f"surfaces can make, at most {_MOST_LAYERS}.",
    )

    def record(self, steps: Steps) -> None:
        """A pass over the geometry for each layer, and one that lays it under those before; all over the picture."""
        if not steps.draws("transparent"):
            if steps.used(self.peeled):
                steps.clear(self.peeled)
            self.blend(steps, {"radiance": self.radiance}, self.lookup)  # nothing, and says so
            return
        Lighting.record(self, steps)
        lit = self.lights_of(steps, self.lookup)
        most = most_layers(steps.facts)
        count = min(most, _MOST_LAYERS) if self.layers == "auto" else min(most, self.layers)
        for number in range(count):
            nearest, previous = (self.odd, self.even) if number % 2 else (self.even, self.odd)
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
