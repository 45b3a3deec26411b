"""Separable Gaussian blur."""

from __future__ import annotations

from rendergraph.api import Any, Input, Internal, Node, Output, Steps, param


class GaussianBlur(Node):
    """Blur a picture by a Gaussian, one axis after the other.

    Each axis has `2 radius + 1` taps at texel centres, whose weights add up to 1, so that a uniform picture is
    unchanged. Beyond the border, the texels at the border are repeated.
    """

    source = Input(Any, size="any", doc="The picture to blur.")
    blurred = Output(like="source", size="source", doc="The blurred picture.")
    blurred_x = Internal(like="source", size="source")

    radius: int = param(
        default=6, unit="texels", min=0, max=128, doc="Radius of the kernel, three standard deviations; 0: no blur."
    )

    def record(self, steps: Steps) -> None:
        """Record the horizontal and the vertical blur."""
        steps.fullscreen("gaussian_blur.frag", source=self.source, out=self.blurred_x, axis=(1, 0))
        steps.fullscreen("gaussian_blur.frag", source=self.blurred_x, out=self.blurred, axis=(0, 1))
