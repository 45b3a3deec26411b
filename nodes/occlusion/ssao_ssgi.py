"""Occlusion and light between surfaces in one pass, from discs on the screen."""

from __future__ import annotations

from rendergraph.api import Steps

from ._combined import Combined


class SSAOSSGI(Combined):
    """How open each surface is and the light that reaches it from the others, from one set of samples.

    What `ssao_disc` (with `form: disc`: strips would be too long here) and `ssgi` find, at little more than the price
    of one: the samples lie denser towards the middle, so that near half of them lie within the radius of occlusion, a
    fifth of that of light. This node adds ambient light itself, scaled by its occlusion; the lighting's own is to be 0.
    """

    def record(self, steps: Steps) -> None:
        """Surfaces, light and occlusion, the neighbours' mean, full size; then what is made of it."""
        self.look_at_both(steps, "discs.frag", {"LIGHT": 1, "OPEN": 1, "BUNNELL": 1})
