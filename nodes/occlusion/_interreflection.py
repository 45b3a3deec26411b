"""Shared by techniques that gather light from other surfaces in the picture."""

from __future__ import annotations

from typing import Any, ClassVar

from rendergraph.api import (
    ADD,
    AlbedoRoot,
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

from ._directional import DirectionalSampling


class Interreflection(DirectionalSampling):
    """Base of the techniques that add diffuse interreflection to a lit picture.

    One bounce: light leaves surfaces as `diffuse`, and is reflected by the surfaces it reaches. For a second bounce, a
    second node takes the `reflected` of the first as its `diffuse`, and continues its `radiance`.
    """

    twin: ClassVar[str | None] = "traced_interreflection"

    depth = Input(Depth, group="gbuffer", doc="Window depth; positions come from it and its view.")
    normal = Input(Normal, group="gbuffer", doc="Unit normal, world space.")
    albedo = Input(AlbedoRoot, group="gbuffer", doc="Square root of the base colour, which is the diffuse reflectance.")
    material = Input(
        Material,
        group="gbuffer",
        optional=True,
        doc="Metal reflects no diffuse light. Unconnected: no surface is metal.",
    )
    diffuse = Input(Radiance, doc="Diffuse radiance that leaves surfaces.")
    radiance = InOut(Radiance, doc="The lit picture, to which reflected light is added.")
    indirect = Output(
        Radiance,
        format="rgba16f",
        size="depth",
        doc="Irradiance from other surfaces, over π: the radiance that a white surface would reflect.",
    )
    reflected = Output(
        Radiance,
        format="rgba16f",
        size="depth",
        doc="The part of `indirect` that surfaces reflect: `diffuse` of the next bounce.",
    )

    denoise: int = structural(
        default=3,
        min=0,
        max=5,
        doc="Passes of a filter over light on the same surface; each reaches twice as far as the previous one.",
    )

    def reflect_indirect(self, steps: Steps, **options: Any) -> None:
        """Record the reflection of `indirect`, by itself and added to the picture.

        Args:
            steps: the recorder.
            options: further arguments of the step that adds it to the picture.
        """
        reads: dict[str, Any] = {"indirect": self.indirect, "albedo": self.albedo}
        if steps.connected(self.material):
            reads["material"] = self.material
        if steps.used(self.reflected):
            steps.fullscreen("reflect_indirect.frag", out={"reflected": self.reflected}, **reads)
        if steps.used(self.radiance):
            additive = State(blend=ADD, color_mask=(True, True, True, False))
            target = {"reflected": self.radiance}
            steps.fullscreen("reflect_indirect.frag", out=target, state=additive, **reads, **options)
