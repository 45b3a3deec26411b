"""Surfaces written down, to be lit later."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

from rendergraph.api import (
    Albedo,
    Any,
    Depth,
    Emissive,
    Facts,
    Input,
    Material,
    Node,
    Normal,
    Output,
    Port,
    Steps,
    View,
    structural,
)

_MOST_TARGETS = 8  # what every OpenGL 4.5 device draws to at once


def _format(compact: str) -> Callable[[GBuffer, Facts], str]:
    return lambda node, facts: compact if node.precision == "compact" else "rgba32f"


class GBuffer(Node):
    """The nearest opaque surface at every pixel, one pass over the geometry into several targets.

    Deferred lighting reads it as a whole (`gbuffer: gbuffer`); only what somebody reads is drawn. `compact` takes 32
    bytes a pixel for `pbr`, its coarsest part being base colour in 8 bits a channel; `full` keeps float32, 84 bytes,
    and shows that nothing else is lost. Positions come from `depth` and its view. Surfaces with alpha blending are not
    in it: a pixel holds one surface.
    """

    view = Input(View, kind="view", optional=True, doc="What it is seen from; the pipeline's camera by default.")
    depth = Output(Depth, format="depth32f", clear=1.0, doc="Window depth, 1 where nothing is.")
    albedo = Output(Albedo, format=_format("srgb8_a8"), clear=0.0, doc="Base colour; alpha is 1 where a surface is.")
    normal = Output(
        Normal,
        format=_format("rgba16_snorm"),
        clear=0.0,
        doc="Unit normal for shading, world space; 0 where nothing is.",
    )
    material = Output(
        Material,
        format=_format("rgba16"),
        clear=0.0,
        doc="Metallic, roughness, occlusion, and 1 for surfaces that lights reach, 0 for unlit ones.",
    )
    emissive = Output(Emissive, format=_format("r11f_g11f_b10f"), clear=0.0, doc="Emitted radiance.")
    specular = Output(
        Any,
        format=_format("rgba8"),
        clear=0.0,
        doc="Of what is not metal: root of the reflectance at normal incidence, and at grazing incidence in alpha.",
    )
    grain = Output(
        Any,
        format=_format("rgba16_snorm"),
        clear=0.0,
        doc="For the anisotropic model: unit direction of the grain, world space, and its strength in alpha.",
    )
    phong_diffuse = Output(Any, format=_format("rgb10_a2"), clear=0.0, doc="Root of kd of the empirical models.")
    phong_specular = Output(Any, format=_format("rgb10_a2"), clear=0.0, doc="Root of ks of the empirical models.")
    phong_ambient = Output(Any, format=_format("rgb10_a2"), clear=0.0, doc="Root of ka of the empirical models.")

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
