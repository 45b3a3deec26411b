"""Inputs, parameters and steps that all lighting nodes share."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Literal

from rendergraph.api import (
    PREMULTIPLIED,
    Air,
    Blend,
    Depth,
    EnvironmentLight,
    Facts,
    Frame,
    Input,
    Internal,
    Irradiance,
    LightList,
    Node,
    ObjectFacts,
    Occlusion,
    Output,
    Part,
    Port,
    Radiance,
    Reflectance,
    Reflections,
    Semantic,
    ShadowLookup,
    State,
    Steps,
    View,
    ViewMatrices,
    Views,
    Visibility,
    define,
    param,
    structural,
)

from ..display._mip_means import fill_mips
from ..geometry._samples import Samples
from ._mirror import ground_height, mirrored_view

UNDER = Blend("one_minus_dst_alpha", "one")
Color = float | tuple[float, float, float]


def has_layer(facts: Facts, *layers: str) -> bool:
    """Return whether the material of a drawn object has one of these layers."""
    return any(layer in placed.layers for placed in facts.objects if not placed.hidden for layer in layers)


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
DIFFUSE = "The same radiance without its specular part and without air: the light that reaches other surfaces."


class Lighting(Node):
    """Base of the lighting nodes: the shading model and its terms, shadows and the environment."""

    lookup = Input(
        ShadowLookup, kind="function", many=True, optional=True, doc="Shadow functions, evaluated per fragment."
    )
    environment = Input(
        EnvironmentLight, kind="function", optional=True, doc="Light of the environment, which replaces `ambient`."
    )
    air = Input(
        Air,
        kind="function",
        optional=True,
        doc="Air, such as fog, between the viewer and everything that the node draws, including the background.",
    )
    light_list = Input(
        LightList,
        kind="function",
        optional=True,
        doc="Lists of the lights that may reach a position. Unconnected: all lights light every surface.",
    )
    brdf_table = Internal(
        format=lambda node, facts: "rgba16" if has_layer(facts, "sheen") else "rg16",
        size=(64, 64),
        kept=True,
        doc="Split-sum BRDF factors of f0 and f90, over sqrt(N·V) and roughness.",
    )

    behind = Internal(
        format="rgba16f",
        mips=0,
        doc="The picture without the surfaces that transmit light, with mip levels.",
    )

    shading: Literal["unlit", "phong", "blinn_phong", "anisotropic", "pbr"] | str = define(
        default="pbr",
        doc="Shading model: Cook-Torrance (`pbr`), its anisotropic form for all surfaces, or an empirical model.",
        choices="shading",
        needs=("nothing", "phong", "grain", "grain_where_any"),
    )
    smith: Literal["exact", "fast"] = define(
        default="exact",
        doc="Visibility term of `pbr`: Smith, or a fit without square roots. Anisotropic surfaces use Smith.",
    )
    diffuse_lobe: Literal["lambert", "shared"] = define(
        default="lambert",
        doc="Diffuse lobe of `pbr`: reflects all light, or only the share that the specular lobe does not reflect.",
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
        default=True, doc="On smooth surfaces, occlude specular environment light less than diffuse light."
    )
    transparent: bool = structural(
        default=False,
        doc="Leave out the background, and write the coverage of surfaces to alpha; glass covers partially.",
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
        if "brdf_table" in self.ambient_reads(steps) | self.energy_reads(steps) | self.layer_reads(steps):
            sheen = {"SHEEN_TABLE": 1} if has_layer(steps.facts, "sheen") else {}
            defines = {"TABLE_SAMPLES": 512, **sheen}
            steps.fullscreen("brdf_table.frag", out=self.brdf_table, defines=defines, label="table")

    def environment_reads(self, steps: Steps) -> dict[str, Any]:
        """Return the shader inputs for environment lighting; none if it would not contribute."""
        needs = steps.needs("shading")
        if not steps.connected(self.environment) or "nothing" in needs or self.terms not in ("all", "ambient"):
            return {}
        # The empirical models use only its diffuse part.
        table = {} if "phong" in needs else {"brdf_table": self.brdf_table.sampled("linear")}
        return {"environment": self.environment, **table}

    def ambient_reads(self, steps: Steps) -> dict[str, Any]:
        """Return the shader inputs for ambient lighting: the environment."""
        return self.environment_reads(steps)

    def energy_reads(self, steps: Steps) -> dict[str, Any]:
        """Return the shader inputs that give the diffuse lobe the light that the specular lobe does not reflect."""
        needs = steps.needs("shading")
        shares = self.diffuse_lobe == "shared" and "phong" not in needs and "nothing" not in needs
        return {"brdf_table": self.brdf_table.sampled("linear")} if shares else {}

    def layer_reads(self, steps: Steps) -> dict[str, Any]:
        """Return the shader inputs for lighting the layers of materials: the albedo of sheen."""
        needs = steps.needs("shading")
        is_physical = "phong" not in needs and "nothing" not in needs
        reads = is_physical and has_layer(steps.facts, "sheen")
        return {"brdf_table": self.brdf_table.sampled("linear")} if reads else {}

    def copy_behind(self, steps: Steps, picture: Port) -> None:
        """Copy the picture to `behind`, with all levels."""
        steps.fullscreen("copy_picture.frag", radiance=picture, out=self.behind.mip(0), label="behind")
        fill_mips(steps, self.behind, "behind")

    def air_reads(self, steps: Steps) -> dict[str, Any]:
        """Return the shader inputs for the air in front of the surfaces that it draws."""
        return {"air": self.air} if steps.connected(self.air) else {}

    def light_list_reads(self, steps: Steps) -> dict[str, Any]:
        """Return the shader inputs for lighting a surface by some of the lights."""
        return {"light_list": self.light_list} if self.wants_lights(steps) and steps.connected(self.light_list) else {}

    def lighting_reads(self, steps: Steps, shadows: Port) -> dict[str, Any]:
        """Return the inputs of a shader that lights geometry while drawing it.

        They are the environment, the air, shadow functions and lists of lights.
        """
        reads = self.environment_reads(steps) | self.energy_reads(steps) | self.air_reads(steps)
        reads |= self.layer_reads(steps)
        return reads | ({"lookup": shadows, **self.light_list_reads(steps)} if self.wants_lights(steps) else {})

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

        Surfaces that transmit light are drawn first, with their depth. They read a copy of the picture without them.
        """
        reads: dict[str, Any] = self.lighting_reads(steps, shadows) | ({} if depth is None else {"depth": depth})
        reads = reads or {"lookup": shadows}  # a step without reads would read all inputs
        objects: str | list[str] = "transparent"
        through = [placed.name for placed in steps.facts.objects if transmits(placed)]
        if through and "phong" not in steps.needs("shading") and "nothing" not in steps.needs("shading"):
            objects = [one.name for one in steps.facts.objects if one.blended and not one.hidden and not transmits(one)]
            self.copy_behind(steps, out["radiance"])
            behind: dict[str, Any] = reads | {"behind": self.behind.sampled("trilinear")}
            transparent = {"TRANSPARENT": 1} if self.transparent else {}
            if self.environment_reads(steps):
                behind["brdf_table"] = self.brdf_table.sampled("linear")
            steps.geometry(
                fragment,
                vertex=vertex,
                geometry=geometry,
                in_place=in_place,
                out=out,
                objects=through,
                view=view,
                defines={"TRANSMITS": 1, **transparent},
                label="transmissive",
                **behind,
            )
            if not objects:
                return
        steps.geometry(
            fragment,
            vertex=vertex,
            geometry=geometry,
            in_place=in_place,
            out=out,
            objects=objects,
            order="back_to_front",
            view=view,
            state=State(blend=PREMULTIPLIED, depth_write=False),
            **reads,
        )


