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
    """Reflect the lit picture in itself, in place of the environment's reflection.

    From each pixel a ray leaves in the mirror direction of the surface, and steps over the depth buffer until it passes
    behind a surface (McGuire and Mara 2014). What the picture shows there is reflected, blurred by the cone of the
    surface's roughness over the ray's length (Uludag 2014). The picture shows neither what is outside of it nor the
    backs of things: there, and up to the edges with a soft transition, the environment's reflection stays. Rays of any
    length and off the screen are those of `traced_reflections`.
    """

    depth = Input(Depth, group="gbuffer", doc="Window depth; positions come from it and its view.")
    normal = Input(Normal, group="gbuffer", doc="Unit normal, world space.")
    material = Input(Material, group="gbuffer", doc="Roughness in y.")
    environment_reflection = Input(Radiance, doc="What the environment shows in the specular lobe; it is replaced.")
    specular_albedo = Input(Reflectance, doc="Fraction of the reflected light that reaches the viewer.")
    direct_specular = Input(
        Radiance, optional=True, doc="Highlights of the lights, which are left out of what is reflected."
    )
    radiance = InOut(Radiance, doc="The lit picture, in which reflections are found and replaced.")

    lit = Internal(format="rgba16f", size="depth", mips=0, doc="A copy of the picture; its levels blur.")

    steps: int = define(default=48, min=4, max=512, doc="Steps of a ray over the screen.")
    reach: float = param(default=20.0, unit="m", min=1e-3, max=1e6, doc="Surfaces farther away are not reflected.")
    thickness: float = param(
        default=0.3, unit="m", min=1e-6, max=1e6, doc="How far behind a surface a ray may pass and still meet it."
    )
    max_roughness: float = param(
        default=0.6, min=0, max=1, doc="Rougher surfaces keep the environment's reflection; fades in from half of it."
    )
    fade: float = param(
        default=0.1, min=0, max=0.5, doc="Share of the picture's sides over which reflections of its edges fade out."
    )

    def record(self, steps: Steps) -> None:
        """Record the copy of the picture with its levels, and the rays."""
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
