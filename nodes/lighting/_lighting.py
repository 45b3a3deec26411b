"""What every lighting node can be told."""

from __future__ import annotations

from typing import Literal

from rendergraph.api import Node, define, param, structural

Color = float | tuple[float, float, float]


class Lighting(Node):
    """Base of the nodes that turn surfaces into radiance: the shading model, its terms, what is around the scene."""

    shading: Literal["unlit", "phong", "blinn_phong", "anisotropic", "pbr"] = define(
        default="pbr", doc="How surfaces reflect: Cook-Torrance (`pbr`), the same with a grain, or an empirical model."
    )
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
