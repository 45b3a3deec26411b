"""What the techniques share that gather light from other surfaces of the picture."""

from __future__ import annotations

from typing import Any

from rendergraph.api import (
    ADD,
    Depth,
    InOut,
    Input,
    Material,
    Normal,
    Output,
    Radiance,
    State,
    Steps,
    structural,
)

from ..geometry._surface_textures import AlbedoRoot
from ._arms import ArmOcclusion


class Interreflection(ArmOcclusion):
    """Base of the techniques that add what surfaces send one another to a lit picture.

    One bounce: light that came from `diffuse` and is sent on by the surface it reaches. A second node of the kind,
    which takes the first one's `reflected` for its `diffuse` and continues its `radiance`, is the second bounce.
    """

    depth = Input(Depth, group="gbuffer", doc="Window depth; positions come from it and its view.")
    normal = Input(Normal, group="gbuffer", doc="Unit normal, world space.")
    albedo = Input(AlbedoRoot, group="gbuffer", doc="Root of the base colour: what a surface sends on of each colour.")
    material = Input(
        Material, group="gbuffer", optional=True, doc="Metal sends no diffuse light on. Unconnected: nothing is metal."
    )
    diffuse = Input(Radiance, doc="Radiance that surfaces send to all sides, without its specular part.")
    radiance = InOut(Radiance, doc="The lit picture; what surfaces send on is added.")
    indirect = Output(
        Radiance,
        format="rgba16f",
        size="depth",
        doc="Light from other surfaces, irradiance over π: what a white surface would send on.",
    )
    reflected = Output(
        Radiance, format="rgba16f", size="depth", doc="What surfaces send on of it: `diffuse` of the next bounce."
    )

    denoise: int = structural(
        default=3, min=0, max=5, doc="Passes of a filter over light on the same surface; each reaches twice as far."
    )

    def send_on(self, steps: Steps, **more: Any) -> None:
        """What surfaces make of `indirect`, alone and added to the picture.

        Args:
            steps: what records it.
            more: further arguments of the step that adds it.
        """
        reads: dict[str, Any] = {"indirect": self.indirect, "albedo": self.albedo}
        if steps.connected(self.material):
            reads["material"] = self.material
        if steps.used(self.reflected):
            steps.fullscreen("send_on.frag", out={"sent": self.reflected}, **reads)
        if steps.used(self.radiance):
            added = State(blend=ADD, color_mask=(True, True, True, False))
            steps.fullscreen("send_on.frag", out={"sent": self.radiance}, state=added, **reads, **more)
