"""A bilateral filter over surfaces."""

from __future__ import annotations

from rendergraph.api import Any, Depth, Input, Internal, Node, Normal, Output, Steps, param, structural

from ._layers import layers_of


class Denoise(Node):
    """Remove noise by averaging a picture over each of its surfaces.

    An à-trous filter (Dammertz, Sewtz, Hanika and Lensch, "Edge-Avoiding À-Trous Wavelet Transform for fast Global
    Illumination Filtering", 2010): passes of 3×3 texels with doubled strides, so that three of them reach 7 texels.
    Weights depend on the distance from the pixel's tangent plane and on normals, not on values, so that edges between
    surfaces stay sharp.
    """

    source = Input(Any, layered=True, doc="The noisy picture, or several as layers.")
    depth = Input(Depth, doc="Window depth; positions come from it and its view.")
    normal = Input(Normal, doc="Unit normal, world space.")
    denoised = Output(like="source", doc="The picture without noise.")
    surfaces = Internal(format="rgba32f", size="depth", view="depth")
    odd = Internal(format="rgba16f", size="depth")
    even = Internal(format="rgba16f", size="depth")

    passes: int = structural(
        default=3, min=1, max=6, doc="Number of passes. The first reaches one texel, each further one twice as far."
    )
    tolerance: float = param(
        default=0.05, unit="m", min=1e-6, max=1e6, doc="How far texels may lie from the pixel's plane."
    )

    def record(self, steps: Steps) -> None:
        """Record the surfaces and the passes."""
        size = steps.desc(self.surfaces).size
        steps.fullscreen("surfaces.frag", out=self.surfaces, depth=self.depth, normal=self.normal, reduced_size=size)
        for first, last in zip(layers_of(steps, self.source), layers_of(steps, self.denoised), strict=True):
            for number in range(self.passes):
                is_last = number == self.passes - 1
                steps.fullscreen(
                    "atrous.frag",
                    out={"filtered": last if is_last else (self.odd, self.even)[number % 2]},
                    source=first if number == 0 else (self.even, self.odd)[number % 2],
                    surfaces=self.surfaces,
                    screen_size=size,
                    stride=1 << number,
                    defines={"HAS_VECTOR": 1},
                )
