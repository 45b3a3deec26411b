"""Viewable pictures of any texture; colour maps; contact sheets.

| texels mean | 8-bit picture |
|---|---|
| `display_color` | unchanged |
| `radiance`, `albedo`, `emissive`, `luminance`, a plugin's with linear encoding | clipped to 0…1, sRGB curve |
| `normal` | −1…1 becomes 0…1, no curve |
| `depth`, `linear_depth`, `shadow_map` | nearest black, farthest white, uncovered texels white |
| `visibility`, `occlusion`, `material` | 0…1 unchanged, no curve |
| integers | a colour for each, 0 black |
| anything else within 0…1 | unchanged |
| anything else | scaled so that all but 1 % at each end fit; with values below 0, 0 is middle grey |

One channel is grey, two are red and green, a fourth is ignored; layers form a grid, row by row. NaN is magenta.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

Pixels: TypeAlias = npt.NDArray[Any]
Bytes: TypeAlias = npt.NDArray[np.uint8]

_LIGHT = frozenset({"radiance", "albedo", "emissive", "luminance"})
_WINDOW_DEPTH = frozenset({"depth", "shadow_map"})  # reversed: greater is nearer
_UNIT = frozenset({"display_color", "visibility", "occlusion", "material"})
_NAN_COLOR = (255, 0, 255)
_BELOW_COLOR, _ABOVE_COLOR = (40, 80, 255), (255, 40, 40)
# Black through purple and orange to pale yellow, with increasing brightness.
_HEAT = np.array([(0, 0, 4), (81, 18, 124), (183, 55, 121), (252, 137, 97), (252, 253, 191)], np.float64)
_TILE_WIDTH, _TILE_HEIGHT = 320, 180
_TILE_GAP, _LINE_HEIGHT = 12, 18
_FONT_SIZE = 14
_BACKGROUND, _NAME_GREY, _NOTE_GREY = 32, 0.95, 0.6


def to_srgb(linear: Pixels) -> npt.NDArray[np.float32]:
    """Encode linear values 0…1 as sRGB (IEC 61966-2-1); values outside are clipped."""
    values = np.clip(np.asarray(linear, dtype=np.float32), 0.0, 1.0)
    return np.where(values <= 0.0031308, values * 12.92, 1.055 * values ** (1 / 2.4) - 0.055).astype(np.float32)


def from_srgb(encoded: Pixels) -> npt.NDArray[np.float32]:
    """Decode sRGB values 0…1 (or 0…255 as uint8) to linear ones (IEC 61966-2-1)."""
    values: npt.NDArray[np.float32] = np.asarray(encoded, dtype=np.float32)
    values = values / np.float32(255) if encoded.dtype == np.uint8 else values
    linear = np.where(values <= 0.04045, values / 12.92, np.power((np.maximum(values, 0) + 0.055) / 1.055, 2.4))
    return linear.astype(np.float32)


def to_bytes(unit: Pixels) -> Bytes:
    """Round values 0…1 to 0…255; NaN becomes 0."""
    if unit.dtype == np.uint8:
        return unit
    values = np.nan_to_num(np.asarray(unit, dtype=np.float32), nan=0.0, posinf=1.0, neginf=0.0)
    return (np.clip(values, 0.0, 1.0) * 255 + 0.5).astype(np.uint8)


def heat_map(values: Pixels) -> Bytes:
    """Map values 0…1 to colours; NaN counts as 1."""
    position = np.clip(np.nan_to_num(values, nan=1.0), 0, 1) * (len(_HEAT) - 1)
    mixed = [np.interp(position, np.arange(len(_HEAT)), channel) for channel in _HEAT.T]
    return (np.stack(mixed, axis=-1) + 0.5).astype(np.uint8)


def signed_map(values: Pixels) -> Bytes:
    """Map values -1…1 to colours: blue below 0, black at 0, orange above, saturated beyond ±0.5; NaN is magenta."""
    amount = np.clip(2 * np.abs(np.nan_to_num(values, nan=0.0)), 0, 1)[..., np.newaxis]
    low, high = (np.array(color, np.float64) for color in ((90, 160, 255), (255, 150, 50)))
    colors = np.where(values[..., np.newaxis] < 0, low, high) * amount
    colors[np.isnan(values)] = _NAN_COLOR
    return np.asarray(colors + 0.5).astype(np.uint8)


def viewable(array: Pixels, semantic: str = "any", encoding: str | None = None) -> Bytes:
    """Return a picture of a texture, uint8 with one or three channels; the module's table lists how it is shown.

    The array is (height, width), (height, width, channels) or (layers, height, width, channels), top row first.
    """
    array = array[..., np.newaxis] if array.ndim == 2 else array
    colors = _colors(array[..., :3], semantic, light=semantic in _LIGHT or encoding == "linear")
    if np.issubdtype(array.dtype, np.floating):
        broken = np.isnan(array[..., :3]).any(axis=-1)
        if broken.any():
            colors = np.repeat(colors, 3, axis=-1) if colors.shape[-1] == 1 else colors.copy()
            colors[broken] = _NAN_COLOR
    if colors.shape[-1] == 2:
        colors = np.concatenate([colors, np.zeros_like(colors[..., :1])], axis=-1)
    return np.ascontiguousarray(_grid(colors) if colors.ndim == 4 else colors)


def mapped(array: Pixels, scale: str, low: float | None, high: float | None) -> tuple[Bytes, str]:
    """Return a picture of a texture with a chosen range, and a description of the mapping.

    NaN is magenta; values outside a chosen range are blue below it and red above it.

    Args:
        scale: `linear` and `log` from black to white, `heat` in false colours; the last shows the mean of channels.
        low, high: the range, by default that of the finite values; `log` begins at the smallest value above 0.
    """
    array = array[..., np.newaxis] if array.ndim == 2 else array[..., :3]
    values = array.astype(np.float64)
    finite = values[np.isfinite(values) & ((values > 0) | (scale != "log"))]
    bottom = float(finite.min()) if finite.size and low is None else low or 0.0
    top = float(finite.max()) if finite.size and high is None else 1.0 if high is None else high
    if scale == "log":
        bottom = max(bottom, 1e-30)
        part = np.log(np.maximum(values, bottom) / bottom) / max(math.log(max(top, bottom) / bottom), 1e-30)
    else:
        part = (values - bottom) / max(top - bottom, 1e-30)
    if scale == "heat":
        colors = heat_map(part.mean(axis=-1))
    else:
        shown = np.clip(np.nan_to_num(part, nan=0.0, posinf=1.0, neginf=0.0), 0, 1)
        colors = np.asarray(shown * 255 + 0.5).astype(np.uint8)
        if colors.shape[-1] < 3:
            colors = np.repeat(colors[..., :1], 3, axis=-1)
    colors[(values < bottom).all(axis=-1) if low is not None else np.zeros(values.shape[:-1], bool)] = _BELOW_COLOR
    colors[(values > top).any(axis=-1) if high is not None else np.zeros(values.shape[:-1], bool)] = _ABOVE_COLOR
    colors[np.isnan(values).any(axis=-1)] = _NAN_COLOR
    words = {"linear": "linear", "log": "logarithmic", "heat": "false colour"}[scale]
    text = f"{words} from {bottom:.6g} to {top:.6g}; blue below, red above, magenta where it is NaN"
    return np.ascontiguousarray(_grid(colors) if colors.ndim == 4 else colors), text


def _colors(array: Pixels, semantic: str, *, light: bool) -> Bytes:
    if np.issubdtype(array.dtype, np.integer) and array.dtype != np.uint8:
        return _palette(array)
    if semantic in _WINDOW_DEPTH:
        return to_bytes(_stretched(-array, background=0.0))
    if semantic == "linear_depth":
        return to_bytes(_stretched(array, background=math.inf))
    if array.dtype == np.uint8 and not light and semantic != "normal":
        return array
    values = array.astype(np.float32) / 255 if array.dtype == np.uint8 else array
    if light:
        return to_bytes(to_srgb(np.nan_to_num(values, nan=0.0, posinf=1.0)))
    if semantic == "normal":
        return to_bytes(values * np.float32(0.5) + np.float32(0.5))
    finite = values[np.isfinite(values)]
    if semantic not in _UNIT and finite.size and finite.min() < 0:
        values = values if values.shape[-1] != 2 else np.concatenate([values, np.zeros_like(values[..., :1])], axis=-1)
        return to_bytes(values / (2 * (np.quantile(np.abs(finite), 0.99) or np.abs(finite).max())) + 0.5)
    if semantic not in _UNIT and finite.size and finite.max() > 1:
        return to_bytes(_stretched(values, background=math.inf, outside=0.01))
    return to_bytes(values)


def _stretched(array: Pixels, background: float, outside: float = 0.0) -> npt.NDArray[np.float32]:
    """Scale minimum to maximum to 0…1; texels at `background` or beyond become 1 and do not count.

    `outside` is the fraction of values at each end that may be clipped: otherwise a highlight would darken the rest.
    """
    values = np.asarray(array, dtype=np.float32)
    covered = values[np.isfinite(values) & (values < background)]
    if not covered.size:
        return np.where(values < background, np.float32(0), np.float32(1))
    low, high = float(covered.min()), float(covered.max())
    if beyond := int(outside * covered.size):
        ranked = np.partition(covered, (beyond, covered.size - 1 - beyond))
        if ranked[beyond] < ranked[-1 - beyond]:
            low, high = float(ranked[beyond]), float(ranked[-1 - beyond])
    scaled = (values - low) / max(high - low, 1e-30)
    return np.where(values < background, scaled, np.float32(1)).astype(np.float32)


def _palette(array: Pixels) -> Bytes:
    """Return a colour for each integer, with distinct ones for neighbours: multiples of the golden ratio as hues."""
    channels = np.moveaxis(array.astype(np.int64), -1, 0)
    number = functools.reduce(lambda total, channel: total * 7919 + channel, channels)
    hue = (number % 65536 * 0.6180339887) % 1.0
    thirds = np.array([1.0, 2 / 3, 1 / 3])
    rgb = np.clip(np.abs((hue[..., np.newaxis] + thirds) % 1.0 * 6 - 3) - 1, 0, 1) * 0.75 + 0.25
    return to_bytes(np.where(number[..., np.newaxis] == 0, 0.0, rgb))


def _grid(layers: Bytes) -> Bytes:
    count, height, width, channels = layers.shape
    columns = math.ceil(math.sqrt(count))
    rows = math.ceil(count / columns)
    cells = np.zeros((rows * columns, height, width, channels), np.uint8)
    cells[:count] = layers
    by_place = cells.reshape(rows, columns, height, width, channels)
    return by_place.swapaxes(1, 2).reshape(rows * height, columns * width, channels)


def contact_sheet(pictures: Sequence[tuple[Bytes, str, str]]) -> Bytes:
    """Arrange pictures in rows on a roughly square sheet, each fitted into 320×180; (height, width, 3).

    A picture is (height, width, 1 or 3), with a name and a note beneath, which are omitted if OpenImageIO has no font.
    """
    import OpenImageIO as oiio  # loaded with the first picture written

    columns = max(1, math.ceil(math.sqrt(len(pictures) * _TILE_HEIGHT / _TILE_WIDTH)))
    rows = math.ceil(len(pictures) / columns)
    across, down = _TILE_WIDTH + _TILE_GAP, _TILE_HEIGHT + 2 * _LINE_HEIGHT + _TILE_GAP
    sheet = np.full((rows * down + _TILE_GAP, columns * across + _TILE_GAP, 3), _BACKGROUND, np.uint8)
    corners = [divmod(number, columns) for number in range(len(pictures))]
    corners = [(_TILE_GAP + row * down, _TILE_GAP + column * across) for row, column in corners]
    for (top, left), (picture, _, _) in zip(corners, pictures, strict=True):
        small = _fit_tile(picture)
        y, x = top + (_TILE_HEIGHT - small.shape[0]) // 2, left + (_TILE_WIDTH - small.shape[1]) // 2
        sheet[y : y + small.shape[0], x : x + small.shape[1]] = small
    written = oiio.ImageBuf(sheet)
    for (top, left), (_, name, note) in zip(corners, pictures, strict=True):
        for line, (text, grey) in enumerate(((name, _NAME_GREY), (note, _NOTE_GREY)), start=1):
            y = top + _TILE_HEIGHT + line * _LINE_HEIGHT - 4
            oiio.ImageBufAlgo.render_text(written, left, y, text, _FONT_SIZE, "", (grey,) * 3)
    written.geterror()  # discard the error of a missing font, which would be printed at exit
    return np.asarray(written.get_pixels(oiio.UINT8), np.uint8)


def _fit_tile(picture: Bytes) -> Bytes:
    """Fit a picture into a tile: averaged if it shrinks, nearest neighbour if it grows."""
    import OpenImageIO as oiio  # loaded with the first picture written

    height, width = picture.shape[:2]
    scale = min(_TILE_WIDTH / width, _TILE_HEIGHT / height)
    size = max(1, round(width * scale)), max(1, round(height * scale))
    if scale >= 1:
        rows, columns = (np.arange(new) * old // new for new, old in ((size[1], height), (size[0], width)))
        return np.ascontiguousarray(picture[rows][:, columns])
    region = oiio.ROI(0, size[0], 0, size[1], 0, 1, 0, picture.shape[2])
    shrunk = oiio.ImageBufAlgo.resize(oiio.ImageBuf(np.ascontiguousarray(picture)), roi=region)
    return np.asarray(shrunk.get_pixels(oiio.UINT8), np.uint8)
