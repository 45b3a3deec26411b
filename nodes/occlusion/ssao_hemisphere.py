"""Ambient occlusion from points in a hemisphere."""

from __future__ import annotations

from rendergraph.api import Internal, Steps, define, param

from ._kernel import spread_points
from ._screen_space import ScreenSpaceOcclusion, reduced_size


class SSAOHemisphere(ScreenSpaceOcclusion):
    """How open each surface is, from points in the hemisphere above it that are projected back onto the depth.

    The classic of 2007 (Mittring, "Finding Next Gen", 2007). A point that lies behind the surface seen at its place is
    taken to be inside something, and its direction to be blocked; how much falls with the difference of depth, from 1
    to 0 at four radii. Directions are spread by least energy, cosine-weighted, and reflected at a random vector of a
    64×64 noise texture, another at every pixel; along each lie one point within a fifth of the radius and three up to
    all of it, or up to where the direction leaves the picture. Four pixels share what they find, and a blur that stays
    on its surface takes the rest of the noise away.
    """

    noise = Internal(format="rgba16_snorm", size=(64, 64), kept=True)
    across = Internal(format="r16", size=reduced_size)
    blurred = Internal(format="r16", size=reduced_size)

    samples: int = define(default=32, min=8, max=128, doc="Points looked at, four a direction; rounded down to fours.")
    animated: bool = define(default=False, doc="Other directions in each frame, for `accumulate` to put together.")
    blur: int = param(
        default=4,
        unit="texels",
        min=0,
        max=16,
        doc="How far the blur reaches to each side, at `scale`, in steps of two; 0 leaves each pixel what it found.",
    )
    nearest: float = param(
        default=0.0, unit="m", min=0, doc="Surfaces nearer to the eye stay open: their hemispheres cover the screen."
    )

    def record(self, steps: Steps) -> None:
        """Surfaces, noise, occlusion, the blur's two axes, full size."""
        screen, sizes = self.screen(steps), self.sizes(steps)
        self.gather_surfaces(steps)
        steps.fullscreen("noise.frag", out=self.noise)
        steps.fullscreen(
            "ssao_hemisphere.frag",
            out=self.unfiltered,
            surfaces=self.surfaces,
            noise=self.noise,
            directions=spread_points(self.samples // 4).tolist(),
            screen=screen,
            defines=sizes,
        )
        target = self.target(steps, self.blurred)
        for source, out, axis in ((self.unfiltered, self.across, (1, 0)), (self.across, target, (0, 1))):
            steps.fullscreen(
                "bilateral_blur.frag",
                source=source,
                out=out,
                surfaces=self.surfaces,
                axis=axis,
                screen=screen,
                defines=sizes,
            )
        if sizes:
            self.upsample(steps, target, {"occlusion": self.occlusion}, {})
