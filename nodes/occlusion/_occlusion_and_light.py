"""Shared by techniques that compute occlusion and indirect light in one pass."""

from __future__ import annotations

from collections.abc import Mapping

from rendergraph.api import Occlusion, Output, Port, Steps, param

from ._interreflection import Interreflection


class OcclusionAndLight(Interreflection):
    """Base of the techniques that compute occlusion and indirect light from one set of samples.

    Indirect light needs the lit picture, so occlusion comes too late for the lighting node. These nodes add ambient
    light themselves; the ambient light of the lighting node must be 0.
    """

    twin = "traced_occlusion_and_light"

    occlusion = Output(
        Occlusion, format="r16", size="depth", doc="Ambient visibility: 1 open, 0 occluded; 1 for background."
    )

    wider: float = param(default=5.0, min=1, max=100, doc="Radius of light, as a multiple of the radius of occlusion.")
    ambient: float | tuple[float, float, float] = param(
        default=0.03, min=0, glsl="vec3", doc="Radiance from all sides, a number or RGB, scaled by the occlusion."
    )

    def record_both(self, steps: Steps, fragment: str, defines: Mapping[str, int]) -> None:
        """Record the shader that computes both, and the reflection of light."""
        out: dict[str, Port] = {"indirect": self.indirect, "occlusion": self.occlusion}
        self.sample_and_filter(
            steps, fragment, out, has_vector=True, denoise_passes=self.denoise, defines=defines, diffuse=self.diffuse
        )
        self.reflect_indirect(steps, occlusion=self.occlusion, defines={"AMBIENT": 1})
