"""One texture for a notebook: its values in false colours with a scale, or its colours as they are."""

from __future__ import annotations

import base64
from collections.abc import Callable
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from rendergraph.errors import InputError, Problem
from rendergraph.images.encode import picture_bytes, write
from rendergraph.images.viewable import heat_map, viewable

_COLORS = frozenset({"display_color", "radiance", "albedo", "emissive", "normal"})


@dataclass(frozen=True, eq=False)
class Shown:
    """A picture of a texture, with a rich display in notebooks.

    Attributes:
        name: the output or port, with layer and channel.
        pixels: uint8 (height, width, 1 or 3), top row first.
        low, high: the values of the darkest and of the brightest false colour; None for colours.
    """

    name: str
    pixels: npt.NDArray[np.uint8]
    low: float | None = None
    high: float | None = None

    def __repr__(self) -> str:
        height, width = self.pixels.shape[:2]
        scale = "" if self.low is None else f", {self.low:g} to {self.high:g}"
        return f"<{self.name}, {width}×{height}{scale}>"

    def save(self, path: str | Path) -> Path:
        """Write the picture, without the scale."""
        write(Path(path), self.pixels)
        return Path(path)

    @property
    def png(self) -> bytes:
        """The picture as a PNG file, without the scale."""
        return picture_bytes((Path("x.png"), self.pixels, None, "data", False), {})

    def _repr_html_(self) -> str:
        source, alt = f"data:image/png;base64,{base64.b64encode(self.png).decode()}", escape(self.name)
        picture = f'<img src="{source}" alt="{alt}" style="image-rendering:pixelated">'
        scale = ""
        if self.low is not None:
            stops = ", ".join(f"rgb({r},{g},{b})" for r, g, b in heat_map(np.linspace(0, 1, 9)))
            bar = f'<span style="flex:1;height:.8em;background:linear-gradient(to right, {stops})"></span>'
            scale = f'<div style="display:flex;gap:.5em;align-items:center">{self.low:g}{bar}{self.high:g}</div>'
        caption = f"<figcaption>{escape(self.name)}{scale}</figcaption>"
        return f'<figure style="display:inline-block;margin:0">{picture}{caption}</figure>'


def shown(
    array: npt.NDArray[Any],
    name: str,
    semantic: str,
    encoding: str | None,
    *,
    layer: int | None = None,
    channel: int | None = None,
    low: float | None = None,
    high: float | None = None,
) -> Shown:
    """Return a texture as a picture; see `Frame.show`."""
    if array.ndim == 4:
        layer = 0 if layer is None and len(array) == 1 else layer
        if layer is None and (channel is not None or semantic not in _COLORS):
            raise _mistake(f"'{name}' has {len(array)} layers; choose one: layer=0")
    elif layer not in (None, 0):
        raise _mistake(f"'{name}' has no layers, so there is no layer {layer}")
    if layer is not None and array.ndim == 4:
        array, name = _chosen(array, layer, name, "layer", lambda number: array[number])
    if channel is not None:
        array, name = _chosen(np.moveaxis(array, -1, 0), channel, name, "channel", lambda number: array[..., number])
        array = array[..., None]
    elif semantic in _COLORS and array.shape[-1] > 1:
        return Shown(name, viewable(array, semantic, encoding))
    elif array.shape[-1] > 1:
        raise _mistake(f"'{name}' has {array.shape[-1]} channels; choose one: channel=0")
    values = array[..., 0].astype(np.float64)
    finite = values[np.isfinite(values)]
    least, most = (float(finite.min()), float(finite.max())) if finite.size else (0.0, 1.0)
    low, high = least if low is None else low, most if high is None else high
    return Shown(name, heat_map((values - low) / max(high - low, 1e-30)), low, high)


def _chosen(
    parts: npt.NDArray[Any], number: int, name: str, what: str, take: Callable[[int], npt.NDArray[Any]]
) -> tuple[npt.NDArray[Any], str]:
    if not 0 <= number < len(parts):
        raise _mistake(f"'{name}' has {len(parts)} {what}s, so there is no {what} {number}")
    return take(number), f"{name}, {what} {number}"


def _mistake(text: str) -> InputError:
    return InputError(Problem("RG205", text))
