"""Lighting of a G-buffer, local lights only where they reach."""

from __future__ import annotations

from typing import Any

from rendergraph.api import ADD, Depth, Internal, Output, Radiance, State, Stencil, StencilFace, Steps

from ._image_lighting import ImageLighting, samples_stored
from ._lighting import DIFFUSE

_SEGMENTS, _RINGS = 12, 8
_VERTICES = _SEGMENTS * _RINGS * 6


class DeferredStencilLights(ImageLighting):
    """Radiance of a G-buffer's surfaces, each point and spot light computed only on the pixels within its volume.

    The volume is a sphere around a point light and a sector of one around a spot light, as far as the light's range;
    without a range, as far as the picture reaches. Its faces behind the surface count up and down in the stencil, so
    that what is left marks the surface inside it, wherever the eye is (z-fail, Bilodeau and Songy 1999); then its back
    faces are drawn where that is not zero, and wipe it for the next light. Directional and ambient light take one pass
    over the whole picture. The cost is V + sum of F': `deferred_lighting` draws the same picture for V + L F.
    """

    radiance = Output(
        Radiance,
        format="rgba32f",
        samples=samples_stored,
        doc="Scene-linear radiance, float32: half floats would lose a step with every light. Alpha is coverage.",
    )
    diffuse = Output(Radiance, format="rgba32f", samples=samples_stored, doc=DIFFUSE)
    marks = Internal(Depth, format="depth32f_stencil8", samples=samples_stored, clear=0.0)

    def record(self, steps: Steps) -> None:
        """A pass for all that has no volume, two draws a local light, and what is blended."""
        super().record(steps)
        surface, shadows = self.surface(steps), self.shadows(steps)
        reads = {**surface, **shadows, **self.ambient_light(steps)}
        defines = {"DIRECTIONALS_ONLY": 1, **self.per_sample(steps), **self.backdrop_defines(steps)}
        steps.fullscreen("deferred_lighting.frag", out=self.pictures(steps), defines=defines, **reads)
        local = [number for number, light in enumerate(steps.lights) if light.type != "directional"]
        if local and self.wants_lights(steps):
            self._add_lights(steps, local, surface, shadows)
        self.blend_over(steps)

    def _add_lights(self, steps: Steps, local: list[int], surface: dict[str, Any], shadows: dict[str, Any]) -> None:
        # The stencil needs a depth of its own: a texture must not be attached and sampled at once.
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
                out={**self.pictures(steps), "marks": self.marks},
                state=lighting,
                defines={**shape, **self.per_sample(steps)},
                light=light,
                **surface,
                **shadows,
            )
