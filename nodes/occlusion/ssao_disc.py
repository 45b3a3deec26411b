"""Ambient occlusion from a disc on the screen."""

from __future__ import annotations

from typing import Literal

from rendergraph.api import Steps, define, param, structural

from ._directional import RefinedDirectionalSampling


class SSAODisc(RefinedDirectionalSampling):
    """Compute ambient occlusion from samples in a disc on the screen.

    Each sample stands for a strip of its surface, from halfway to the previous sample to halfway to the next one, and
    `thickness` deep. The occlusion of a strip has a closed form (Jimenez et al., "Practical Real-Time Strategies for
    Accurate Indirect Occlusion", 2016), and parts that earlier strips already occlude count once.

    With `form: disc` a sample stands for a disc in space (Bunnell, "Dynamic Ambient Occlusion and Indirect Lighting",
    2005). Discs hidden by nearer ones in the same direction occlude nothing; surfaces near the tangent plane occlude
    too much, and the occlusion of large near surfaces is limited.
    """

    samples: int = define(
        default=16, min=8, max=128, doc="Samples per pixel, rounded down to a whole number of directions."
    )
    form: Literal["strip", "disc"] = structural(
        default="strip", doc="What a sample stands for: a strip of a slice, or a disc in space."
    )
    thickness: float = param(default=0.6, min=0, max=1e6, doc="Thickness of all surfaces, in radii; discs ignore it.")

    def record(self, steps: Steps) -> None:
        """Record sampling and filtering."""
        defines = {"OCCLUSION": 1} | ({"BUNNELL": 1} if self.form == "disc" else {})
        self.sample_and_filter(steps, "discs.frag", {"occlusion": self.occlusion}, defines=defines)
