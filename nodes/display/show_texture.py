"""Any texture in a corner of the picture."""

from __future__ import annotations

import math
from typing import Any, Literal

from rendergraph.api import Any as AnyTexel
from rendergraph.api import DisplayColor, InOut, Input, Node, Steps, TextureInfo, param, structural

_AS_LIGHT = frozenset({"radiance", "albedo", "emissive", "luminance"})
_CHANNELS = {"rgba": 4, "rgb": 4, "r11": 4, "rg": 2, "r": 1, "depth": 1}  # the first that a format's name begins with


class ShowTexture(Node):
    """A texture in a corner of a finished picture: a shadow map, a G-buffer's normals, an occlusion, whatever there is.

    Depth, of a shadow map too, is the distance from its own view, black at that view's near plane and white at its far
    one and where nothing is. Light has the display's curve, normals go from -1 and 1 to 0 and 1, everything else is as
    it is; one channel is grey. `low` and `high` spread a part of that over black to white. Layers lie in a grid, row by
    row.
    """

    source = Input(AnyTexel, size="any", optional=True, doc="The texture.")
    layers = Input(AnyTexel, kind="texture2d_array", size="any", optional=True, doc="Or one with layers; all show.")
    color = InOut(DisplayColor, doc="The picture.")

    corner: Literal["lower_left", "lower_right", "upper_left", "upper_right"] = structural(
        default="lower_right", doc="Where it stands."
    )
    height: float = structural(default=0.4, min=0.01, max=1, doc="Of all layers together, as a share of the picture's.")
    low: float = param(default=0.0, doc="What becomes black.")
    high: float = param(default=1.0, doc="What becomes white.")

    def record(self, steps: Steps) -> None:
        """One step, which leaves the rest of the picture as it is."""
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
        shown: dict[str, Any] = {port.name: port}
        steps.fullscreen(
            "show_texture.frag",
            out=self.color,
            defines={"LAYERS": desc.layers, "COLUMNS": columns, **_meaning(steps.facts.input(port.name))},
            place=(left, bottom),
            tile=tile,
            **shown,
        )


def _meaning(info: TextureInfo) -> dict[str, int | str]:
    """What the shader is told of what the texels mean."""
    assert info.desc is not None
    form, word = info.desc.format, info.semantic.name
    whole = "u" if form.endswith("ui") else "i" if form.endswith("i") else ""
    found: dict[str, int | str] = {
        "CHANNELS": next(count for start, count in _CHANNELS.items() if form.startswith(start)),
        "SAMPLER": f"{whole}sampler2DArray" if info.desc.kind == "texture2d_array" else f"{whole}sampler2D",
    }
    if word in ("depth", "shadow_map") and info.view is not None:
        found["MEANS_DEPTH"] = 1
    elif word in _AS_LIGHT or info.semantic.encoding == "linear":
        found["MEANS_LIGHT"] = 1
    elif word == "normal":
        found["MEANS_NORMAL"] = 1
    return found
