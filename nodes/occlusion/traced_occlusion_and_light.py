"""Ambient occlusion and indirect light by the same rays."""

from __future__ import annotations

from rendergraph.api import Occlusion, Output, Steps, param

from .traced_interreflection import TracedInterreflection


class TracedOcclusionAndLight(TracedInterreflection):
    """Trace rays for ambient occlusion and for indirect light at once.

    The light is that of `traced_interreflection`, from surfaces within `wider` times the `radius` of occlusion. Like
    its twins, `ssao_ssgi` and `ssil`, this node adds ambient light itself, scaled by its occlusion; the ambient light
    of the lighting node must be 0.
    """

    twin = None

    occlusion = Output(
        Occlusion, format="r16", size="depth", doc="Ambient visibility: 1 open, 0 occluded; 1 for background."
    )

    radius: float = param(
        default=0.5, unit="m", min=1e-6, max=1e6, doc="Surfaces farther away than this do not occlude."
    )
    wider: float = param(default=5.0, min=1, max=100, doc="Radius of light, as a multiple of the radius of occlusion.")
    ambient: float | tuple[float, float, float] = param(
        default=0.03, min=0, glsl="vec3", doc="Radiance from all sides, a number or RGB, scaled by the occlusion."
    )

    def record(self, steps: Steps) -> None:
        """Record the rays, the filter, the upsampling, and the reflection of light."""
        self.trace_and_filter(steps, {"indirect": self.indirect, "occlusion": self.occlusion}, {"WIDER": 1})
        self.reflect_indirect(steps, occlusion=self.occlusion, defines={"AMBIENT": 1})
