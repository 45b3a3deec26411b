"""What passes share that hand texels on as they are, whatever they hold."""

from __future__ import annotations

from rendergraph.api import TextureDesc


def texel_macros(desc: TextureDesc) -> dict[str, str | int]:
    """`SAMPLER` of a texture, and `TEXEL`, the type of what it holds; without that it is a depth."""
    whole = "u" if desc.format.endswith("ui") else "i" if desc.format.endswith("i") else ""
    macros: dict[str, str | int] = {"SAMPLER": f"{whole}sampler2D" + ("MS" if desc.samples > 1 else "")}
    return macros if desc.format.startswith("depth") else {**macros, "TEXEL": f"{whole}vec4"}
