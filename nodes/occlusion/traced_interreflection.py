"""Light between surfaces by rays."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

from rendergraph.api import ADD, DROPPED, EnvironmentMap, Input, SceneData, State, Steps, define, param, structural

from ._interreflection import Interreflection

_MOST_RAYS = 80  # per pixel and step: drivers limit the duration of a step, and llvmpipe the iterations of its loops


class TracedInterreflection(Interreflection):
    """Trace rays to other surfaces, and add the diffuse light that comes from them.

    Each of `samples` cosine-weighted rays that hits a surface within `radius` receives the diffuse light that this
    surface emits and reflects. The reflected light comes from the lights, one of which is chosen for each ray and
    tested with a shadow ray; from the sky, with one more ray; and, if `bounces` is above 1, from further surfaces. The
    sky is the scene's environment, or the constant `sky`. Glass lets light pass straight through, and a coat attenuates
    it. Unlike screen-space techniques, this node sees surfaces outside the picture and behind other surfaces.
    `diffuse`, the light in the picture, is read only with `reuse`: it then provides the light of surfaces that the
    picture shows, which saves rays.

    `animated` traces different rays in each frame, to be averaged over frames; `denoise` filters a single frame. At a
    reduced `scale` fewer pixels are traced, and the others are interpolated. The node is the twin of the
    interreflection techniques, and replaces them with `-s gi.type=traced_interreflection`.
    """

    twin: ClassVar[str | None] = None

    occlusion = DROPPED
    scene = Input(SceneData, rays=True, doc="The scene.")
    map = Input(
        EnvironmentMap,
        size="any",
        filter="trilinear",
        wrap="repeat",
        optional=True,
        doc="The environment map, which replaces `sky`; the scene's by default.",
    )

    samples: int = define(default=16, min=1, max=1024, doc="Rays per pixel.")
    bounces: int = define(
        default=1, min=1, max=16, doc="Surfaces that light visits before it reaches those in the picture."
    )
    radius: float = param(
        default=2.5, unit="m", min=1e-6, max=1e6, doc="Surfaces farther away than this send no light."
    )
    sky: float | tuple[float, float, float] = param(
        default=0.03,
        min=0,
        glsl="vec3",
        doc="Radiance from all sides, a number or RGB, that the surfaces reflect; an environment replaces it.",
    )
    environment: bool = structural(default=True, doc="Take the light of the sky from the environment map, if any.")
    denoise: int = structural(
        default=0,
        min=0,
        max=5,
        doc="Passes of a filter over light on the same surface; each reaches twice as far as the previous one.",
    )
    reuse: bool = define(
        default=False,
        doc="Take the light of surfaces that the picture shows from `diffuse`, instead of tracing it.",
    )
    animated: bool = define(default=True, doc="Trace different rays in each frame, to be averaged over frames.")

    def record(self, steps: Steps) -> None:
        """Record the rays, the filter, the upsampling, and the reflection of light."""
        self.trace_and_filter(steps, {"indirect": self.indirect})
        self.reflect_indirect(steps)

    def trace_and_filter(self, steps: Steps, out: dict[str, Any], defines: Mapping[str, int] | None = None) -> None:
        """Record the rays in several steps, the filter and the upsampling.

        Args:
            steps: the recorder.
            out: the node's outputs by their names in `outputs.glsl`.
            defines: macros of the steps that trace rays.
        """
        reduced, screen_size = self.size_defines(steps), self.screen_size(steps)
        macros: dict[str, int] = {**reduced, "HAS_VECTOR": 1}
        is_final = not reduced and self.denoise == 0
        reads: dict[str, Any] = {"scene": self.scene, "depth": self.depth, "normal": self.normal}
        if self.environment and steps.connected(self.map):
            reads["map"] = self.map
        if self.reuse:
            reads["diffuse"] = self.diffuse
        at_once = max(1, _MOST_RAYS // (2 * self.bounces + 1))
        for first in range(0, self.samples, at_once):
            rays = min(at_once, self.samples - first)
            added = State(blend=ADD, color_mask=(True, True, True, not is_final))
            steps.fullscreen(
                "traced_interreflection.frag",
                out=out if is_final else {"filtered": self.unfiltered_vector},
                state=added if first else State(),
                defines={**macros, **(defines or {}), "PASS_RAYS": rays, **({"FINAL": 1} if is_final else {})},
                label=f"rays {first + 1} to {first + rays}",
                reduced_size=steps.desc(self.unfiltered_vector).size,
                first_sample=first,
                **reads,
            )
        if is_final:
            return
        self.gather_surfaces(steps)
        source, other = self.unfiltered_vector, self.averaged_vector
        for number in range(self.denoise):
            is_last = number == self.denoise - 1 and not reduced
            steps.fullscreen(
                "atrous.frag",
                out=out if is_last else {"filtered": other},
                source=source,
                surfaces=self.surfaces,
                screen_size=screen_size,
                stride=1 << number,
                tolerance=self.plane_tolerance(),
                defines={**macros, **({"FINAL": 1} if is_last else {})},
            )
            source, other = other, source
        if reduced:
            self.upsample(steps, source, out, macros)
