"""Surfaces written down, to be lit later."""

from __future__ import annotations

from typing import Literal

from rendergraph.api import Depth, Input, Node, Output, Port, State, Steps, View, structural

from ._samples import Samples, own_samples
from ._surface_textures import SURFACE_TEXTURES
from ._velocity import drawn_velocity

_MOST_TARGETS = 8  # what every OpenGL 4.5 device draws to at once


class GBuffer(Node):
    """The nearest opaque surface at every pixel, one pass over the geometry into several targets.

    Deferred lighting reads it as a whole (`gbuffer: gbuffer`); only what somebody reads is drawn. `compact` takes 32
    bytes a pixel for `pbr`, its coarsest part being the root of base colour in 10 bits a channel; `full` keeps float32,
    84 bytes, and shows that nothing else is lost. Positions come from `depth` and its view. Surfaces with alpha
    blending are not in it: a pixel holds one surface.
    """

    view = Input(View, kind="view", optional=True, doc="What it is seen from; the pipeline's camera by default.")
    depth = Output(Depth, format="depth32f", clear=0.0, samples=own_samples, doc="Window depth, 0 where nothing is.")
    albedo = SURFACE_TEXTURES["albedo"].drawn()
    normal = SURFACE_TEXTURES["normal"].drawn()
    material = SURFACE_TEXTURES["material"].drawn()
    emissive = SURFACE_TEXTURES["emissive"].drawn()
    specular = SURFACE_TEXTURES["specular"].drawn()
    grain = SURFACE_TEXTURES["grain"].drawn()
    phong_diffuse = SURFACE_TEXTURES["phong_diffuse"].drawn()
    phong_specular = SURFACE_TEXTURES["phong_specular"].drawn()
    phong_ambient = SURFACE_TEXTURES["phong_ambient"].drawn()
    velocity = drawn_velocity()

    precision: Literal["compact", "full"] = structural(
        default="compact", doc="Small formats, or float32 in every channel."
    )
    samples: Samples = structural(default=1, doc="Samples a pixel, of every texture.")
    faces: Literal["front", "back"] = structural(
        default="front",
        doc="Surfaces as they are seen, or the nearest that look away: far sides of what is closed.",
    )

    def record(self, steps: Steps) -> None:
        """One pass for up to eight targets; all of them together take two."""
        wanted: list[Port] = [port for name, port in self.outputs().items() if name != "depth" and steps.used(port)]
        for first in range(0, max(1, len(wanted)), _MOST_TARGETS):
            targets = {port.name: port for port in wanted[first : first + _MOST_TARGETS]}
            defines = {"NEEDS_GRAIN": 1} if "grain" in targets else {}
            state = State()
            if self.faces == "back":
                state, defines["BACK_FACES"] = State(cull="front"), 1
            steps.geometry(
                "gbuffer.frag", out={**targets, "depth": self.depth}, objects="opaque", state=state, defines=defines
            )