def transmits(placed: ObjectFacts) -> bool:
    """Return whether an object is drawn, and light passes through it."""
    return "transmission" in placed.layers and not placed.hidden


PARTS = ("direct_diffuse", "direct_specular", "environment_reflection", "specular_albedo", "irradiance")


def _of_radiance(node: Node, facts: Facts, field: str, default: Any) -> Any:
    """Return a property that the node's `radiance` declares, such as its format, or the default."""
    declared = getattr(node.outputs().get("radiance"), field, None)
    value = declared(node, facts) if callable(declared) else declared
    return default if value is None else value


def part_format(node: Node, facts: Facts) -> str:
    """Return the format of the parts of the light: that of `radiance`."""
    return str(_of_radiance(node, facts, "format", "rgba16f"))


def part_samples(node: Node, facts: Facts) -> int:
    """Return the sample count of the parts of the light: that of `radiance`."""
    return int(_of_radiance(node, facts, "samples", 1))


def mirror_view(picture_view: Callable[[Frame], ViewMatrices]) -> Views:
    """Declare the view that shows the reflections in the ground for a picture with this view."""
    return Views(
        count=lambda node, facts: int(has_layer(facts, "shadow_catcher")),
        size=0.5,
        public=False,
        compute=lambda frame: [mirrored_view(picture_view(frame), ground_height(frame))],
        doc="The view that shows the reflections in the ground.",
    )


