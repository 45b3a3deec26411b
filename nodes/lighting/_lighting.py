"""Inputs, parameters and steps that all lighting nodes share."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING, Any, Literal

from rendergraph.api import (
    PREMULTIPLIED,
    Blend,
    Depth,
    EnvironmentLight,
    Facts,
    Input,
    Internal,
    Node,
    Occlusion,
    Output,
    Part,
    Port,
    Radiance,
    ShadowLookup,
    State,
    Steps,
    View,
    Visibility,
    define,
    param,
    structural,
)

from ..geometry._samples import Samples

UNDER = Blend("one_minus_dst_alpha", "one")
Color = float | tuple[float, float, float]
_OLD_METHODS = {
    "around": "environment_reads",
    "ambient_light": "ambient_reads",
    "blend": "draw_transparent",
    "blend_after": "draw_backdrop_and_transparent",
    "blend_over": "draw_backdrop_and_transparent",
    "lay_under": "draw_backdrop",
    "light_opaque": "draw_opaque",
    "lights_of": "lighting_reads",
    "pictures": "color_targets",
    "shadows": "shadow_reads",
    "shadows_on_blended": "transparent_shadows",
    "surface": "gbuffer_reads",
}
DIFFUSE = "The same radiance without the specular part, which lights other surfaces."


class Lighting(Node):
    """Base of the lighting nodes: the shading model and its terms, shadows and the environment."""

    lookup = Input(
        ShadowLookup, kind="function", many=True, optional=True, doc="Shadow functions, evaluated per fragment."
    )
    environment = Input(
        EnvironmentLight, kind="function", optional=True, doc="Light of the environment, which replaces `ambient`."
    )
    brdf_table = Internal(
        format="rg16",
        size=(64, 64),
        kept=True,
        doc="Split-sum BRDF factors of f0 and f90, over sqrt(N·V) and roughness.",
    )

    shading: Literal["unlit", "phong", "blinn_phong", "anisotropic", "pbr"] | str = define(
        default="pbr",
        doc="Shading model: Cook-Torrance (`pbr`), always with its anisotropic formulas, or an empirical model.",
        choices="shading",
        needs=("nothing", "phong", "grain", "grain_where_any"),
    )
    smith: Literal["exact", "fast"] = define(
        default="exact",
        doc="Visibility term of `pbr`: Smith, or a fit without square roots. Anisotropic surfaces use Smith.",
    )
    terms: Literal["all", "ambient", "diffuse", "specular", "emissive"] = define(
        default="all", doc="Show a single term; the four terms add up to `all`."
    )
    ambient: Color = param(
        default=0.03,
        min=0,
        glsl="vec3",
        unless="environment",
        doc="Constant ambient radiance, a number or RGB; an environment replaces it.",
    )
    environment_part: Literal["all", "diffuse", "specular", "table"] = define(
        default="all",
        doc="Show a single part of the environment's light; `table` shows the BRDF factors of f0 and f90.",
    )
    multiple_scattering: bool = define(
        default=True,
        doc="Add environment light that is scattered several times between the microfacets of rough surfaces.",
    )
    specular_occlusion: bool = define(
        default=True, doc="Occlude the specular environment light less than the diffuse one on smooth surfaces."
    )

    if not TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any:
            """Return a method by its old name, for plugins that extend a lighting node, with a warning."""
            if name not in _OLD_METHODS:
                raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")
            warnings.warn(f"`{name}` is now called `{_OLD_METHODS[name]}`", DeprecationWarning, stacklevel=2)
            return getattr(self, _OLD_METHODS[name])

    def wants_lights(self, steps: Steps) -> bool:
        """Return whether punctual lights contribute to the picture."""
        return "nothing" not in steps.needs("shading") and self.terms in ("all", "diffuse", "specular")

    def record(self, steps: Steps) -> None:
        """Record the BRDF table, if surfaces reflect an environment."""
        if "brdf_table" in self.environment_reads(steps):
            steps.fullscreen("brdf_table.frag", out=self.brdf_table, defines={"TABLE_SAMPLES": 512}, label="table")

    def environment_reads(self, steps: Steps) -> dict[str, Any]:
        """Return what a shader reads for environment lighting; nothing if it would not contribute."""
        needs = steps.needs("shading")
        if not steps.connected(self.environment) or "nothing" in needs or self.terms not in ("all", "ambient"):
            return {}
        # The empirical models use only its diffuse part.
        table = {} if "phong" in needs else {"brdf_table": self.brdf_table.sampled("linear")}
        return {"environment": self.environment, **table}

    def lighting_reads(self, steps: Steps, shadows: Port) -> dict[str, Any]:
        """Return what a shader reads that lights geometry while drawing it: the environment and shadow functions."""
        return self.environment_reads(steps) | ({"lookup": shadows} if self.wants_lights(steps) else {})

    def draw_transparent(
        self,
        steps: Steps,
        out: dict[str, Port],
        shadows: Port,
        depth: Port | Part | None = None,
        view: Port | None = None,
        *,
        fragment: str = "forward_lighting.frag",
        vertex: str = "<geometry.vert>",
        geometry: str | None = None,
        in_place: bool | None = None,
    ) -> None:
        """Light transparent surfaces and blend them over the picture, back to front.

        Args:
            steps: records the step.
            out: the picture, and its depth if another step of the node writes that.
            shadows: the input with shadow functions.
            depth: depth to test against, if `out` has none.
            view: a port that carries the view; by default the node's `view` input or the camera.
            fragment, vertex, geometry, in_place: shaders, and whether they leave objects in place.
        """
        reads: dict[str, Any] = self.lighting_reads(steps, shadows) | ({} if depth is None else {"depth": depth})
        reads = reads or {"lookup": shadows}  # a step without reads would read all inputs
        steps.geometry(
            fragment,
            vertex=vertex,
            geometry=geometry,
            in_place=in_place,
            out=out,
            objects="transparent",
            order="back_to_front",
            view=view,
            state=State(blend=PREMULTIPLIED, depth_write=False),
            **reads,
        )


class SurfaceLighting(Lighting):
    """Base of the nodes that light a whole picture: opaque surfaces first, then transparent ones.

    Screen-space visibility and occlusion are known only for the opaque surface of each pixel, so they do not apply to
    transparent surfaces in front of it.
    """

    visibility = Input(
        Visibility, kind="texture2d_array", many=True, optional=True, doc="Screen-space shadows, one layer per light."
    )
    occlusion = Input(Occlusion, optional=True, doc="Scales the ambient light: 1 is open, 0 fully occluded.")
    blended_lookup = Input(
        ShadowLookup,
        kind="function",
        many=True,
        optional=True,
        doc="Shadow functions for transparent surfaces, if opaque ones use `visibility`.",
    )

    backdrop: bool = structural(
        default=True, doc="Show the environment behind all surfaces, unless a `background` is set."
    )
    backdrop_blur: float = param(
        default=0.0,
        min=0,
        max=1,
        doc="Blur of the backdrop: the roughness of a surface that would reflect it so.",
    )
    blended: bool = structural(
        default=True, doc="Draw transparent surfaces, too; otherwise a `forward_transparent` can draw them."
    )

    def color_targets(self, steps: Steps) -> dict[str, Port]:
        """Return `radiance`, and `diffuse` if it is used."""
        ports = self.outputs()
        wanted = ("radiance", "diffuse") if steps.used(ports["diffuse"]) else ("radiance",)
        return {name: ports[name] for name in wanted}

    def draw_backdrop(self, steps: Steps, view: Port | None = None) -> None:
        """Show the environment where no surface covers the picture.

        Args:
            steps: records the step.
            view: a port that carries the view; by default the node's `view` input or the camera.
        """
        if shows_environment(self, steps.facts):
            steps.draw(
                "backdrop.frag",
                vertex="<fullscreen.vert>",
                vertices=3,
                out=self.color_targets(steps),
                view=view,
                state=State(blend=UNDER, cull="none"),
                environment=self.environment,
                defines={"BLURRED": 1} if self.backdrop_blur > 0 else {},
                label="backdrop",
            )

    def transparent_shadows(self, steps: Steps) -> Port:
        """Return the input with the shadow functions for transparent surfaces."""
        return self.blended_lookup if steps.connected(self.blended_lookup) else self.lookup


def shows_environment(node: SurfaceLighting, facts: Facts) -> bool:
    """Return whether the environment is the background: one is connected, and no other background is set."""
    background = getattr(node, "background", 0.0)
    plain = any(background) if isinstance(background, tuple) else background
    return not plain and node.backdrop and facts.connected("environment") and node.terms in ("all", "ambient")


def background_texel(node: GeometryLighting, facts: Facts) -> tuple[float, ...]:
    """Return the clear value of radiance: the node's background with a coverage of 0."""
    if shows_environment(node, facts):
        return 0.0, 0.0, 0.0, 0.0
    rgb = node.background if isinstance(node.background, tuple) else (node.background,) * 3
    return *rgb, 0.0


