"""Screen-space reflections."""

from __future__ import annotations

from typing import Any

from rendergraph.api import (
    ADD,
    Depth,
    InOut,
    Input,
    Internal,
    Material,
    Node,
    Normal,
    Radiance,
    Reflectance,
    State,
    Steps,
    define,
    param,
)

from ..display._mip_means import fill_mips


class SSR(Node):
    """Reflect the lit picture in its own surfaces, in place of the environment's reflection.

    From each pixel, a ray in the surface's mirror direction is marched over the depth buffer until it passes behind a
    surface (McGuire and Mara 2014). The picture at that point is reflected, blurred by the cone of the surface's
    roughness over the ray's length (Uludag 2014). The picture shows neither surfaces outside it nor back faces. Rays
    that would hit those keep the environment's reflection, with a soft transition at the picture's edges. For rays of
    any length, also off the screen, use `traced_reflections`.
    """

    depth = Input(Depth, group="gbuffer", doc="Window depth; positions come from it and its view.")
    normal = Input(Normal, group="gbuffer", doc="Unit normal, world space.")
    material = Input(Material, group="gbuffer", doc="Roughness in y.")
    environment_reflection = Input(Radiance, doc="The environment's radiance in the specular lobe, which is replaced.")
    specular_albedo = Input(Reflectance, doc="Fraction of the reflected light that reaches the viewer.")
    direct_specular = Input(Radiance, optional=True, doc="Highlights of the lights, which are left out of reflections.")
    radiance = InOut(Radiance, doc="The lit picture, which is reflected and to which reflections are added.")

    lit = Internal(
        format="rgba16f", size="depth", mips=0, doc="A copy of the picture; its mip levels blur reflections."
    )

    steps: int = define(default=48, min=4, max=512, doc="Steps of a ray over the screen.")
    reach: float = param(default=20.0, unit="m", min=1e-3, max=1e6, doc="Surfaces farther away are not reflected.")
    thickness: float = param(
        default=0.3, unit="m", min=1e-6, max=1e6, doc="How far behind a surface a ray may pass and still hit it."
    )
    max_roughness: float = param(
        default=0.6, min=0, max=1, doc="Rougher surfaces keep the environment's reflection; fades in from half of it."
    )
    fade: float = param(
        default=0.1, min=0, max=0.5, doc="Share of the picture's sides over which reflections fade out at its edges."
    )

    def record(self, steps: Steps) -> None:
        """Record the copy of the picture with its mip levels, and the rays."""
        reads: dict[str, Any] = (
            {"direct_specular": self.direct_specular} if steps.connected(self.direct_specular) else {}
        )
        out = self.lit.mip(0)
        steps.fullscreen("ssr_picture.frag", radiance=self.radiance, out={"lit": out}, label="picture", **reads)
        fill_mips(steps, self.lit, "picture")
        steps.fullscreen(
            "ssr.frag",
            out={"change": self.radiance},
            state=State(blend=ADD, color_mask=(True, True, True, False)),
            lit=self.lit.sampled("trilinear"),
            depth=self.depth,
            normal=self.normal,
            material=self.material,
            environment_reflection=self.environment_reflection,
            specular_albedo=self.specular_albedo,
        )
