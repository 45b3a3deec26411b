"""G-buffer for deferred shading."""

from __future__ import annotations

from typing import Literal

from rendergraph.api import Depth, Input, Node, Output, Port, State, Steps, View, structural

from ._samples import Samples, own_samples
from ._surface_textures import SURFACE_TEXTURES
from ._velocity import velocity_output

_MAX_TARGETS = 8  # render targets that every OpenGL 4.5 device has


class GBuffer(Node):
    """Render the nearest opaque surface at every pixel to several targets, in one pass over the geometry.

    Deferred lighting reads it as a group (`gbuffer: gbuffer`); textures that are not used are not drawn. `compact`
    takes 32 bytes per pixel for `pbr`; its coarsest channels are the square root of the base colour, with 10 bits each.
    `full` uses float32, 84 bytes, and shows what that precision costs. Positions are reconstructed from `depth` and its
    view. A G-buffer contains no transparent surfaces, because it has one surface per pixel.
    """

    view = Input(View, kind="view", optional=True, doc="The view; the pipeline's camera by default.")
    depth = Output(Depth, format="depth32f", clear=0.0, samples=own_samples, doc="Window depth, 0 on the background.")
    albedo = SURFACE_TEXTURES["albedo"].output()
    normal = SURFACE_TEXTURES["normal"].output()
    material = SURFACE_TEXTURES["material"].output()
    emissive = SURFACE_TEXTURES["emissive"].output()
    specular = SURFACE_TEXTURES["specular"].output()
    grain = SURFACE_TEXTURES["grain"].output()
    phong_diffuse = SURFACE_TEXTURES["phong_diffuse"].output()
    phong_specular = SURFACE_TEXTURES["phong_specular"].output()
    phong_ambient = SURFACE_TEXTURES["phong_ambient"].output()
    velocity = velocity_output()

    precision: Literal["compact", "full"] = structural(
        default="compact", doc="Small formats, or float32 in every channel."
    )
    samples: Samples = structural(default=1, doc="Samples per pixel of every texture.")
    faces: Literal["front", "back"] = structural(
        default="front",
        doc="Visible surfaces, or the nearest back faces, which are the far sides of closed objects.",
    )

    def record(self, steps: Steps) -> None:
        """Record one pass per eight targets; all of them together take two."""
        used: list[Port] = [port for name, port in self.outputs().items() if name != "depth" and steps.used(port)]
        for first in range(0, max(1, len(used)), _MAX_TARGETS):
            targets = {port.name: port for port in used[first : first + _MAX_TARGETS]}
            defines = {"NEEDS_GRAIN": 1} if "grain" in targets else {}
            state = State()
            if self.faces == "back":
                state, defines["BACK_FACES"] = State(cull="front"), 1
            steps.geometry(
                "gbuffer.frag", out={**targets, "depth": self.depth}, objects="opaque", state=state, defines=defines
            )
