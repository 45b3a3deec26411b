"""Ambient occlusion from a disc on the screen."""

from __future__ import annotations

from rendergraph.api import Steps, define

from ._screen_space import ScreenSpaceOcclusion


class SSAODisc(ScreenSpaceOcclusion):
    """How open each surface is, from the surfaces seen in a disc around it on the screen.

    Positions are reconstructed, and each sample counts as a disc in space that hides some of the sky (Bunnell,
    "Dynamic Ambient Occlusion and Indirect Lighting", 2005). The samples lie on the same spiral at every pixel: there
    is no noise, and so no blur. The disc covers the radius's projection, which keeps the answer when the eye moves.

    A face turned away is the far side of something solid: a disc behind it stands for the near side, which is not seen.
    """

    samples: int = define(default=32, min=8, max=128, doc="Surfaces looked at.")

    def record(self, steps: Steps) -> None:
        """Surfaces, occlusion, full size."""
        self.see(steps)
        target = self.target(steps, self.rough)
        steps.fullscreen("ssao_disc.frag", out=target, surfaces=self.surfaces, screen=self.screen(steps))
        self.finish(steps, target)
