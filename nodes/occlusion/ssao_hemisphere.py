"""Ambient occlusion from points in a hemisphere."""

from __future__ import annotations

from typing import Any

from rendergraph.api import Internal, Port, Steps, define, param

from ._kernel import spread_points
from ._refined import RefinedOcclusion
from ._screen_space import reduced_size


class SSAOHemisphere(RefinedOcclusion):
    """How open each surface is, from points in the hemisphere above it that are projected back onto the depth.

    The classic of 2007 (Mittring, "Finding Next Gen", 2007). A point that lies behind the surface seen at its place is
    taken to be inside something, and its direction to be blocked; how much falls with the difference of depth, from 1
    to 0 at four radii. Directions are spread by least energy, cosine-weighted, and reflected at a random vector of a
    64×64 noise texture, another at every pixel; along each lie one point within a fifth of the radius and three up to
    all of it, or up to where the direction leaves the picture. Four pixels share what they find, and a blur that stays
    on its surface takes the rest of the noise away.

    By itself a quarter of the pixels does so, with three quarters more points, which leaves as much noise after a blur
    of about the same span. The others are interpolated, and computed where that would show.
    """

    noise = Internal(format="rgba16_snorm", size=(64, 64), kept=True)
    between = Internal(format="r16", size="depth")
    across = Internal(format="r16", size=reduced_size)
    blurred = Internal(format="r16", size=reduced_size)

    samples: int = define(default=32, min=8, max=128, doc="Points looked at, four a direction; rounded down to fours.")
    animated: bool = define(default=False, doc="Other directions in each frame, for `accumulate` to put together.")
    blur: int = param(
        default=4,
        unit="texels",
        min=0,
        max=16,
        doc="How far the blur reaches to each side; with `refine` three quarters as many of the reduced size. 0 leaves "
        "each pixel what it found, and refines all.",
    )
    contrast: float = param(
        default=0.05, min=0, max=1, doc="What reduced pixels may differ by and still be interpolated; with `refine`."
    )
    nearest: float = param(
        default=0.0, unit="m", min=0, doc="Surfaces nearer to the eye stay open: their hemispheres cover the screen."
    )

    def record(self, steps: Steps) -> None:
        """Surfaces, noise, occlusion, the blur's two axes, full size."""
        sizes = self.sizes(steps)
        self.gather_surfaces(steps)
        steps.fullscreen("noise.frag", out=self.noise)
        found = {"unfiltered": self.unfiltered}
        if not self.refines(steps):
            target = self.target(steps, self.blurred)
            self._look(steps, self.samples, out=found, surfaces=self.surfaces, defines=sizes)
            self._blur(steps, (self.unfiltered, self.across, target), surfaces=self.surfaces, defines=sizes)
            if sizes:
                self.upsample(steps, target, {"occlusion": self.occlusion}, {})
            return
        more = self.samples * 7 // 4
        self._look(steps, more, out=found, **self.sparse(steps, {"SAMPLES": more}))
        self._blur(steps, (self.unfiltered, self.across, self.blurred), **self.sparse(steps))
        out = {"occlusion": self.occlusion, "found": self.between}
        self.interpolate(steps, "refine.frag", self.blurred, out)
        self._look(steps, self.samples, **self.over_marked({"unfiltered": self.occlusion}))
        self._blur(steps, (self.occlusion, self.between, self.occlusion), marked=True)

    def _look(self, steps: Steps, samples: int, **options: Any) -> None:
        steps.fullscreen(
            "ssao_hemisphere.frag",
            noise=self.noise,
            directions=spread_points(samples // 4).tolist(),
            screen=self.screen(steps),
            **options,
        )

    def _blur(self, steps: Steps, ports: tuple[Port, Port, Port], *, marked: bool = False, **options: Any) -> None:
        """Along both axes; ports are the source, what is between and the target."""
        for source, out, axis in ((*ports[:2], (1, 0)), (*ports[1:], (0, 1))):
            target: dict[str, Port] = {"blurred": out}
            where: dict[str, Any] = self.over_marked(target) if marked else {"out": target}
            steps.fullscreen(
                "bilateral_blur.frag", source=source, axis=axis, screen=self.screen(steps), **where, **options
            )
