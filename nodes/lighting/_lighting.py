"""What every lighting node can be told."""

from __future__ import annotations

from typing import Any, Literal

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
DIFFUSE = "The same radiance without its specular part: what lights other surfaces."


class Lighting(Node):
    """Base of the nodes that turn surfaces into radiance: the shading model, its terms, shadows to look up."""

    lookup = Input(ShadowLookup, kind="function", many=True, optional=True, doc="Shadows to look up in place.")
    environment = Input(
        EnvironmentLight, kind="function", optional=True, doc="Light from all around, in place of `ambient`."
    )
    brdf_table = Internal(
        format="rg16",
        size=(64, 64),
        kept=True,
        doc="How much of an even light is mirrored, over the root of N·V and roughness.",
    )

    shading: Literal["unlit", "phong", "blinn_phong", "anisotropic", "pbr"] | str = define(
        default="pbr",
        doc="How surfaces reflect: Cook-Torrance (`pbr`), with the formulas of a grain alone, or an empirical model.",
        choices="shading",
        needs=("nothing", "phong", "grain", "grain_where_any"),
    )
    smith: Literal["exact", "fast"] = define(
        default="exact", doc="Masking of `pbr`: Smith's, or a fit without roots. What has a grain always has Smith's."
    )
    terms: Literal["all", "ambient", "diffuse", "specular", "emissive"] = define(
        default="all", doc="One term alone, to look at; the four sum to the whole."
    )
    ambient: Color = param(
        default=0.03,
        min=0,
        glsl="vec3",
        unless="environment",
        doc="Radiance from all sides, a number or RGB; an environment takes its place.",
    )
    environment_part: Literal["all", "diffuse", "specular", "table"] = define(
        default="all",
        doc="One part of the environment's light alone, to look at: `table` has its two factors of f0 and f90.",
    )
    multiple_scattering: bool = define(
        default=True, doc="Light of the environment that leaves rough surfaces after more than one reflection."
    )
    specular_occlusion: bool = define(
        default=True, doc="What hides the environment hides less of its mirror image on smooth surfaces."
    )

    def wants_lights(self, steps: Steps) -> bool:
        """Whether punctual lights show in the picture at all."""
        return "nothing" not in steps.needs("shading") and self.terms in ("all", "diffuse", "specular")

    def record(self, steps: Steps) -> None:
        """The table of what surfaces mirror, where they mirror an environment."""
        if "brdf_table" in self.around(steps):
            steps.fullscreen("brdf_table.frag", out=self.brdf_table, defines={"TABLE_SAMPLES": 512}, label="table")

    def around(self, steps: Steps) -> dict[str, Any]:
        """What a shader reads for light from all around: the environment, where one is connected and shows."""
        needs = steps.needs("shading")
        if not steps.connected(self.environment) or "nothing" in needs or self.terms not in ("all", "ambient"):
            return {}
        # The empirical models take its diffuse part alone.
        table = {} if "phong" in needs else {"brdf_table": self.brdf_table.sampled("linear")}
        return {"environment": self.environment, **table}

    def lights_of(self, steps: Steps, shadows: Port) -> dict[str, Any]:
        """What a shader reads that lights surfaces while they are drawn: what is around, and shadows to look up."""
        return self.around(steps) | ({"lookup": shadows} if self.wants_lights(steps) else {})

    def blend(
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
        """Light surfaces with alpha blending and lay them over the picture, far to near.

        Args:
            steps: what records it.
            out: the picture, and its depth where that is attached to be written by others.
            shadows: an input of functions.
            depth: what they are tested against, where `out` has none.
            view: what carries the view they are seen with; the node's `view` input or the camera by default.
            fragment, vertex, geometry, in_place: shaders, and whether these draw objects where they are.
        """
        reads: dict[str, Any] = self.lights_of(steps, shadows) | ({} if depth is None else {"depth": depth})
        reads = reads or {"lookup": shadows}  # a step that names nothing would read everything
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
    """Base of the nodes that make a whole picture: opaque surfaces, then those with alpha blending.

    What is known of the opaque surface of a pixel alone, visibility and occlusion, says nothing of a surface before it.
    """

    visibility = Input(
        Visibility, kind="texture2d_array", many=True, optional=True, doc="Shadows in screen space, one layer a light."
    )
    occlusion = Input(Occlusion, optional=True, doc="Scales the ambient light: 1 open, 0 closed.")
    blended_lookup = Input(
        ShadowLookup,
        kind="function",
        many=True,
        optional=True,
        doc="Shadows on surfaces with alpha blending, where those on the others are not looked up.",
    )

    backdrop: bool = structural(
        default=True, doc="Show the environment where no surface is, unless there is a `background`."
    )
    backdrop_blur: float = param(
        default=0.0,
        min=0,
        max=1,
        doc="How blurred the environment is that shows: as a surface of this roughness has it.",
    )
    blended: bool = structural(
        default=True, doc="Draw surfaces with alpha blending too; otherwise a `forward_transparent` may."
    )

    def pictures(self, steps: Steps) -> dict[str, Port]:
        """What is lit, and without its specular part where somebody reads that."""
        ports = self.outputs()
        wanted = ("radiance", "diffuse") if steps.used(ports["diffuse"]) else ("radiance",)
        return {name: ports[name] for name in wanted}

    def lay_under(self, steps: Steps, view: Port | None = None) -> None:
        """Show the environment where the picture is not covered yet.

        Args:
            steps: what records it.
            view: what carries the view it is seen with; the node's `view` input or the camera by default.
        """
        if shows_environment(self, steps.facts):
            steps.draw(
                "backdrop.frag",
                vertex="<fullscreen.vert>",
                vertices=3,
                out=self.pictures(steps),
                view=view,
                state=State(blend=UNDER, cull="none"),
                environment=self.environment,
                defines={"BLURRED": 1} if self.backdrop_blur > 0 else {},
                label="backdrop",
            )

    def shadows_on_blended(self, steps: Steps) -> Port:
        """The shadows of surfaces with alpha blending."""
        return self.blended_lookup if steps.connected(self.blended_lookup) else self.lookup


def shows_environment(node: SurfaceLighting, facts: Facts) -> bool:
    """Whether the environment shows where nothing is: there is one, and no other background is asked for."""
    background = getattr(node, "background", 0.0)
    plain = any(background) if isinstance(background, tuple) else background
    return not plain and node.backdrop and facts.connected("environment") and node.terms in ("all", "ambient")


def background_texel(node: GeometryLighting, facts: Facts) -> tuple[float, ...]:
    """What a picture of radiance holds where nothing is: the node's background, covered by nothing."""
    if shows_environment(node, facts):
        return 0.0, 0.0, 0.0, 0.0
    rgb = node.background if isinstance(node.background, tuple) else (node.background,) * 3
    return *rgb, 0.0


def samples_drawn(node: GeometryLighting, facts: Facts) -> int:
    """The samples of what is drawn and lit: the node's own, or those of the depth that it is tested against."""
    tested = facts.input("depth").desc if facts.connected("depth") and node.samples == 1 else None
    return node.samples if tested is None else tested.samples


class GeometryLighting(SurfaceLighting):
    """Base of the nodes that light while the geometry is drawn.

    `record` draws what is opaque by `light_opaque`, as often as the technique takes, and ends with `blend_after`.
    """

    view = Input(View, kind="view", optional=True, doc="What it is seen from; the pipeline's camera by default.")
    depth = Input(Depth, use="depth_test", optional=True, doc="Depth of a pre-pass, tested and not written.")
    radiance = Output(
        Radiance,
        format="rgba16f",
        clear=background_texel,
        samples=samples_drawn,
        doc="Scene-linear radiance; alpha is coverage, 1 where an opaque surface is and 0 where nothing is.",
    )
    diffuse = Output(Radiance, format="rgba16f", clear=background_texel, samples=samples_drawn, doc=DIFFUSE)
    surface_depth = Output(
        Depth,
        format="depth32f",
        clear=0.0,
        samples=samples_drawn,
        doc="Depth of the nearest opaque surface, where no pre-pass is connected.",
    )

    background: Color = structural(default=0.0, min=0, doc="Radiance where nothing is, a number or RGB.")
    samples: Samples = structural(
        default=1, doc="Samples a pixel: edges of triangles smooth, light computed once a pixel. 1: those of `depth`."
    )

    def targets(self, steps: Steps) -> dict[str, Port]:
        """What is drawn to: the picture, and its depth where no pre-pass has that."""
        depth = {} if steps.connected(self.depth) else {"surface_depth": self.surface_depth}
        return {**self.pictures(steps), **depth}

    def light_opaque(self, steps: Steps, fragment: str, **options: Any) -> None:
        """Draw opaque surfaces, lit with what is connected.

        Args:
            steps: what records it.
            fragment: the shader of fragments.
            options: what else `steps.geometry` takes, such as what it reads beside depth, shadows and occlusion.
        """
        connected = [port for port in (self.depth, self.visibility, self.occlusion) if steps.connected(port)]
        reads: dict[str, Any] = {port.name: port for port in connected}
        # `lookup` in any case: a step that names nothing would read everything.
        steps.geometry(fragment, out=self.targets(steps), objects="opaque", lookup=self.lookup, **reads, **options)

    def blend_after(self, steps: Steps, **shaders: Any) -> None:
        """The environment behind the opaque surfaces that have been drawn, and those with alpha blending over both."""
        self.lay_under(steps)
        if self.blended:
            depth = self.depth if steps.connected(self.depth) else None
            self.blend(steps, self.targets(steps), self.shadows_on_blended(steps), depth, **shaders)
