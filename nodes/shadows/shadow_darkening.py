"""Shadows that darken a lit picture."""

from __future__ import annotations

from rendergraph.api import Blend, Depth, InOut, Input, Internal, Radiance, State, Steps, param

from ._volumes import INSIDE_VOLUMES, CountsVolumes

_DARKEN = Blend("zero", "one_minus_src_alpha", "zero", "one")


class ShadowDarkening(CountsVolumes):
    """Darken a lit picture inside shadow volumes, with one full-screen quad per light.

    Lighting does not need to know about shadows, so this is simple and fast. It is not correct: it darkens all light
    alike, including highlights of other lights, and also surfaces that face away from the light.
    """

    depth = Input(Depth, doc="Depth of the opaque surfaces, from the pipeline's camera.")
    radiance = InOut(Radiance, doc="The lit picture.")
    marks = Internal(Depth, format="depth32f_stencil8", clear=0.0)

    strength: float = param(default=0.6, min=0, max=1, doc="Fraction of the radiance that a shadow removes.")

    def record(self, steps: Steps) -> None:
        """Record volumes and a quad for each light."""
        steps.fullscreen("<copy_depth.frag>", out=self.marks, depth=self.depth)
        for layer in range(len(self.lights(steps.facts))):
            self.count(steps, layer, self.marks, self.depth)
            steps.fullscreen(
                "shadow_darkening.frag",
                out={"radiance": self.radiance, "marks": self.marks},
                state=State(depth_test=False, depth_write=False, stencil=INSIDE_VOLUMES, blend=_DARKEN),
                region=layer,
                depth=self.depth,
            )
