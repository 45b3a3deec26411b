"""Reflections by rays."""

from __future__ import annotations

from typing import Any

from rendergraph.api import (
    ADD,
    DROPPED,
    Depth,
    Input,
    Internal,
    Normal,
    Output,
    Reflections,
    SceneData,
    State,
    Steps,
    define,
    param,
)

from ..occlusion._screen_space import ReducedResolution, reduced_size
from ._lighting import Lighting

_MOST_RAYS = 80  # per pixel and step: drivers limit the duration of a step, and llvmpipe the iterations of its loops

_PLANE = 0.5  # metres; a pixel is interpolated from texels within a tenth of this from its plane


class TracedReflections(Lighting, ReducedResolution):
    """Trace rays in the directions that surfaces reflect to the viewer.

    Each of `samples` rays takes a direction from the surface's GGX lobe, by sampling the visible microfacet normals
    (Heitz 2018). The surface that it hits is lit as a lighting node would light it: by one of the lights, chosen by its
    share, with a shadow ray; by the environment; and by its own emission. A ray that hits nothing receives the light of
    the environment. Glass lets rays pass straight through, without refraction.

    Lighting nodes take `reflections` in place of the environment's specular light, weighted by the confidence in alpha.
    It is 1 up to a roughness of three quarters of `max_roughness` and falls to 0 at `max_roughness`; rougher surfaces
    trace no rays. The material comes from the scene, so the depth of a pre-pass is enough. `animated` traces different
    rays in each frame, which `accumulate` averages; `denoise` smooths a single frame. At a reduced `scale`, which needs
    `normal`, fewer pixels are traced, and the others are interpolated.
    """

    lookup = DROPPED
    air = DROPPED
    light_list = DROPPED

    scene = Input(SceneData, rays=True, doc="The scene.")
    depth = Input(Depth, doc="Window depth; positions come from it and its view.")
    normal = Input(Normal, optional=True, doc="Unit normal, world space; only for a reduced `scale`.")
    reflections = Output(
        Reflections,
        format="rgba16f",
        size="depth",
        doc="Radiance that arrives in the specular lobe, weighted by it; alpha is confidence, 0 for background.",
    )

    unfiltered_vector = Internal(format="rgba16f", size=reduced_size)

    samples: int = define(default=4, min=1, max=1024, doc="Rays per pixel.")
    max_roughness: float = param(
        default=1.0, min=0, max=1, doc="Surfaces rougher than this trace no rays; at 1, all surfaces do."
    )
    animated: bool = define(default=True, doc="Trace different rays in each frame, to be averaged over frames.")

    def ambient_reads(self, steps: Steps) -> dict[str, Any]:
        """Return the shader inputs for ambient lighting: the environment, and always the BRDF table."""
        return super().ambient_reads(steps) | {"brdf_table": self.brdf_table.sampled("linear")}

    def record(self, steps: Steps) -> None:
        """Record the BRDF table, the rays in several steps, and the upsampling."""
        super().record(steps)
        is_reduced = steps.connected(self.normal) and bool(self.size_defines(steps))
        macros = self.size_defines(steps) if is_reduced else {}
        target = self.unfiltered_vector if is_reduced else self.reflections
        for first in range(0, self.samples, _MOST_RAYS // 2):
            rays = min(_MOST_RAYS // 2, self.samples - first)
            steps.fullscreen(
                "traced_reflections.frag",
                out={"traced": target},
                state=State(blend=ADD) if first else State(),
                defines={**macros, "PASS_RAYS": rays},
                label=f"rays {first + 1} to {first + rays}",
                scene=self.scene,
                depth=self.depth,
                reduced_size=steps.desc(target).size,
                first_sample=first,
                **self.ambient_reads(steps),
            )
        if is_reduced:
            self.gather_surfaces(steps)
            self.upsample(steps, target, {"reflections": self.reflections}, {"HAS_VECTOR": 1}, radius=_PLANE)
