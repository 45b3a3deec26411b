"""Shared by techniques that compute some pixels at a reduced size, and the others at full size."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rendergraph.api import Depth, Internal, Port, State, Steps, structural

from ._screen_space import ScreenSpaceOcclusion


class RefinedOcclusion(ScreenSpaceOcclusion):
    """Base of the techniques that work at two sizes: a reduced one, and full size where that is not enough.

    Dual-resolution occlusion (Bavoil and Sainz, "Multi-Layer Dual-Resolution Screen-Space Ambient Occlusion", 2009).
    Reduced pixels sample the surfaces at full size. A pixel of the picture is interpolated from the four reduced ones
    around it that lie on its own surface. Where there is none, or they differ too much, a mask is set, and the
    technique's passes are drawn again over the mask. The mask is a depth buffer, so that the depth test discards blocks
    of pixels before the shader runs.
    """

    full_surfaces = Internal(format="rgba32f", size="depth", view="depth")
    refine_mask = Internal(Depth, format="depth16", size="depth")

    scale: float = structural(
        default=0.5,
        min=0.125,
        max=1,
        doc="Resolution relative to the picture's width and height; `refine` adds pixels at full size.",
    )
    refine: bool = structural(
        default=True, doc="At a reduced size, compute pixels at full size where interpolation is not enough."
    )

    def refines(self, steps: Steps) -> bool:
        """Return whether there are two sizes."""
        return self.refine and bool(self.size_defines(steps))

    def gather_surfaces(self, steps: Steps) -> None:
        """Record the pass that writes `surfaces`, or with two sizes `full_surfaces`."""
        if self.refines(steps):
            steps.fullscreen("surfaces.frag", out={"surfaces": self.full_surfaces}, **self.surface_inputs(steps))
        else:
            super().gather_surfaces(steps)

    def sparse(self, steps: Steps, defines: Mapping[str, int] | None = None) -> dict[str, Any]:
        """Return arguments of a step over reduced pixels that samples the surfaces at full size."""
        return {
            "surfaces": self.full_surfaces,
            "reduced_size": steps.desc(self.surfaces).size,
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
        """Record the interpolation of a reduced texture, and of the mask of pixels that must be computed.

        Args:
            steps: the recorder.
            fragment: the shader.
            source: a reduced texture, without noise.
            out: outputs by their names in `outputs.glsl`, and `interpolated`, which later passes filter.
            defines: macros of the shader.
        """
        steps.fullscreen(
            fragment,
            out={**out, "mask": self.refine_mask},
            state=State(depth_test=False),
            source=source,
            surfaces=self.full_surfaces,
            defines={**(defines or {}), "FINAL": 1},
        )

    def masked(self, out: Mapping[str, Port]) -> dict[str, Any]:
        """Return arguments of a step over the pixels in the mask."""
        state = State(depth_test=True, depth_write=False)
        return {"out": {**out, "mask": self.refine_mask}, "surfaces": self.full_surfaces, "state": state}
