"""Deferred lighting with stencil light volumes."""

from __future__ import annotations

from typing import Any

from rendergraph.api import ADD, Depth, Internal, Output, Radiance, State, Stencil, StencilFace, Steps

from ._image_lighting import ImageLighting, gbuffer_samples
from ._lighting import DIFFUSE

_SEGMENTS, _RINGS = 12, 8
_VERTICES = _SEGMENTS * _RINGS * 6


class DeferredStencilLights(ImageLighting):
    """Light the surfaces of a G-buffer, evaluating each point and spot light only on the pixels within its volume.

    The volume is a sphere around a point light or a spherical sector around a spot light, with the light's range as
    radius, or without a range the extent of the view frustum. Its faces behind the surface increment and decrement the
    stencil, so that a nonzero value marks surfaces inside the volume, wherever the eye is (z-fail, Bilodeau and Songy
    1999). Then its back faces are drawn where the stencil is not zero, which also resets it for the next light.
    Directional and ambient light take one full-screen pass.

    The cost is V + ΣF', where V is the number of vertices and F' the number of visible pixels inside the volume of one
    light. `deferred_lighting` renders the same picture for V + L F, with L lights and F visible pixels.
    """

    radiance = Output(
        Radiance,
        format="rgba32f",
        samples=gbuffer_samples,
        doc="Scene-linear radiance; alpha is coverage. Float32, because half floats would be rounded after each light.",
    )
    diffuse = Output(Radiance, format="rgba32f", samples=gbuffer_samples, doc=DIFFUSE)
    marks = Internal(Depth, format="depth32f_stencil8", samples=gbuffer_samples, clear=0.0)

    def record(self, steps: Steps) -> None:
        """Record a pass for everything without a volume, two draws per local light, then transparent surfaces."""
        super().record(steps)
        gbuffer = self.gbuffer_reads(steps) | self.air_reads(steps)
        shadows = self.shadow_reads(steps)
        reads = gbuffer | self.direct_reads(steps) | self.ambient_reads(steps)
        defines = {"DIRECTIONALS_ONLY": 1, **self.per_sample(steps), **self.backdrop_defines(steps)}
        steps.fullscreen("deferred_lighting.frag", out=self.color_targets(steps), defines=defines, **reads)
        local = [number for number, light in enumerate(steps.lights) if light.type != "directional"]
        if local and self.wants_lights(steps):
            self._add_lights(steps, local, gbuffer, shadows)
        self.draw_backdrop_and_transparent(steps)

    def _add_lights(self, steps: Steps, local: list[int], gbuffer: dict[str, Any], shadows: dict[str, Any]) -> None:
        # The stencil is in a copy of the depth, because a texture must not be attached and sampled at the same time.
        steps.fullscreen("<copy_depth.frag>", out=self.marks, depth=self.depth)
        marking = State(
            cull="none",
            depth_write=False,
            depth_clamp=True,
            stencil=Stencil(StencilFace(depth_fail="decr_wrap"), StencilFace(depth_fail="incr_wrap")),
        )
        marked = StencilFace(func="notequal", depth_pass="zero")
        lighting = State(
            cull="front", depth_test=False, depth_write=False, depth_clamp=True, blend=ADD, stencil=Stencil(marked)
        )
        shape = {"SEGMENTS": _SEGMENTS, "RINGS": _RINGS}
        for light in local:
            steps.draw(
                None,
                vertex="light_volume.vert",
                vertices=_VERTICES,
                out=self.marks,
                state=marking,
                defines=shape,
                light=light,
                depth=self.depth,
            )
            steps.draw(
                "deferred_stencil_lights.frag",
                vertex="light_volume.vert",
                vertices=_VERTICES,
                out={**self.color_targets(steps), "marks": self.marks},
                state=lighting,
                defines={**shape, **self.per_sample(steps)},
                light=light,
                **gbuffer,
                **shadows,
            )
