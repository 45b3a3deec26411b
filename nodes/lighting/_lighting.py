"""What every lighting node can be told."""

from __future__ import annotations

from typing import Any, Literal

from rendergraph.api import (
    PREMULTIPLIED,
    Depth,
    Input,
    Node,
    Occlusion,
    Part,
    Port,
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


class GeometryLighting(SurfaceLighting):
    """What every node that lights while the geometry is drawn takes beside its parameters."""

    view = Input(View, kind="view", optional=True, doc="What it is seen from; the pipeline's camera by default.")
    depth = Input(Depth, use="depth_test", optional=True, doc="Depth of a pre-pass, tested and not written.")

    background: Color = structural(default=0.0, min=0, doc="Radiance where nothing is, a number or RGB.")

    @property
    def background_rgb(self) -> tuple[float, float, float]:
        """The background as RGB."""
        if isinstance(self.background, tuple):
            return self.background
        return self.background, self.background, self.background

    def opaque_reads(self, steps: Steps) -> dict[str, Any]:
        """What opaque surfaces are lit with; an unconnected `lookup` too, since naming nothing means everything."""
        more = [port for port in (self.depth, self.visibility, self.occlusion) if steps.connected(port)]
        return {port.name: port for port in (self.lookup, *more)}

    def blend_after(self, steps: Steps, out: dict[str, Port], **shaders: Any) -> None:
        """Surfaces with alpha blending, over the opaque ones that were drawn to `out`."""
        if self.blended:
            depth = self.depth if steps.connected(self.depth) else None
            self.blend(steps, out, self.shadows_on_blended(steps), depth, **shaders)
