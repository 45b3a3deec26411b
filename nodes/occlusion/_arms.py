"""What the techniques share that look along lines on the screen: samples in arms, and neighbours that share them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rendergraph.api import Internal, Port, Steps, define, param

from ._refined import RefinedOcclusion
from ._screen_space import ScreenSpaceOcclusion, reduced_size


class ArmOcclusion(ScreenSpaceOcclusion):
    """Base of the techniques whose samples lie along arms, from near to far.

    Every pixel turns and stretches its arms in one of 16 ways, and 4×4 neighbours on one surface share what they find:
    four of them within the pass, four such quads in the next. Some find a vector beside the openness.
    """

    unfiltered = Internal(format="r16f", size=reduced_size)
    unfiltered_four = Internal(format="rgba16f", size=reduced_size)
    neighbours = Internal(format="r16", size=reduced_size)
    neighbours_four = Internal(format="rgba16f", size=reduced_size)

    samples: int = define(default=32, min=8, max=128, doc="Surfaces looked at; rounded down to whole arms.")
    animated: bool = define(default=False, doc="Other directions in each frame, for `accumulate` to put together.")

    def tolerance(self) -> float:
        """How far off a plane a neighbour may lie, in metres."""
        return 0.1 * self.radius

    def look(
        self,
        steps: Steps,
        fragment: str,
        out: Mapping[str, Port],
        *,
        four: bool = False,
        smooth: int = 0,
        defines: Mapping[str, int] | None = None,
        **reads: Any,
    ) -> None:
        """Surfaces, what a shader finds out, the neighbours' mean, full size.

        Args:
            steps: what records it.
            fragment: the shader.
            out: what is made of it, by the names in `finish.glsl`.
            four: it finds a vector, too.
            smooth: passes of a filter that takes the noise out of the vectors; each reaches twice as far.
            defines: macros of all passes.
            reads: what the shader reads beside the surfaces.
        """
        screen, sizes = self.screen(steps), self.sizes(steps)
        macros = {**(defines or {}), **({"FOUR": 1} if four else {})}
        mean = "neighbours_mean.frag"
        if smooth and "occlusion" not in out:  # the filter takes the noise of light alone
            mean = "even_mean.frag"
            macros["BLOCKS"] = 1 << smooth - 1  # as many blocks of 4×4 pixels as the filter averages along each axis
        found, small = (self.unfiltered_four, self.neighbours_four) if four else (self.unfiltered, self.neighbours)
        self.gather_surfaces(steps)
        steps.fullscreen(
            fragment, out=found, surfaces=self.surfaces, screen=screen, defines={**macros, **sizes}, **reads
        )
        passes: list[tuple[str, dict[str, Any]]] = [(mean, {"unfiltered": found})]
        for number in range(smooth):
            source = found if number % 2 else small
            reach = {"stride": 2 << number, "tolerance": self.tolerance()}
            passes.append(("atrous.frag", {"source": source, **reach}))
        for number, (shader, values) in enumerate(passes):
            last = number == smooth and not sizes
            marks = {"FINAL": last, "KEEP_OPENNESS": number > 0}
            steps.fullscreen(
                shader,
                out=dict(out) if last else {"mean": found if number % 2 else small},
                surfaces=self.surfaces,
                screen=screen,
                defines={**macros, **sizes, **{mark: 1 for mark, holds in marks.items() if holds}},
                **values,
            )
        if sizes:
            self.upsample(steps, found if smooth % 2 else small, out, macros)


class RefinedArms(RefinedOcclusion, ArmOcclusion):
    """Base of those of them that work at two sizes: whose neighbours' mean is all the filter there is."""

    bent = Internal(format="r32f", size=reduced_size)
    bent_four = Internal(format="rgba16_snorm", size=reduced_size)
    shared_later = Internal(format="r16f", size="depth")
    shared_later_four = Internal(format="rgba16f", size="depth")

    contrast: float = param(
        default=0.06,
        min=0,
        max=1,
        doc="What the slope of reduced pixels may change by and still be interpolated, over two of them to each side; "
        "with `refine`.",
    )

    def look(
        self,
        steps: Steps,
        fragment: str,
        out: Mapping[str, Port],
        *,
        four: bool = False,
        defines: Mapping[str, int] | None = None,
        **reads: Any,
    ) -> None:
        """Surfaces, what a shader finds out and the neighbours' mean at a reduced size, and again what that lacks."""
        if not self.refines(steps):
            super().look(steps, fragment, out, four=four, defines=defines, **reads)
            return
        macros = {**(defines or {}), **({"FOUR": 1} if four else {})}
        found, small = (self.unfiltered_four, self.neighbours_four) if four else (self.unfiltered, self.neighbours)
        bent, later = (self.bent_four, self.shared_later_four) if four else (self.bent, self.shared_later)
        screen: dict[str, Any] = {"screen": self.screen(steps)}
        self.gather_surfaces(steps)
        few = {**screen, **self.sparse(steps, macros)}
        steps.fullscreen(fragment, out=found, **few, **reads)
        steps.fullscreen("even_mean.frag", out={"mean": small}, unfiltered=found, **few)
        steps.fullscreen("bend.frag", out={"bent": bent}, source=small, **self.sparse(steps, macros))
        self.interpolate(steps, "between.frag", bent, {**out, "found": later}, macros)
        steps.fullscreen(fragment, defines=macros, **self.over_marked({"unfiltered": later}), **screen, **reads)
        final = {**macros, "FINAL": 1}
        steps.fullscreen("neighbours_mean.frag", unfiltered=later, defines=final, **self.over_marked(out), **screen)
