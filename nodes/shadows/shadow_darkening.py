"""Shadows laid over a picture that is lit already."""

from __future__ import annotations

from rendergraph.api import Blend, Depth, InOut, Input, Internal, Radiance, State, Steps, param

from ._volumes import IN_SHADOW, CountsVolumes

_DARKEN = Blend("zero", "one_minus_src_alpha", "zero", "one")


class ShadowDarkening(CountsVolumes):
    """A picture made darker wherever a shadow volume is: one quad over the screen for each light.

    The quick way: the lighting need know nothing of shadows. It is not right, as it darkens light of all kinds alike,
    highlights of other lights and faces turned away included.
    """

    depth = Input(Depth, doc="Depth of the opaque surfaces, seen by the pipeline's camera.")
    radiance = InOut(Radiance, doc="The lit picture.")
    marks = Internal(Depth, format="depth32f_stencil8", clear=0.0)

    strength: float = param(default=0.6, min=0, max=1, doc="Share of the radiance that shadow takes away.")

    def record(self, steps: Steps) -> None:
        """Volumes and a quad by turns."""
        steps.fullscreen("<copy_depth.frag>", out=self.marks, depth=self.depth)
        for layer in range(len(self.lights(steps.facts))):
            self.count(steps, layer, self.marks, self.depth)
            steps.fullscreen(
                "shadow_darkening.frag",
                out={"radiance": self.radiance, "marks": self.marks},
                state=State(depth_test=False, depth_write=False, stencil=IN_SHADOW, blend=_DARKEN),
                region=layer,
                depth=self.depth,
            )
