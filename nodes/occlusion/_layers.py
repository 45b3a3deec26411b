"""The layers of a filter's sources and targets."""

from __future__ import annotations

from rendergraph.api import Part, Port, Steps


def layers_of(steps: Steps, texture: Port | Part) -> list[Port | Part]:
    """Return the layers of an array, in order; a texture without layers is its only one."""
    desc = steps.desc(texture.port if isinstance(texture, Part) else texture)
    if desc.kind == "texture2d":
        return [texture]
    return [texture.at_layer(n) if isinstance(texture, Part) else texture.layer(n) for n in range(desc.layers)]
