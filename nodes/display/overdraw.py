"""Overdraw: the number of fragments or lights per pixel."""

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


def half_picture_size(_node: Overdraw, facts: Facts) -> tuple[int, int]:
    """Return half the size of the picture, rounded down like mip levels."""
    width, height = facts.viewport
    return max(1, width >> 1), max(1, height >> 1)


class Overdraw(Node):
    """Show the number of shaded fragments, or of lights, of each pixel as a heat map with a legend.

    Fragments are drawn as by `forward_lighting`: opaque ones front to back with a depth test, then those with alpha
    blending. Surfaces behind others that were drawn before cost nothing; surfaces that are covered later cost a full
    shading. With the `depth` of a pre-pass, opaque surfaces are shaded once. `lights` counts the lights whose range and
    cone contain the surface of a pixel, which light volumes would shade; it needs the `depth` of a pre-pass or a
    G-buffer. Directional lights reach everything.
    """

    view = Input(View, kind="view", optional=True, doc="The view; the pipeline's camera by default.")
    depth = Input(Depth, optional=True, doc="Depth of a pre-pass, for the depth test or the positions of surfaces.")
    color = Output(DisplayColor, format="rgba8", doc="The heat map with its legend; black for background.")
    count = Output(AnyTexel, format="r16f", clear=0.0, doc="Fragments or lights of each pixel.")
    mean = Output(AnyTexel, format="r32f", size=(1, 1), doc="The mean over all pixels of the picture; one texel.")
    maximum = Output(AnyTexel, format="r32f", size=(1, 1), doc="The maximum of all pixels; one texel.")
    nearest = Internal(Depth, format="depth32f", clear=0.0)
    levels = Internal(format="rg32f", size=half_picture_size, mips=0)

    counted: Literal["fragments", "lights"] = structural(default="fragments", doc="What is counted.")
    top: int = param(
        default=8,
        min=2,
        max=64,
        doc="The count with the last colour of the legend; larger counts have the same colour.",
    )

    def record(self, steps: Steps) -> None:
        """Record the count, the heat map, and the mip chain of means and maxima."""
        if self.counted == "lights":
            steps.fullscreen("overdraw_lights.frag", out={"count": self.count}, depth=self.depth, label="lights")
        else:
            self._count_fragments(steps)
        if steps.used(self.color):
            steps.fullscreen("overdraw_heat.frag", out={"color": self.color}, count=self.count, label="heat")
        if steps.used(self.mean) or steps.used(self.maximum):
            self._record_statistics(steps)

    def _count_fragments(self, steps: Steps) -> None:
        depth_test: dict[str, Any] = {"depth": self.depth.tested()} if steps.connected(self.depth) else {}
        out: dict[str, Port] = {"count": self.count} if depth_test else {"count": self.count, "depth": self.nearest}
        for objects, order in (("opaque", "front_to_back"), ("transparent", "back_to_front")):
            steps.geometry(
                "overdraw.frag",
                vertex="<depth.vert>",
                out=out,
                state=State(blend=ADD, depth_write=None if objects == "opaque" and not depth_test else False),
                objects=objects,
                order=order,  # type: ignore[arg-type]  # a tuple of literals widens
                materials="alpha",
                label=objects,
                view=self.depth if depth_test else None,
                **depth_test,
            )

    def _record_statistics(self, steps: Steps) -> None:
        steps.fullscreen("overdraw_downsample.frag", source=self.count, out=self.levels.mip(0), defines={"FIRST": 1})
        last = steps.desc(self.levels).mips - 1
        for level in range(last):
            steps.fullscreen("overdraw_downsample.frag", source=self.levels.mip(level), out=self.levels.mip(level + 1))
        for port, channel in ((self.mean, 0), (self.maximum, 1)):
            if steps.used(port):
                steps.fullscreen("fetch_channel.frag", source=self.levels.mip(last), out=port, channel=channel)
