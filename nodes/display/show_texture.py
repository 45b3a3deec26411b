"""A texture in a corner of the picture."""

from __future__ import annotations

import math
from typing import Any, Literal

from rendergraph.api import Any as AnyTexel
from rendergraph.api import DisplayColor, InOut, Input, Node, Steps, TextureInfo, param, structural

_LIGHT_SEMANTICS = frozenset({"radiance", "albedo", "emissive", "luminance"})
_CHANNELS = {"rgba": 4, "rgb": 4, "r11": 4, "rg": 2, "r": 1, "depth": 1}  # the first prefix of a format's name counts


class ShowTexture(Node):
    """Show a texture in a corner of a finished picture: a shadow map, normals, occlusion, anything.

    Depth is shown as the distance from its own view, black at the near plane, white at the far plane and for
    background. Light is sRGB encoded, normals are mapped from -1 and 1 to 0 and 1, and all other values are unchanged;
    single channels are grey. `low` and `high` select the range from black to white. Layers are arranged in a grid, row
    by row.
    """

    source = Input(AnyTexel, size="any", optional=True, doc="The texture.")
    layers = Input(
        AnyTexel,
        kind="texture2d_array",
        size="any",
        optional=True,
        doc="Alternatively, a texture with layers, which are all shown.",
    )
    color = InOut(DisplayColor, doc="The picture.")

    corner: Literal["lower_left", "lower_right", "upper_left", "upper_right"] = structural(
        default="lower_right", doc="The corner."
    )
    height: float = structural(
        default=0.4, min=0.01, max=1, doc="Height of all layers together, relative to the picture."
    )
    low: float = param(default=0.0, doc="Value shown as black.")
    high: float = param(default=1.0, doc="Value shown as white.")

    def record(self, steps: Steps) -> None:
        """Record one step; the rest of the picture is unchanged."""
        port = self.layers if steps.connected(self.layers) else self.source
        if not steps.connected(port):
            return
        desc, picture = steps.desc(port), steps.desc(self.color)
        columns = math.ceil(math.sqrt(desc.layers))
        rows = math.ceil(desc.layers / columns)
        margin = max(2, picture.height // 60)
        tile_height = max(1, int(self.height * (picture.height - 2 * margin)) // rows)
        tile = max(1, round(tile_height * desc.width / desc.height)), tile_height
        left = margin if self.corner.endswith("left") else picture.width - margin - columns * tile[0]
        bottom = margin if self.corner.startswith("lower") else picture.height - margin - rows * tile[1]
        reads: dict[str, Any] = {port.name: port}
        steps.fullscreen(
            "show_texture.frag",
            out=self.color,
            defines={"LAYERS": desc.layers, "COLUMNS": columns, **_texel_macros(steps.facts.input(port.name))},
            origin=(left, bottom),
            tile_size=tile,
            **reads,
        )


def _texel_macros(info: TextureInfo) -> dict[str, int | str]:
    """Return the macros that describe the texels."""
    assert info.desc is not None
    format_name, semantic = info.desc.format, info.semantic.name
    prefix = "u" if format_name.endswith("ui") else "i" if format_name.endswith("i") else ""
    macros: dict[str, int | str] = {
        "CHANNELS": next(count for start, count in _CHANNELS.items() if format_name.startswith(start)),
        "SAMPLER": f"{prefix}sampler2DArray" if info.desc.kind == "texture2d_array" else f"{prefix}sampler2D",
    }
    if semantic in ("depth", "shadow_map") and info.view is not None:
        macros["MEANS_DEPTH"] = 1
    elif semantic in _LIGHT_SEMANTICS or info.semantic.encoding == "linear":
        macros["MEANS_LIGHT"] = 1
    elif semantic == "normal":
        macros["MEANS_NORMAL"] = 1
    return macros