def _part(doc: str, semantic: Semantic = Radiance) -> Output:
    return Output(semantic, format=part_format, samples=part_samples, clear=0.0, doc=doc)


class SurfaceLighting(Lighting):
    """Base of the nodes that light a whole picture: opaque surfaces first, then transparent ones.

    Screen-space visibility, occlusion and reflections are known only for the opaque surface of each pixel, so they do
    not apply to transparent surfaces in front of it.

    The light is also available in parts, which cost nothing unless they are used. On opaque surfaces without `air` in
    front of them, the picture is `radiance` = `diffuse` + `direct_specular` + `environment_reflection` ×
    `specular_albedo`. Without emission, `diffuse` is the diffuse reflectance × `irradiance` / π; `direct_diffuse` is
    the part of it that comes from the lights. Transparent surfaces are blended over the radiances; they dim
    `specular_albedo` and leave `environment_reflection` and `irradiance` as they are.
    """

    visibility = Input(
        Visibility, kind="texture2d_array", many=True, optional=True, doc="Screen-space shadows, one layer per light."
    )
    occlusion = Input(Occlusion, optional=True, doc="Scales the ambient light: 1 is open, 0 fully occluded.")
    reflections = Input(
        Reflections,
        optional=True,
        doc="Reflected radiance. Weighted by its confidence (alpha), it replaces that of the environment in the "
        "specular lobe. It is not occluded.",
    )
    blended_lookup = Input(
        ShadowLookup,
        kind="function",
        many=True,
        optional=True,
        doc="Shadow functions for transparent surfaces, if opaque ones use `visibility`.",
    )

    mirror_view = mirror_view(lambda frame: frame.camera)
    mirrored = Internal(
        format="rgba16f",
        size=0.5,
        mips=0,
        view="mirror_view",
        clear=0.0,
        doc="Reflections in the ground, with mip levels.",
    )
    mirrored_depth = Internal(Depth, format="depth32f", size=0.5, view="mirror_view", clear=0.0)

    direct_diffuse = _part("Radiance from the lights, reflected diffusely.")
    direct_specular = _part("Radiance from the lights, reflected specularly.")
    environment_reflection = _part(
        "Occluded radiance of the environment in the opaque surface's specular lobe, or `reflections` in its place."
    )
    specular_albedo = _part(
        "Fraction of that radiance that the opaque surface reflects to the viewer: f0 A + f90 B of the split sum.",
        Reflectance,
    )
    irradiance = _part(
        "Irradiance of the opaque surface before albedo, from lights and environment, with shadows and occlusion.",
        Irradiance,
    )

    backdrop: bool = structural(
        default=True, doc="Show the environment behind all surfaces, unless a `background` is set."
    )
    backdrop_blur: float = param(
        default=0.0,
        min=0,
        max=1,
        doc="Blur of the backdrop, as the roughness of a surface that would blur its reflection as much.",
    )
    blended: bool = structural(
        default=True, doc="Draw transparent surfaces, too; otherwise a `forward_transparent` can draw them."
    )

    def record(self, steps: Steps) -> None:
        """Record the BRDF table and the reflections in the ground, if the picture shows them."""
        super().record(steps)
        if not self.mirrors_ground(steps):
            return
        steps.geometry(
            "forward_lighting.frag",
            out={"radiance": self.mirrored.mip(0), "depth": self.mirrored_depth},
            objects=_mirrored_objects(steps.facts),
            view=self.mirror_view,
            label="mirrored",
            **self.lighting_reads(steps, self.transparent_shadows(steps)),
        )
        fill_mips(steps, self.mirrored, "mirrored")

    def mirrors_ground(self, steps: Steps) -> bool:
        """Return whether the scene has a ground that mirrors objects, and no `reflections` are connected."""
        facts = steps.facts
        return (
            has_layer(facts, "shadow_catcher")
            and shows_environment(self, facts)
            and not steps.connected(self.reflections)
            and not facts.connected("view")
            and bool(_mirrored_objects(facts))
        )

    def color_targets(self, steps: Steps) -> dict[str, Port]:
        """Return `radiance`, and its parts that are used."""
        ports = self.outputs()
        used = [name for name in ("diffuse", *PARTS) if steps.used(ports.get(name))]
        return {name: ports[name] for name in ("radiance", *used)}

    def ambient_reads(self, steps: Steps) -> dict[str, Any]:
        """Return the shader inputs for ambient lighting: the environment and the reflections that replace it."""
        reads = self.environment_reads(steps)
        if "phong" in steps.needs("shading") or "nothing" in steps.needs("shading"):
            return reads  # these models have no specular light of the environment
        shown = self.terms in ("all", "ambient") and self.environment_part in ("all", "specular")
        reflections = {"reflections": self.reflections} if shown and steps.connected(self.reflections) else {}
        if reflections or steps.used(self.specular_albedo):
            reads |= {"brdf_table": self.brdf_table.sampled("linear"), **reflections}
        return reads

    def catcher_reads(self, steps: Steps) -> dict[str, Any]:
        """Return the shader inputs for the background on shadow catchers; none if there are no catchers."""
        if not has_layer(steps.facts, "shadow_catcher"):
            return {}
        if shows_environment(self, steps.facts):
            mirror = self.mirrored.sampled("trilinear"), self.mirrored_depth
            mirrored = {"mirrored": mirror[0], "mirrored_depth": mirror[1]} if self.mirrors_ground(steps) else {}
            return self.environment_reads(steps) | {"environment": self.environment, **mirrored}
        plain = {"background": background_color(self)} if isinstance(self, GeometryLighting) else {}
        return self.environment_reads(steps) | plain

    def catcher_defines(self, steps: Steps) -> dict[str, int]:
        """Return the macros of a shader that draws shadow catchers."""
        if not has_layer(steps.facts, "shadow_catcher") or not shows_environment(self, steps.facts):
            return {}
        blurred = {"BLURRED": 1} if self.backdrop_blur > 0 else {}
        return {"SHOWS_ENVIRONMENT": 1, **blurred, **({"MIRRORS": 1} if self.mirrors_ground(steps) else {})}

    def draw_backdrop(self, steps: Steps, view: Port | None = None) -> None:
        """Show the environment, or the background behind air, where no surface covers the picture.

        Args:
            steps: records the step.
            view: a port that carries the view; by default the node's `view` input or the camera.
        """
        if not draws_backdrop(self, steps.facts):
            return
        seen: dict[str, Any] = {"background": background_color(self)} if isinstance(self, GeometryLighting) else {}
        if shows_environment(self, steps.facts):
            seen = {"environment": self.environment}
        targets = self.color_targets(steps)
        steps.draw(
            "backdrop.frag",
            vertex="<fullscreen.vert>",
            vertices=3,
            out={name: targets[name] for name in ("radiance", "diffuse") if name in targets},
            view=view,
            state=State(blend=UNDER, cull="none"),
            defines={"BLURRED": 1} if self.backdrop_blur > 0 else {},
            label="backdrop",
            **seen,
            **self.air_reads(steps),
        )

    def transparent_shadows(self, steps: Steps) -> Port:
        """Return the input with the shadow functions for transparent surfaces."""
        return self.blended_lookup if steps.connected(self.blended_lookup) else self.lookup


