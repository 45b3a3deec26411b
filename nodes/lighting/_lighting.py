"""What every lighting node can be told."""

from __future__ import annotations

from typing import Literal

from rendergraph.api import (
    Depth,
    Input,
    Node,
    Occlusion,
    SceneRef,
    ShadowLookup,
    View,
    Visibility,
    define,
    param,
    structural,
)  # fmt: skip

Color = float | tuple[float, float, float]


class Lighting(Node):
    """Base of the nodes that turn surfaces into radiance: the shading model, its terms, what is around the scene."""

    shading: Literal["unlit", "phong", "blinn_phong", "anisotropic", "pbr"] | str = define(
        default="pbr", doc="How surfaces reflect: Cook-Torrance (`pbr`), the same with a grain, or an empirical model.",
        choices="shading", needs=("phong", "grain"),
    )  # fmt: skip
    smith: Literal["exact", "fast"] = define(default="exact", doc="Masking of `pbr`: Smith's, or a fit without roots.")
    terms: Literal["all", "ambient", "diffuse", "specular", "emissive"] = define(
        default="all", doc="One term alone, to look at; the four sum to the whole."
    )
    ambient: Color = param(default=0.03, min=0, glsl="vec3", doc="Radiance from all sides, a number or RGB.")
    background: Color = structural(default=0.0, min=0, doc="Radiance where nothing is, a number or RGB.")

    @property
    def background_rgb(self) -> tuple[float, float, float]:
        """The background as RGB."""
        if isinstance(self.background, tuple):
            return self.background
        return self.background, self.background, self.background

    @property
    def wants_lights(self) -> bool:
        """Whether punctual lights show in the picture at all."""
        return self.shading != "unlit" and self.terms in ("all", "diffuse", "specular")


class GeometryLighting(Lighting):
    """What every node that lights while the geometry is drawn takes beside its parameters."""

    view = Input(View, kind="view", optional=True, doc="What it is seen from; the pipeline's camera by default.")
    scene = Input(SceneRef, kind="scene", optional=True, doc="What is drawn; the pipeline's scene by default.")
    depth = Input(Depth, use="depth_test", optional=True, doc="Depth of a pre-pass, tested and not written.")
    lookup = Input(ShadowLookup, kind="function", many=True, optional=True, doc="Shadows to look up in place.")
    visibility = Input(
        Visibility, kind="texture2d_array", many=True, optional=True, doc="Shadows in screen space, one layer a light."
    )
    occlusion = Input(Occlusion, optional=True, doc="Scales the ambient light: 1 open, 0 closed.")
