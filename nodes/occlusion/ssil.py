"""Ambient occlusion and indirect light in one pass, by a visibility bitmask."""

from __future__ import annotations

from rendergraph.api import Steps, param

from ._occlusion_and_light import OcclusionAndLight


class SSIL(OcclusionAndLight):
    """Compute ambient occlusion and indirect light by a visibility bitmask.

    Screen-space indirect lighting with a visibility bitmask (Therrien, Levesque and Gilet 2023). As in `gtao` the
    hemisphere is divided into slices, but each has 32 sectors of equal weight in place of two horizons. A surface
    covers the sectors from its front to its back, `thickness` behind it, so that light passes behind thin objects;
    sectors that were not covered before receive its light. This node adds ambient light itself, scaled by its
    occlusion; the ambient light of the lighting node must be 0.
    """

    thickness: float = param(
        default=0.5,
        unit="m",
        min=0,
        max=1e6,
        doc="Thickness of all surfaces; with a large one, occlusion is that of `gtao`.",
    )

    def record(self, steps: Steps) -> None:
        """Record sampling, filtering and the reflection of light."""
        # Light reaches far beyond the radius of occlusion; fewer directions with more steps suffice within it.
        self.record_both(steps, "ssil.frag", {"STEPS": min(max(self.samples // 2, 4), 16)})