def rendered_samples(node: GeometryLighting, facts: Facts) -> int:
    """Return the sample count of the picture: the node's own, or that of the depth that it tests against."""
    tested = facts.input("depth").desc if facts.connected("depth") and node.samples == 1 else None
    return node.samples if tested is None else tested.samples


class GeometryLighting(SurfaceLighting):
    """Base of the forward lighting nodes, which light geometry while drawing it.

    `record` draws opaque surfaces with `draw_opaque`, in as many passes as the technique takes, and ends with
    `draw_backdrop_and_transparent`.
    """

    view = Input(View, kind="view", optional=True, doc="The view; the pipeline's camera by default.")
    depth = Input(Depth, use="depth_test", optional=True, doc="Depth of a pre-pass, tested but not written.")
    radiance = Output(
        Radiance,
        format="rgba16f",
        clear=background_texel,
        samples=rendered_samples,
        doc="Scene-linear radiance; alpha is coverage: 1 on opaque surfaces, 0 on the background.",
    )
    diffuse = Output(Radiance, format="rgba16f", clear=background_texel, samples=rendered_samples, doc=DIFFUSE)
    surface_depth = Output(
        Depth,
        format="depth32f",
        clear=0.0,
        samples=rendered_samples,
        doc="Depth of the nearest opaque surface, if no pre-pass is connected.",
    )

    background: Color = structural(default=0.0, min=0, doc="Radiance of the background, a number or RGB.")
    samples: Samples = structural(
        default=1,
        doc="Samples per pixel: smooth triangle edges, with lighting once per pixel. 1 takes those of `depth`.",
    )

    def targets(self, steps: Steps) -> dict[str, Port]:
        """Return the render targets: the picture, and its depth if there is no pre-pass."""
        depth = {} if steps.connected(self.depth) else {"surface_depth": self.surface_depth}
        return {**self.color_targets(steps), **depth}

    def draw_opaque(self, steps: Steps, fragment: str, **options: Any) -> None:
        """Draw and light opaque surfaces.

        Args:
            steps: records the step.
            fragment: the fragment shader.
            options: further arguments of `steps.geometry`, such as reads beside depth, shadows and occlusion.
        """
        connected = [port for port in (self.depth, self.visibility, self.occlusion) if steps.connected(port)]
        reads: dict[str, Any] = {port.name: port for port in connected}
        # `lookup` in any case: a step without reads would read all inputs.
        steps.geometry(fragment, out=self.targets(steps), objects="opaque", lookup=self.lookup, **reads, **options)

    def draw_backdrop_and_transparent(self, steps: Steps, **shaders: Any) -> None:
        """Draw the environment behind the opaque surfaces, then transparent surfaces over both."""
        self.draw_backdrop(steps)
        if self.blended:
            depth = self.depth if steps.connected(self.depth) else None
            self.draw_transparent(steps, self.targets(steps), self.transparent_shadows(steps), depth, **shaders)
