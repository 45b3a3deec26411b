"""Separable Gaussian blur."""

from __future__ import annotations

from rendergraph.api import Any, Input, Internal, Node, Output, Steps, param


class GaussianBlur(Node):
    """The same picture under a Gaussian, one axis after the other.

    `2 radius + 1` taps an axis, sampled at texel centres and normalised to sum to one, so a flat picture stays as it
    is; beyond the border the border's texels go on.
    """

    source = Input(Any, size="any", doc="What to blur.")
    blurred = Output(like="source", size="source", doc="The same, blurred.")
    across = Internal(like="source", size="source")

    radius: int = param(
        default=6, unit="texels", min=0, max=128, doc="Three standard deviations; 0 leaves all as it is."
    )

    def record(self, steps: Steps) -> None:
        """Across, then up."""
        steps.fullscreen("gaussian_blur.frag", source=self.source, out=self.across, axis=(1, 0))
        steps.fullscreen("gaussian_blur.frag", source=self.across, out=self.blurred, axis=(0, 1))
