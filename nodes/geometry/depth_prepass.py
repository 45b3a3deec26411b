"""Depth pre-pass."""

from __future__ import annotations

from rendergraph.api import Depth, Input, Node, Output, Port, Steps, View, structural

from ._samples import Samples, own_samples
from ._velocity import velocity_output


class DepthPrepass(Node):
    """Render the depth of the nearest opaque surface at every pixel.

    Lighting nodes that take it shade no hidden fragments, and screen-space techniques reconstruct positions from it.
    """

    view = Input(View, kind="view", optional=True, doc="The view; the pipeline's camera by default.")
    depth = Output(Depth, format="depth32f", clear=0.0, samples=own_samples, doc="Window depth, 0 on the background.")

    velocity = velocity_output()

    samples: Samples = structural(default=1, doc="Samples per pixel, as many as in the pass that uses the depth.")

    def record(self, steps: Steps) -> None:
        """Record a pass of positions only, with fragment shaders only for alpha masks."""
        out: dict[str, Port] = {"depth": self.depth}
        if steps.used(self.velocity):
            out["velocity"] = self.velocity
        steps.geometry("<depth.frag>", vertex="<depth.vert>", out=out, objects="opaque", materials="alpha")
