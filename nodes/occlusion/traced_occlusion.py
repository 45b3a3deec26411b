"""Ambient occlusion by rays."""

from __future__ import annotations

from typing import Any

from rendergraph.api import ADD, Input, Internal, Normal, Output, SceneData, State, Steps, define

from ._screen_space import ScreenSpaceOcclusion, reduced_size

_MOST_RAYS = 128  # per pixel and step: drivers limit the duration of a step, and llvmpipe the iterations of its loops


class TracedOcclusion(ScreenSpaceOcclusion):
    """Trace rays into the hemisphere: exact ambient occlusion.

    Visibility is the fraction of `samples` cosine-weighted rays that reach `radius` without hitting a surface (Zhukov,
    Iones and Kronin, "An Ambient Light Illumination Model", 1998). Unlike screen-space techniques, this node sees
    surfaces outside the picture and behind other surfaces. The result is not filtered: `animated` traces different rays
    in each frame, which `accumulate` averages, and `denoise` smooths a single frame. At a reduced `scale` fewer pixels
    are traced, and the others are interpolated.

    The node is the twin of the occlusion techniques, and replaces them with `-s ao.type=traced_occlusion`.
    """

    scene = Input(SceneData, rays=True, doc="The scene.")
    bent_normal = Output(
        Normal,
        format="rgba16_snorm",
        size="depth",
        doc="Unit vector, the mean unoccluded direction, world space; 0 for background.",
    )
    unfiltered_vector = Internal(format="rgba16f", size=reduced_size)
    rays = Internal(format="rgba32f", size=reduced_size, doc="Sum over steps, if the rays need several.")

    samples: int = define(default=16, min=1, max=1024, doc="Rays per pixel.")
    animated: bool = define(default=True, doc="Trace different rays in each frame, to be averaged over frames.")

    def record(self, steps: Steps) -> None:
        """Record the rays and the upsampling."""
        out: dict[str, Any] = {port.name: port for port in (self.occlusion, self.bent_normal) if steps.used(port)}
        reduced = self.size_defines(steps)
        macros = {**reduced, **({"HAS_VECTOR": 1} if self.bent_normal.name in out else {})}
        traced = self.unfiltered_vector if self.bent_normal.name in out else self.unfiltered
        reads: dict[str, Any] = {"scene": self.scene, "depth": self.depth, "normal": self.normal}
        reads["reduced_size"] = steps.desc(traced).size
        macros |= {} if reduced else {"FINAL": 1}
        if self.samples > _MOST_RAYS:
            for first in range(0, self.samples, _MOST_RAYS):
                steps.fullscreen(
                    "traced_occlusion.frag",
                    out={"rays": self.rays},
                    state=State(blend=ADD) if first else State(),
                    defines={**reduced, "FIRST_RAY": first, "PAST_RAY": min(first + _MOST_RAYS, self.samples)},
                    label=f"rays {first + 1} to {min(first + _MOST_RAYS, self.samples)}",
                    **reads,
                )
            macros["HAS_SUM"] = 1
            reads["sum"] = self.rays
        steps.fullscreen("traced_occlusion.frag", out={"filtered": traced} if reduced else out, defines=macros, **reads)
        if reduced:
            self.gather_surfaces(steps)
            self.upsample(steps, traced, out, macros)
