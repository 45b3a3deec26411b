"""Shared by techniques that sample along directions on the screen, and average over blocks of pixels."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rendergraph.api import Internal, Port, Steps, define, param

from ._refined import RefinedOcclusion
from ._screen_space import ScreenSpaceOcclusion, reduced_size


class DirectionalSampling(ScreenSpaceOcclusion):
    """Base of the techniques that sample surfaces along directions on the screen, from near to far.

    Every pixel rotates its directions and jitters its steps in one of 16 ways, and 4×4 pixels on one surface share
    their results: a quad of four within the pass, and four such quads in the next pass. Some techniques compute a
    vector (indirect light or a bent normal) besides ambient visibility.
    """

    unfiltered = Internal(format="r16f", size=reduced_size)
    unfiltered_vector = Internal(format="rgba16f", size=reduced_size)
    averaged = Internal(format="r16", size=reduced_size)
    averaged_vector = Internal(format="rgba16f", size=reduced_size)

    samples: int = define(
        default=32, min=8, max=128, doc="Samples per pixel, rounded down to a whole number of directions."
    )
    animated: bool = define(
        default=False, doc="Sample different directions in each frame, which `accumulate` averages."
    )

    def plane_tolerance(self) -> float:
        """Return how far the texels of a plane may lie from it, in metres."""
        return 0.1 * self.radius

    def sample_and_filter(
        self,
        steps: Steps,
        fragment: str,
        out: Mapping[str, Port],
        *,
        has_vector: bool = False,
        denoise_passes: int = 0,
        defines: Mapping[str, int] | None = None,
        **reads: Any,
    ) -> None:
        """Record the surfaces, the sampling, the mean over blocks, the denoising and the upsampling.

        Args:
            steps: the recorder.
            fragment: the shader that samples.
            out: the node's outputs by their names in `outputs.glsl`.
            has_vector: whether the shader computes a vector besides ambient visibility.
            denoise_passes: passes of a filter over the vector; each reaches twice as far as the one before.
            defines: macros of all passes.
            reads: further inputs of the shader.
        """
        screen_size, size_defines = self.screen_size(steps), self.size_defines(steps)
        macros = {**(defines or {}), **({"HAS_VECTOR": 1} if has_vector else {})}
        mean = "block_mean.frag"
        if denoise_passes and "occlusion" not in out:  # visibility is not denoised, so it would show the pattern
            mean = "centered_mean.frag"
            macros["BLOCK_PATTERN"] = 1 << denoise_passes - 1  # the denoising averages as many blocks along each axis
        if has_vector:
            even, odd = self.averaged_vector, self.unfiltered_vector
        else:
            even, odd = self.averaged, self.unfiltered
        self.gather_surfaces(steps)
        steps.fullscreen(
            fragment,
            out=odd,
            surfaces=self.surfaces,
            screen_size=screen_size,
            defines={**macros, **size_defines},
            **reads,
        )
        passes: list[tuple[str, dict[str, Any]]] = [(mean, {"unfiltered": odd})]
        for number in range(denoise_passes):
            source = odd if number % 2 else even
            inputs = {"source": source, "stride": 2 << number, "tolerance": self.plane_tolerance()}
            passes.append(("atrous.frag", inputs))
        for number, (shader, values) in enumerate(passes):
            is_last = number == denoise_passes and not size_defines
            flags = {"FINAL": is_last, "KEEP_VISIBILITY": number > 0}
            steps.fullscreen(
                shader,
                out=dict(out) if is_last else {"filtered": odd if number % 2 else even},
                surfaces=self.surfaces,
                screen_size=screen_size,
                defines={**macros, **size_defines, **{flag: 1 for flag, is_set in flags.items() if is_set}},
                **values,
            )
        if size_defines:
            self.upsample(steps, odd if denoise_passes % 2 else even, out, macros)


class RefinedDirectionalSampling(RefinedOcclusion, DirectionalSampling):
    """Base of the techniques that work at two sizes, with no other filter than the mean over blocks."""

    marked = Internal(format="r32f", size=reduced_size)
    marked_vector = Internal(format="rgba16_snorm", size=reduced_size)
    interpolated = Internal(format="r16f", size="depth")
    interpolated_vector = Internal(format="rgba16f", size="depth")

    contrast: float = param(
        default=0.06,
        min=0,
        max=1,
        doc="With `refine`, the largest change of slope, over two reduced pixels on each side, that is interpolated.",
    )

    def sample_and_filter(
        self,
        steps: Steps,
        fragment: str,
        out: Mapping[str, Port],
        *,
        has_vector: bool = False,
        defines: Mapping[str, int] | None = None,
        **reads: Any,
    ) -> None:
        """Record surfaces, sampling and mean at the reduced size, then the latter two at full size where needed."""
        if not self.refines(steps):
            super().sample_and_filter(steps, fragment, out, has_vector=has_vector, defines=defines, **reads)
            return
        macros = {**(defines or {}), **({"HAS_VECTOR": 1} if has_vector else {})}
        if has_vector:
            unfiltered, averaged = self.unfiltered_vector, self.averaged_vector
            marked, interpolated = self.marked_vector, self.interpolated_vector
        else:
            unfiltered, averaged, marked, interpolated = self.unfiltered, self.averaged, self.marked, self.interpolated
        screen: dict[str, Any] = {"screen_size": self.screen_size(steps)}
        self.gather_surfaces(steps)
        sparse = {**screen, **self.sparse(steps, macros)}
        steps.fullscreen(fragment, out=unfiltered, **sparse, **reads)
        steps.fullscreen("centered_mean.frag", out={"filtered": averaged}, unfiltered=unfiltered, **sparse)
        steps.fullscreen("curvature.frag", out={"marked": marked}, source=averaged, **self.sparse(steps, macros))
        self.interpolate(steps, "interpolate.frag", marked, {**out, "interpolated": interpolated}, macros)
        steps.fullscreen(fragment, defines=macros, **self.masked({"unfiltered": interpolated}), **screen, **reads)
        final = {**macros, "FINAL": 1}
        steps.fullscreen("block_mean.frag", unfiltered=interpolated, defines=final, **self.masked(out), **screen)
