"""Ambient occlusion and indirect light in one pass, from discs."""

from __future__ import annotations

from rendergraph.api import Steps

from ._occlusion_and_light import OcclusionAndLight


class SSAOSSGI(OcclusionAndLight):
    """Compute ambient occlusion and indirect light from one set of samples.

    The results are those of `ssao_disc` (with `form: disc`, because strips would be too long here) and of `ssgi`, at
    little more than the cost of one: samples are denser near the pixel, so that nearly half of them lie within the
    radius of occlusion, which is a fifth of that of light. This node adds ambient light itself, scaled by its
    occlusion; the ambient light of the lighting node must be 0.
    """

    def record(self, steps: Steps) -> None:
        """Record sampling, filtering and the reflection of light."""
        self.record_both(steps, "discs.frag", {"LIGHT": 1, "OCCLUSION": 1, "BUNNELL": 1})
