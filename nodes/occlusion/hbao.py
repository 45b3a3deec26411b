"""Ambient occlusion by horizons."""

from __future__ import annotations

from rendergraph.api import Steps, param

from ._arms import RefinedArms


class HBAO(RefinedArms):
    """How open each surface is, from how high the picture's surfaces rise around it.

    Horizon-based ambient occlusion (Bavoil and Sainz, "Image-Space Horizon-Based Ambient Occlusion", 2008): the depth
    is taken for a landscape. Along each arm the elevation of what is seen is followed outwards; where it rises above
    the tangent plane and all before, the sine of the rise is that much sky gone. All of the sky counts alike, not by
    the cosine, which makes contacts darker than they are; `gtao` weighs it.
    """

    attenuation: float = param(
        default=0.0, min=0, max=1, doc="How much less a surface hides at the radius than nearby; 1 is the paper's."
    )

    def record(self, steps: Steps) -> None:
        """Surfaces, occlusion, the neighbours' mean, full size."""
        self.look(steps, "hbao.frag", {"occlusion": self.occlusion})
