"""How often pixels are drawn."""

from __future__ import annotations

from typing import Any, Literal

from rendergraph.api import (
    ADD,
    Depth,
    DisplayColor,
    Facts,
    Input,
    Internal,
    Node,
    Output,
    Port,
    State,
    Steps,
    View,
    param,
    structural,
)
from rendergraph.api import Any as AnyTexel


def half_of_count(_node: Overdraw, facts: Facts) -> tuple[int, int]:
    """Half the picture's size, rounded down as levels of a mip chain are."""
    width, height = facts.viewport
    return max(1, width >> 1), max(1, height >> 1)


class Overdraw(Node):
    """Fragments a pixel as a heat map with its legend: what a forward pass shades, or how many lights reach a pixel.

    Fragments are drawn as `forward_lighting` draws them, opaque ones front to back against depth, then those with alpha
    blending: what is hidden by something that came earlier costs nothing, what comes earlier and is hidden later costs
    a whole shading. With `depth` of a pre-pass opaque surfaces are drawn once. `lights` counts the lights whose range
    and cone hold the surface of a pixel, which is what light volumes shade, and takes its `depth` from a pre-pass or a
    G-buffer; directional lights reach all.
    """

    view = Input(View, kind="view", optional=True, doc="What it is seen from; the pipeline's camera by default.")
    depth = Input(Depth, optional=True, doc="Depth of a pre-pass: tested for fragments, looked at for lights.")
    color = Output(DisplayColor, format="rgba8", doc="The heat map, black where nothing is, with its legend.")
    count = Output(AnyTexel, format="r16f", clear=0.0, doc="Fragments, or lights, of each pixel.")
    mean = Output(AnyTexel, format="r32f", size=(1, 1), doc="The mean over all pixels of the picture; one texel.")
    maximum = Output(AnyTexel, format="r32f", size=(1, 1), doc="The most of any pixel; one texel.")
    nearest = Internal(Depth, format="depth32f", clear=0.0)
    levels = Internal(format="rg32f", size=half_of_count, mips=0)

    counted: Literal["fragments", "lights"] = structural(default="fragments", doc="What is counted.")
    top: int = param(
        default=8, min=2, max=64, doc="The count that has the last colour of the legend; so has what is above."
    )

    def record(self, steps: Steps) -> None:
        """The count, its picture, and a chain of means and maxima down to one texel."""
        if self.counted == "lights":
            steps.fullscreen("overdraw_lights.frag", out={"count": self.count}, depth=self.depth, label="lights")
        else:
            self._fragments(steps)
        if steps.used(self.color):
            steps.fullscreen("overdraw_heat.frag", out={"color": self.color}, count=self.count, label="heat")
        if steps.used(self.mean) or steps.used(self.maximum):
            self._figures(steps)

    def _fragments(self, steps: Steps) -> None:
        tested: dict[str, Any] = {"depth": self.depth.tested()} if steps.connected(self.depth) else {}
        out: dict[str, Port] = {"count": self.count} if tested else {"count": self.count, "depth": self.nearest}
        for objects, order in (("opaque", "front_to_back"), ("transparent", "back_to_front")):
            steps.geometry(
                "overdraw.frag",
                vertex="<depth.vert>",
                out=out,
                state=State(blend=ADD, depth_write=None if objects == "opaque" and not tested else False),
                objects=objects,
                order=order,  # type: ignore[arg-type]  # a tuple of literals widens
                materials="alpha",
                label=objects,
                view=self.depth if tested else None,
                **tested,
            )

    def _figures(self, steps: Steps) -> None:
        steps.fullscreen("overdraw_level.frag", source=self.count, out=self.levels.mip(0), defines={"FIRST": 1})
        last = steps.desc(self.levels).mips - 1
        for level in range(last):
            steps.fullscreen("overdraw_level.frag", source=self.levels.mip(level), out=self.levels.mip(level + 1))
        for port, channel in ((self.mean, 0), (self.maximum, 1)):
            if steps.used(port):
                steps.fullscreen("overdraw_figure.frag", source=self.levels.mip(last), out=port, channel=channel)
