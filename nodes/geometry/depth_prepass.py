"""Depth before everything else."""

from __future__ import annotations

from rendergraph.api import Depth, Input, Node, Output, Port, Steps, View, structural

from ._samples import Samples, own_samples
from ._velocity import drawn_velocity


class DepthPrepass(Node):
    """Depth of the nearest opaque surface at every pixel.

    Lighting that takes it shades no hidden fragment; image-space techniques reconstruct positions from it.
    """

    view = Input(View, kind="view", optional=True, doc="What it is seen from; the pipeline's camera by default.")
    depth = Output(Depth, format="depth32f", clear=0.0, samples=own_samples, doc="Window depth, 0 where nothing is.")

    velocity = drawn_velocity()

    samples: Samples = structural(default=1, doc="Samples a pixel, as many as the pass has that takes the depth.")

    def record(self, steps: Steps) -> None:
        """Positions alone; fragments only where a mask cuts them."""
        out: dict[str, Port] = {"depth": self.depth}
        if steps.used(self.velocity):
            out["velocity"] = self.velocity
        steps.geometry("<depth.frag>", vertex="<depth.vert>", out=out, objects="opaque", materials="alpha")
