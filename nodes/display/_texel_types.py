"""Shared by passes that copy texels of any type."""

from __future__ import annotations

from rendergraph.api import TextureDesc


def texel_macros(desc: TextureDesc) -> dict[str, str | int]:
    """Return the macros `SAMPLER` and `TEXEL` of a texture, its GLSL types; depth has no `TEXEL`."""
    prefix = "u" if desc.format.endswith("ui") else "i" if desc.format.endswith("i") else ""
    macros: dict[str, str | int] = {"SAMPLER": f"{prefix}sampler2D" + ("MS" if desc.samples > 1 else "")}
    return macros if desc.format.startswith("depth") else {**macros, "TEXEL": f"{prefix}vec4"}
