"""Ambient occlusion from a disc on the screen."""

from __future__ import annotations

from typing import Literal

from rendergraph.api import Steps, define, param, structural

from ._arms import RefinedArms


class SSAODisc(RefinedArms):
    """How open each surface is, from the surfaces seen in a disc around it on the screen.

    Positions are reconstructed, and each sample hides some of the sky. By itself it is a strip of its arm's slice: from
    half-way to the sample before, and from what is taken to lie behind, to half-way to the one after. What that hides
    has a closed form (Jimenez et al., "Practical Real-Time Strategies for Accurate Indirect Occlusion", 2016), and what
    a strip before has hidden already counts once.

    With `form: disc` it is a disc in space instead (Bunnell, "Dynamic Ambient Occlusion and Indirect Lighting", 2005).
    Discs that lie behind nearer ones of the arm hide nothing more; what is low over the horizon hides too much, and
    what is large and near is cut off.
    """

    samples: int = define(default=16, min=8, max=128, doc="Surfaces looked at; rounded down to whole arms.")
    form: Literal["strip", "disc"] = structural(
        default="strip", doc="What a sample stands for: a strip of a slice, or a disc in space."
    )
    thickness: float = param(
        default=0.6, min=0, max=1e6, doc="How far what is seen goes on behind, in radii; discs do not ask."
    )

    def record(self, steps: Steps) -> None:
        """Surfaces, occlusion, the neighbours' mean, full size."""
        form = {"BUNNELL": 1} if self.form == "disc" else {}
        self.look(steps, "discs.frag", {"occlusion": self.occlusion}, defines={"OPEN": 1, **form})
