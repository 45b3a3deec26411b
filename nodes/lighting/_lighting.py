"""What every lighting node can be told."""

from __future__ import annotations

from typing import Any, Literal

from rendergraph.api import (
    PREMULTIPLIED,
    Depth,
    Facts,
    Input,
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

Color = float | tuple[float, float, float]


class Lighting(Node):
    """Base of the nodes that turn surfaces into radiance: the shading model, its terms, shadows to look up."""

    lookup = Input(ShadowLookup, kind="function", many=True, optional=True, doc="Shadows to look up in place.")

    shading: Literal["unlit", "phong", "blinn_phong", "anisotropic", "pbr"] | str = define(
        default="pbr",
        doc="How surfaces reflect: Cook-Torrance (`pbr`), the same with a grain, or an empirical model.",
        choices="shading",
        needs=("nothing", "phong", "grain"),
    )
    smith: Literal["exact", "fast"] = define(
        default="exact", doc="Masking of `pbr`: Smith's, or a fit without roots. `anisotropic` always has Smith's."
    )
    terms: Literal["all", "ambient", "diffuse", "specular", "emissive"] = define(
        default="all", doc="One term alone, to look at; the four sum to the whole."
    )
    ambient: Color = param(default=0.03, min=0, glsl="vec3", doc="Radiance from all sides, a number or RGB.")

    def wants_lights(self, steps: Steps) -> bool:
        """Whether punctual lights show in the picture at all."""
        return "nothing" not in steps.needs("shading") and self.terms in ("all", "diffuse", "specular")

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
    ) -> None:
        """Light surfaces with alpha blending and lay them over the picture, far to near.

        Args:
            steps: what records it.
            out: the picture, and its depth where that is attached to be written by others.
            shadows: an input of functions.
            depth: what they are tested against, where `out` has none.
            view: what carries the view they are seen with; the node's `view` input or the camera by default.
            fragment, vertex, geometry: shaders.
        """
        reads: dict[str, Any] = {} if depth is None else {"depth": depth}
        if self.wants_lights(steps) or not reads:  # a step that names nothing would read everything
            reads["lookup"] = shadows
        steps.geometry(
            fragment,
            vertex=vertex,
            geometry=geometry,
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

    blended: bool = structural(
        default=True, doc="Draw surfaces with alpha blending too; otherwise a `forward_transparent` may."
    )

    def shadows_on_blended(self, steps: Steps) -> Port:
        """The shadows of surfaces with alpha blending."""
        return self.blended_lookup if steps.connected(self.blended_lookup) else self.lookup


def background_texel(node: GeometryLighting, facts: Facts) -> tuple[float, ...]:
    """What a picture of radiance holds where nothing is: the node's background, covered by nothing."""
    rgb = node.background if isinstance(node.background, tuple) else (node.background,) * 3
    return *rgb, 0.0


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
        doc="Scene-linear radiance; alpha is coverage, 1 where an opaque surface is and 0 where nothing is.",
    )
    surface_depth = Output(
        Depth, format="depth32f", clear=1.0, doc="Depth of the nearest opaque surface, where no pre-pass is connected."
    )

    background: Color = structural(default=0.0, min=0, doc="Radiance where nothing is, a number or RGB.")

    def targets(self, steps: Steps) -> dict[str, Port]:
        """What is drawn to: the picture, and its depth where no pre-pass has that."""
        depth = {} if steps.connected(self.depth) else {"surface_depth": self.surface_depth}
        return {"radiance": self.radiance, **depth}

    def light_opaque(self, steps: Steps, fragment: str, **options: Any) -> None:
        """Draw opaque surfaces, lit with what is connected.

        Args:
            steps: what records it.
            fragment: the shader of fragments.
            options: what else `steps.geometry` takes.
        """
        connected = [port for port in (self.depth, self.visibility, self.occlusion) if steps.connected(port)]
        reads: dict[str, Any] = {port.name: port for port in connected}
        # `lookup` in any case: a step that names nothing would read everything.
        steps.geometry(fragment, out=self.targets(steps), objects="opaque", lookup=self.lookup, **reads, **options)

    def blend_after(self, steps: Steps, **shaders: Any) -> None:
        """Surfaces with alpha blending, over the opaque ones that have been drawn."""
        if self.blended:
            depth = self.depth if steps.connected(self.depth) else None
            self.blend(steps, self.targets(steps), self.shadows_on_blended(steps), depth, **shaders)
