"""A node that holds an array, so that an array can be the input of a port."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from rendergraph.declare import Node, Output
from rendergraph.errors import InputError, Problem
from rendergraph.steps import Steps
from rendergraph.textures import Any as AnyTexels

_FORMATS = {"u": ("r8", "rg8", "rgba8"), "f": ("r32f", "rg32f", "rgba32f")}


def array_type(array: npt.NDArray[Any]) -> type[Node]:
    """Return a node type whose output `values` holds an array, top row first as a frame has it.

    Args:
        array: (height, width), (height, width, channels) or (layers, height, width, channels), of at most 4 channels;
            bytes are from 0 to 255 for values from 0 to 1, and everything else becomes 32-bit floats.
    """
    texels = array if array.dtype == np.uint8 else array.astype(np.float32)
    texels = texels[..., None] if texels.ndim == 2 else texels
    if not 3 <= texels.ndim <= 4 or not 1 <= texels.shape[-1] <= 4 or not texels.size:
        shape = "(height, width), optionally with 1 to 4 channels after them and layers before them"
        raise InputError(Problem("RG106", f"an input is an array of shape {shape}, not {array.shape}"))
    if texels.shape[-1] == 3:
        one = np.full((*texels.shape[:-1], 1), 255 if texels.dtype == np.uint8 else 1, texels.dtype)
        texels = np.concatenate([texels, one], axis=-1)
    texels = np.ascontiguousarray(texels[..., ::-1, :, :])  # a texture's first row is the lowest
    height, width, channels = texels.shape[-3:]
    options: dict[str, Any] = {"layers": len(texels), "kind": "texture2d_array"} if texels.ndim == 4 else {}
    format = _FORMATS[texels.dtype.kind][channels // 2]
    doc = "The array."
    output = Output(AnyTexels, format=format, size=(width, height), kept=True, doc=doc, **options)

    def record(self: Any, steps: Steps) -> None:
        steps.upload(self.values, texels)

    return type("Array", (Node,), {"__module__": __name__, "__doc__": doc, "values": output, "record": record})
