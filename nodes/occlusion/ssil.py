"""Occlusion and light between surfaces in one pass, by a visibility bitmask."""

from __future__ import annotations

from rendergraph.api import Steps, param

from ._combined import Combined


class SSIL(Combined):
    """How open each surface is and the light that reaches it from the others, of which each direction sees the nearest.

    Screen-space indirect lighting with a visibility bitmask (Therrien, Levesque and Gilet 2023). As in `gtao` the
    hemisphere is a fan of slices, but not two horizons are kept of each: 32 sectors, each with as much of the light.
    What is seen fills the sectors from its front to its back, `thickness` behind it, so that light passes behind what
    is thin; sectors that nobody has filled before get its light. This node adds ambient light itself, scaled by its
    occlusion; the lighting's own is to be 0.
    """

    thickness: float = param(
        default=0.5, unit="m", min=0, max=1e6, doc="How far what is seen goes on behind; much of it is `gtao`."
    )

    def record(self, steps: Steps) -> None:
        """Surfaces, light and occlusion, the neighbours' mean, full size; then what is made of it."""
        # Arms reach far beyond the radius of occlusion: fewer arms with more steps leave enough steps within it.
        self.look_at_both(steps, "ssil.frag", {"STEPS": min(max(self.samples // 2, 4), 16)})
