"""Surfaces written down, to be lit later."""

from __future__ import annotations

from typing import Literal

from rendergraph.api import Depth, Input, Node, Output, Port, Steps, View, structural

from ._surface_textures import SURFACE_TEXTURES

_MOST_TARGETS = 8  # what every OpenGL 4.5 device draws to at once


class GBuffer(Node):
    """The nearest opaque surface at every pixel, one pass over the geometry into several targets.

    Deferred lighting reads it as a whole (`gbuffer: gbuffer`); only what somebody reads is drawn. `compact` takes 32
    bytes a pixel for `pbr`, its coarsest part being base colour in 8 bits a channel; `full` keeps float32, 84 bytes,
    and shows that nothing else is lost. Positions come from `depth` and its view. Surfaces with alpha blending are not
    in it: a pixel holds one surface.
    """

    view = Input(View, kind="view", optional=True, doc="What it is seen from; the pipeline's camera by default.")
    depth = Output(Depth, format="depth32f", clear=1.0, doc="Window depth, 1 where nothing is.")
    albedo = SURFACE_TEXTURES["albedo"].drawn()
    normal = SURFACE_TEXTURES["normal"].drawn()
    material = SURFACE_TEXTURES["material"].drawn()
    emissive = SURFACE_TEXTURES["emissive"].drawn()
    specular = SURFACE_TEXTURES["specular"].drawn()
    grain = SURFACE_TEXTURES["grain"].drawn()
    phong_diffuse = SURFACE_TEXTURES["phong_diffuse"].drawn()
    phong_specular = SURFACE_TEXTURES["phong_specular"].drawn()
    phong_ambient = SURFACE_TEXTURES["phong_ambient"].drawn()

    precision: Literal["compact", "full"] = structural(
        default="compact", doc="Small formats, or float32 in every channel."
    )

    def record(self, steps: Steps) -> None:
        """One pass for up to eight targets; all of them together take two."""
        wanted: list[Port] = [port for name, port in self.outputs().items() if name != "depth" and steps.used(port)]
        for first in range(0, max(1, len(wanted)), _MOST_TARGETS):
            targets = {port.name: port for port in wanted[first : first + _MOST_TARGETS]}
            defines = {f"WRITES_{name.upper()}": 1 for name in targets}
            if "grain" in targets:
                defines["NEEDS_GRAIN"] = 1
            steps.geometry("gbuffer.frag", out={**targets, "depth": self.depth}, objects="opaque", defines=defines)
