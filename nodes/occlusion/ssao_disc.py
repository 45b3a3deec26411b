"""Ambient occlusion from a disc on the screen."""

from __future__ import annotations

from rendergraph.api import Steps

from ._arms import ArmOcclusion


class SSAODisc(ArmOcclusion):
    """How open each surface is, from the surfaces seen in a disc around it on the screen.

    Positions are reconstructed, and each sample counts as a disc in space that hides some of the sky (Bunnell,
    "Dynamic Ambient Occlusion and Indirect Lighting", 2005). Along each arm a disc that lies behind nearer ones, seen
    from the receiver, hides nothing more: he takes a second pass to find that out.

    A face turned away is the far side of something solid: a disc behind it stands for the near side, which is not seen.
    """

    def record(self, steps: Steps) -> None:
        """Surfaces, occlusion, the neighbours' mean, full size."""
        self.look(steps, "discs.frag", {"occlusion": self.occlusion}, defines={"OPEN": 1})
