"""Ambient occlusion from points in a hemisphere."""

from __future__ import annotations

from typing import Any

from rendergraph.api import Internal, Port, Steps, define, param

from ._kernel import spread_points
from ._refined import RefinedOcclusion
from ._screen_space import reduced_size


class SSAOHemisphere(RefinedOcclusion):
    """Compute ambient occlusion from points in the hemisphere, projected onto the picture.

    The original screen-space ambient occlusion (Mittring, "Finding Next Gen", 2007). A point behind the surface at its
    texel is assumed to lie inside an object, and its ray to be occluded; occlusion decreases with the difference of
    depth, to 0 at four radii. Rays are evenly spread (by least energy) and cosine-weighted. Each pixel reflects them at
    another random vector of a 64×64 noise texture. Each ray has one point within a fifth of the radius, and three up to
    the radius, or to where the ray leaves the picture. Quads of four pixels are averaged, and a bilateral blur removes
    the remaining noise.

    By default a quarter of the pixels is computed, with 75 % more points, so that a blur over about the same area
    leaves as much noise. The other pixels are interpolated, or computed where interpolation would be visible.
    """

    noise = Internal(format="rgba16_snorm", size=(64, 64), kept=True)
    interpolated = Internal(format="r16", size="depth")
    blurred_x = Internal(format="r16", size=reduced_size)
    blurred = Internal(format="r16", size=reduced_size)

    samples: int = define(
        default=32, min=8, max=128, doc="Points per pixel, four per ray; rounded down to a multiple of four."
    )
    animated: bool = define(
        default=False, doc="Sample different directions in each frame, which `accumulate` averages."
    )
    blur: int = param(
        default=4,
        unit="texels",
        min=0,
        max=16,
        doc="Radius of the blur; with `refine`, three quarters as many texels of the reduced size. 0: no blur, and all "
        "pixels are computed.",
    )
    contrast: float = param(
        default=0.05,
        min=0,
        max=1,
        doc="With `refine`, the largest difference between reduced pixels that is interpolated.",
    )
    nearest: float = param(
        default=0.0,
        unit="m",
        min=0,
        doc="Surfaces closer to the camera are not occluded: their hemispheres cover the screen.",
    )

    def record(self, steps: Steps) -> None:
        """Record surfaces, noise, sampling, the two axes of the blur and the upsampling."""
        size_defines = self.size_defines(steps)
        self.gather_surfaces(steps)
        steps.fullscreen("random_vectors.frag", out=self.noise)
        unfiltered = {"unfiltered": self.unfiltered}
        if not self.refines(steps):
            target = self.reduced_target(steps, self.blurred)
            self._sample(steps, self.samples, out=unfiltered, surfaces=self.surfaces, defines=size_defines)
            self._blur(steps, (self.unfiltered, self.blurred_x, target), surfaces=self.surfaces, defines=size_defines)
            if size_defines:
                self.upsample(steps, target, {"occlusion": self.occlusion}, {})
            return
        reduced_samples = self.samples * 7 // 4
        self._sample(steps, reduced_samples, out=unfiltered, **self.sparse(steps, {"SAMPLES": reduced_samples}))
        self._blur(steps, (self.unfiltered, self.blurred_x, self.blurred), **self.sparse(steps))
        out = {"occlusion": self.occlusion, "interpolated": self.interpolated}
        self.interpolate(steps, "interpolate_contrast.frag", self.blurred, out)
        self._sample(steps, self.samples, **self.masked({"unfiltered": self.occlusion}))
        self._blur(steps, (self.occlusion, self.interpolated, self.occlusion), is_masked=True)

    def _sample(self, steps: Steps, samples: int, **options: Any) -> None:
        steps.fullscreen(
            "ssao_hemisphere.frag",
            noise=self.noise,
            directions=spread_points(samples // 4).tolist(),
            screen_size=self.screen_size(steps),
            **options,
        )

    def _blur(self, steps: Steps, ports: tuple[Port, Port, Port], *, is_masked: bool = False, **options: Any) -> None:
        """Record both axes of the blur; ports are source, intermediate and target."""
        for source, out, axis in ((*ports[:2], (1, 0)), (*ports[1:], (0, 1))):
            target: dict[str, Port] = {"blurred": out}
            targets: dict[str, Any] = self.masked(target) if is_masked else {"out": target}
            steps.fullscreen(
                "bilateral_blur.frag",
                source=source,
                axis=axis,
                screen_size=self.screen_size(steps),
                **targets,
                **options,
            )