def _mirrored_objects(facts: Facts) -> list[str]:
    """Return the names of the opaque objects that stand on a ground."""
    return [
        one.name
        for one in facts.objects
        if not one.hidden and not one.blended and not transmits(one) and "shadow_catcher" not in one.layers
    ]


def shows_environment(node: SurfaceLighting, facts: Facts) -> bool:
    """Return whether the environment is the background: one is connected, and no other background is set."""
    background = getattr(node, "background", 0.0)
    plain = any(background) if isinstance(background, tuple) else background
    return (
        not plain
        and node.backdrop
        and not node.transparent
        and facts.connected("environment")
        and node.terms in ("all", "ambient")
    )


def draws_backdrop(node: SurfaceLighting, facts: Facts) -> bool:
    """Return whether a separate step draws the background: the environment, or anything that is seen through air."""
    return shows_environment(node, facts) or facts.connected("air")


def background_color(node: GeometryLighting) -> tuple[float, float, float]:
    """Return the background as RGB."""
    color = node.background
    return color if isinstance(color, tuple) else (color, color, color)


def background_texel(node: GeometryLighting, facts: Facts) -> tuple[float, ...]:
    """Return the clear value of radiance: the node's background with a coverage of 0."""
    return (0.0,) * 4 if draws_backdrop(node, facts) else (*background_color(node), 0.0)


