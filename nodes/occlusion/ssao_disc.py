"""Ambient occlusion from a disc on the screen."""

from __future__ import annotations

from rendergraph.api import Internal, Steps, define

from ._screen_space import ScreenSpaceOcclusion, reduced_size


class SSAODisc(ScreenSpaceOcclusion):
    """How open each surface is, from the surfaces seen in a disc around it on the screen.

    Positions are reconstructed, and each sample counts as a disc in space that hides some of the sky (Bunnell,
    "Dynamic Ambient Occlusion and Indirect Lighting", 2005). They lie on a spiral over the radius's projection, which
    keeps the answer when the eye moves. Every pixel turns the spiral in its own way, and 4×4 neighbours on one surface
    share what they find: on one spiral for all, samples that leave an edge together would draw bands.

    A face turned away is the far side of something solid: a disc behind it stands for the near side, which is not seen.
    """

    neighbours = Internal(format="r16", size=reduced_size)

    samples: int = define(default=32, min=8, max=128, doc="Surfaces looked at.")

    def record(self, steps: Steps) -> None:
        """Surfaces, occlusion, the neighbours' mean, full size."""
        screen, sizes = self.screen(steps), self.sizes(steps)
        self.gather_surfaces(steps)
        steps.fullscreen("ssao_disc.frag", out=self.unfiltered, surfaces=self.surfaces, screen=screen, defines=sizes)
        target = self.target(steps, self.neighbours)
        steps.fullscreen(
            "neighbours_mean.frag",
            out=target,
            unfiltered=self.unfiltered,
            surfaces=self.surfaces,
            screen=screen,
            defines=sizes,
        )
        self.upsample(steps, target)
