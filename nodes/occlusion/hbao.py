"""Ambient occlusion by horizons."""

from __future__ import annotations

from rendergraph.api import Steps, param

from ._directional import RefinedDirectionalSampling


class HBAO(RefinedDirectionalSampling):
    """Compute ambient occlusion from the elevation of the horizon.

    Horizon-based ambient occlusion (Bavoil and Sainz, "Image-Space Horizon-Based Ambient Occlusion", 2008): depth is
    interpreted as a height field. Along each direction, samples that rise above the tangent plane and above all
    previous samples raise the horizon, and occlude by the increase of its sine. The sky is weighted uniformly,
    whereas `gtao` weights it by the cosine, so contacts are too dark.
    """

    attenuation: float = param(
        default=0.0, min=0, max=1, doc="Decrease of occlusion from the pixel to the radius; 1 as in the paper."
    )

    def record(self, steps: Steps) -> None:
        """Record sampling and filtering."""
        self.sample_and_filter(steps, "hbao.frag", {"occlusion": self.occlusion})