def rendered_samples(node: GeometryLighting, facts: Facts) -> int:
    """Return the sample count of the picture: the node's own, or that of the depth that it tests against."""
    tested = facts.input("depth").desc if facts.connected("depth") and node.samples == 1 else None
    return node.samples if tested is None else tested.samples


class GeometryLighting(SurfaceLighting):
    """Base of the forward lighting nodes, which light geometry while drawing it.

    `record` draws opaque surfaces with `draw_opaque`, in as many passes as the technique needs, and ends with
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
        doc="Samples per pixel for smooth triangle edges; each pixel is lit once. 1 takes the sample count of `depth`.",
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
        reads: dict[str, Any] = (
            {port.name: port for port in connected}
            | self.air_reads(steps)
            | self.energy_reads(steps)
            | self.layer_reads(steps)
        )
        if options.get("per_light") is None:
            reads |= self.light_list_reads(steps)
        # `lookup` in any case: a step without reads would read all inputs.
        reads = {"lookup": self.lookup, **reads, **self.catcher_reads(steps), **options}
        defines = {**self.catcher_defines(steps), **reads.pop("defines", {})}
        steps.geometry(fragment, out=self.targets(steps), objects="opaque", defines=defines, **reads)

    def draw_backdrop_and_transparent(self, steps: Steps, **shaders: Any) -> None:
        """Draw the environment behind the opaque surfaces, then transparent surfaces over both."""
        self.draw_backdrop(steps)
        if self.blended:
            depth = self.depth if steps.connected(self.depth) else None
            self.draw_transparent(steps, self.targets(steps), self.transparent_shadows(steps), depth, **shaders)
