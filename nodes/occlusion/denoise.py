"""A filter over surfaces, for whatever is noisy on them."""

from __future__ import annotations

from rendergraph.api import Any, Depth, Input, Internal, Node, Normal, Output, Steps, param, structural


class Denoise(Node):
    """The mean of a noisy picture over each of its surfaces.

    An à-trous filter (Dammertz, Sewtz, Hanika and Lensch, "Edge-Avoiding À-Trous Wavelet Transform for fast Global
    Illumination Filtering", 2010): passes of 3×3 texels, each twice as far apart as in the last, so that three of them
    reach 7 texels. A texel counts as far as it lies in the pixel's own plane and faces the same way; its values are not
    looked at, so that nothing is lost that is not noise but a surface's edge.
    """

    source = Input(Any, doc="What is noisy.")
    depth = Input(Depth, doc="Window depth; positions come from it and its view.")
    normal = Input(Normal, doc="Unit normal, world space.")
    denoised = Output(like="source", doc="The same without its noise.")
    surfaces = Internal(format="rgba32f", size="depth", view="depth")
    odd = Internal(format="rgba16f", size="depth")
    even = Internal(format="rgba16f", size="depth")

    passes: int = structural(default=3, min=1, max=6, doc="Each reaches twice as far as the last, the first one texel.")
    tolerance: float = param(default=0.05, unit="m", min=1e-6, max=1e6, doc="How far off a plane its texels may lie.")

    def record(self, steps: Steps) -> None:
        """Surfaces, then the passes."""
        size = steps.desc(self.surfaces).size
        steps.fullscreen("surfaces.frag", out=self.surfaces, depth=self.depth, normal=self.normal, reduced=size)
        for number in range(self.passes):
            source = self.source if number == 0 else (self.even, self.odd)[number % 2]
            last = number == self.passes - 1
            steps.fullscreen(
                "atrous.frag",
                out={"mean": self.denoised if last else (self.odd, self.even)[number % 2]},
                source=source,
                surfaces=self.surfaces,
                screen=size,
                stride=1 << number,
                defines={"FOUR": 1},
            )
