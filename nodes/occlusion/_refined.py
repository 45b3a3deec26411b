"""What the occlusions share that compute few pixels of a picture and interpolate where those agree."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rendergraph.api import Depth, Internal, Port, State, Steps, structural

from ._screen_space import ScreenSpaceOcclusion


class RefinedOcclusion(ScreenSpaceOcclusion):
    """Base of the techniques that work at two sizes: reduced, and the picture's own where that does not do.

    Dual-resolution occlusion (Bavoil and Sainz, "Multi-Layer Dual-Resolution Screen-Space Ambient Occlusion", 2009).
    Reduced pixels look at the surfaces of the whole picture. A pixel of the picture takes the mean of the four around
    it that lie on its own surface; where none does, or they say too little, it is marked, and the technique's passes
    are drawn once more over what is marked. The marks are a depth: its test leaves out blocks of pixels before a shader
    begins.
    """

    whole = Internal(format="rgba32f", size="depth", view="depth")
    marks = Internal(Depth, format="depth16", size="depth")

    scale: float = structural(
        default=0.5,
        min=0.125,
        max=1,
        doc="Share of the picture's width and height it is computed at, where `refine` does not ask for all.",
    )
    refine: bool = structural(
        default=True, doc="At a reduced size, compute all pixels that reduced ones say too little about."
    )

    def refines(self, steps: Steps) -> bool:
        """Whether there are two sizes."""
        return self.refine and bool(self.sizes(steps))

    def gather_surfaces(self, steps: Steps) -> None:
        """Bring normals and distances into `surfaces`, and with two sizes the picture's into `whole` instead."""
        if self.refines(steps):
            steps.fullscreen("surfaces.frag", out={"surfaces": self.whole}, **self.gathered(steps))
        else:
            super().gather_surfaces(steps)

    def sparse(self, steps: Steps, defines: Mapping[str, int] | None = None) -> dict[str, Any]:
        """Arguments of a step over reduced pixels that look at the surfaces of the whole picture."""
        return {
            "surfaces": self.whole,
            "reduced": steps.desc(self.surfaces).size,
            "defines": {**(defines or {}), "SPARSE": 1},
        }

    def interpolate(
        self,
        steps: Steps,
        fragment: str,
        source: Port,
        out: Mapping[str, Port],
        defines: Mapping[str, int] | None = None,
    ) -> None:
        """Bring what is reduced to full size, and mark the pixels that it says too little about.

        Args:
            steps: what records it.
            fragment: the shader.
            source: a reduced texture, without noise.
            out: what is made of it, by the names in `finish.glsl`, and as `found` where the steps put what they filter.
            defines: what of it there is to make.
        """
        steps.fullscreen(
            fragment,
            out={**out, "marks": self.marks},
            state=State(depth_test=False),
            source=source,
            surfaces=self.whole,
            defines={**(defines or {}), "FINAL": 1},
        )

    def over_marked(self, out: Mapping[str, Port]) -> dict[str, Any]:
        """Arguments of a step over the pixels that `interpolate` has marked."""
        state = State(depth_test=True, depth_write=False)
        return {"out": {**out, "marks": self.marks}, "surfaces": self.whole, "state": state}
