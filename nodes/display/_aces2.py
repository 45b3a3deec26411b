"""The output transform of ACES 2.0 as a table, computed by OpenColorIO."""

from __future__ import annotations

from functools import cache

import numpy as np
import numpy.typing as npt

CONFIG = "ocio://cg-config-latest"
DISPLAY, VIEW = "sRGB - Display", "ACES 2.0 - SDR 100 nits (Rec.709)"
SOURCE = "Linear Rec.709 (sRGB)"
DARKEST, RANGE = 2.0**-10, 17
"""Scene-linear values are spaced by log2(value / DARKEST + 1), up to DARKEST · 2^RANGE; as in `aces2.glsl`."""


@cache
def table(side: int) -> npt.NDArray[np.float32]:
    """Return display-encoded colours from 0 to 1, shape (side, side, side, 4): blue, green, red, channel.

    Raises:
        RuntimeError: OpenColorIO lacks ACES 2.0.
    """
    values = DARKEST * (np.exp2(np.linspace(0, 1, side) * np.log2(2.0**RANGE + 1)) - 1)
    blue, green, red = np.meshgrid(values, values, values, indexing="ij")
    colors = displayed(np.stack([red, green, blue], axis=-1).reshape(side * side, side, 3))
    opaque = np.ones((side, side, side, 4), np.float32)
    opaque[..., :3] = np.clip(colors, 0, 1).reshape(side, side, side, 3)
    return opaque


def displayed(colors: npt.NDArray[np.float64]) -> npt.NDArray[np.float32]:
    """Return the display-encoded colours of scene-linear ones, both of shape (height, width, 3).

    Raises:
        RuntimeError: OpenColorIO lacks ACES 2.0.
    """
    import OpenImageIO as oiio

    height, width, _ = colors.shape
    source = oiio.ImageBuf(oiio.ImageSpec(width, height, 3, "float"))
    source.set_pixels(oiio.ROI(), np.ascontiguousarray(colors, np.float32))
    result = oiio.ImageBufAlgo.ociodisplay(source, DISPLAY, VIEW, SOURCE, colorconfig=CONFIG)
    if result.has_error:
        raise RuntimeError(f"the curve 'aces2' needs OpenColorIO 2.5 in OpenImageIO: {result.geterror()}")
    return np.asarray(result.get_pixels(oiio.FLOAT))
