"""Depth before everything else."""

from __future__ import annotations

from rendergraph.api import Depth, Input, Node, Output, Steps, View


class DepthPrepass(Node):
    """Depth of the nearest opaque surface at every pixel.

    Lighting that takes it shades no hidden fragment; image-space techniques reconstruct positions from it.
    """

    view = Input(View, kind="view", optional=True, doc="What it is seen from; the pipeline's camera by default.")
    depth = Output(Depth, format="depth32f", clear=1.0, doc="Window depth, 1 where nothing is.")

    def record(self, steps: Steps) -> None:
        """Positions alone; fragments only where a mask cuts them."""
        steps.geometry("<depth.frag>", vertex="<depth.vert>", out=self.depth, objects="opaque", materials="alpha")
