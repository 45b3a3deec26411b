"""Choose and convert outputs for files, for the command line, Python and notebooks."""

from __future__ import annotations

import base64
import os
import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import Any, NamedTuple, Protocol, TypeAlias

import numpy as np
import numpy.typing as npt
from msgspec import Struct

from rendergraph.errors import InputError, Place, Problem, UsageError, suggestion
from rendergraph.images.encode import EXTENSIONS, Encoding, Job, picture_bytes, write, write_all
from rendergraph.images.viewable import Bytes, from_srgb, heat_map, viewable
from rendergraph.textures import FORMATS

Pixels: TypeAlias = npt.NDArray[Any]


class TexelInfo(Protocol):
    """The meaning of an array's values, such as a frame's `info(name)`; `PictureInfo` describes the properties."""

    @property
    def semantic(self) -> str: ...
    @property
    def format(self) -> str: ...
    @property
    def encoding(self) -> str | None: ...
    @property
    def transparent(self) -> bool: ...


class PictureInfo(Struct, frozen=True):
    """The meaning of an array's values without a frame."""

    semantic: str = "any"
    format: str = ""  # a name in `textures.FORMATS`, empty if unknown
    encoding: str | None = None  # `display` for sRGB-encoded colours, `linear` for linear ones
    transparent: bool = False


def channel_names(info: TexelInfo, count: int) -> tuple[str, ...]:
    """Return the names of `count` channels in an EXR file."""
    if count > 1:
        return ("R", "G", "B", "A")[:count]
    known = FORMATS.get(info.format)
    is_depth = known.is_depth if known else info.semantic in ("depth", "shadow_map")
    return ("Z",) if is_depth or info.semantic == "linear_depth" else ("Y",)


_HALF_FORMATS = frozenset({"r16f", "rg16f", "rgba16f", "r11f_g11f_b10f"})


class Saved(NamedTuple):
    """One file to save: (height, width[, channels]) or (layers, height, width, channels) pixels, top row first.

    A `raw` file is a tap: EXR and HDR store its values unchanged, even display colours.
    """

    path: Path
    pixels: Pixels
    info: TexelInfo
    raw: bool = False


def save_output(
    path: Path | str, pixels: Pixels, info: TexelInfo, metadata: Mapping[str, str], *, raw: bool = False
) -> None:
    """Save one output or tap; see `save_outputs`."""
    save_outputs([Saved(Path(path), pixels, info, raw)], metadata)


def save_outputs(files: Sequence[Saved], metadata: Mapping[str, str]) -> None:
    """Save outputs and taps as files, atomically.

    PNG and JPEG are made viewable. EXR and HDR hold linear light, so display colours are decoded; a tap's values stay
    unchanged.
    """
    write_all(list(map(_job, files)), metadata)


def encoded(file: Saved, metadata: Mapping[str, str]) -> bytes:
    return picture_bytes(_job(file), metadata)


def _job(file: Saved) -> Job:
    path, pixels, info, raw = file
    decoded = not raw and info.encoding == "display"
    if info.transparent and pixels.dtype == np.uint8 and pixels.shape[-1] == 4:
        alpha = pixels[..., 3:]
        whole = np.maximum(alpha.astype(np.uint32), 1)
        straight = np.minimum((pixels[..., :3].astype(np.uint32) * 255 + whole // 2) // whole, 255).astype(np.uint8)
        if extension(path) == ".png":
            return path, np.concatenate([straight, alpha], axis=-1), None, "data", False
        if decoded and extension(path) == ".exr":  # premultiply linear values, after decoding
            share = alpha / np.float32(255)
            return path, np.concatenate([from_srgb(straight) * share, share], axis=-1), tuple("RGBA"), "linear", True
    if EXTENSIONS[extension(path)] in ("png", "jpeg"):
        return path, viewable_as(pixels, info), None, "data", False
    pixels = _numbers(pixels, info)
    shaped = pixels[..., np.newaxis] if pixels.ndim == 2 else pixels
    half = decoded or info.format in _HALF_FORMATS or pixels.dtype == np.float16
    encoding: Encoding = "display" if decoded else "linear" if info.encoding == "linear" else "data"
    return path, shaped, channel_names(info, shaped.shape[-1]), encoding, half


def viewable_as(pixels: Pixels, info: TexelInfo) -> Bytes:
    """Return an array as a viewable picture; `info` chooses how: see `viewable`."""
    return viewable(_numbers(pixels, info), info.semantic, info.encoding)


def _numbers(pixels: Pixels, info: TexelInfo) -> Pixels:
    """Return integers as numbers; other 8-bit arrays are colours."""
    known = FORMATS.get(info.format)
    return pixels.astype(np.int64) if known and known.family in ("uint", "int") else pixels


def extension(path: Path, others: Iterable[str] = ()) -> str:
    """Return a file's lower-case extension, which must be that of a picture; a message also lists `others`."""
    suffix = path.suffix.lower()
    if suffix in EXTENSIONS:
        return suffix
    what = f"'{path.suffix}' files are not written" if suffix else f"'{path}' has no extension to choose the format by"
    known = ", ".join(sorted((*EXTENSIONS, *others)))
    near = suggestion(suffix, EXTENSIONS, most=0) or f"; available: {known}"
    hint = near if suffix else f"; name it '{path}.png'"
    raise UsageError(Problem("RG501", f"{what}{hint}"))


def output_for(path: Path, outputs: Collection[str]) -> str:
    """Return the output for a file that names none: `image` or `radiance`, by its extension.

    An HDR file of a pipeline without `radiance` gets `image`, which is decoded.
    """
    defaults = ("image",) if EXTENSIONS[extension(path)] in ("png", "jpeg") else ("radiance", "image")
    for name in defaults:
        if name in outputs:
            return name
    known = sorted(outputs)
    why = f"which the pipeline lacks; name one: -o {known[0]}={path}" if known else "but the pipeline has no outputs"
    why += f" (available: {', '.join(known)})" if len(known) > 1 else ""
    raise InputError(Problem("RG505", f"'{path}' needs the output '{defaults[0]}', {why}"))


_HASHES = re.compile(r"#{2,}")


def is_numbered(path: Path) -> bool:
    """Return whether a file name has a placeholder for the frame number: two or more consecutive `#`."""
    return bool(_HASHES.search(path.name))


def numbered(path: Path, frame: int) -> Path:
    """Return the file of one frame: `a.####.png` becomes `a.0012.png`."""
    return path.with_name(_HASHES.sub(lambda match: f"{frame:0{len(match[0])}d}", path.name))


def stands_for(path: Path, file: str) -> bool:
    """Return whether a file, with symbolic links resolved, may be the file of a frame."""
    parts = [re.escape(part) for part in _HASHES.split(path.name)]
    if len(parts) == 1 or os.path.dirname(file) != os.path.realpath(path.parent):
        return False
    return re.fullmatch(r"\d{2,}".join(parts), os.path.basename(file)) is not None


def check_target(path: Path) -> None:
    """Check before rendering that a file can be written."""
    target = Path(os.path.realpath(path))
    folder, shown = target.parent, path.parent
    if not folder.is_dir():
        reason = f"there is no folder '{shown}'" if not folder.exists() else f"'{shown}' is not a folder"
    elif target.is_dir():
        reason = "it is a folder"
    elif target.exists() and not target.is_file():
        reason = "it is not a regular file"
    elif not os.access(folder, os.W_OK | os.X_OK):
        reason = f"the folder '{shown}' cannot be written to"
    else:
        return
    raise InputError(Problem("RG504", f"cannot be written: {reason}", Place(str(path))))


# --- in a notebook ---------------------------------------------------------------------------------------------------

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
    array: Pixels,
    name: str,
    info: TexelInfo,
    layer: int | None,
    channel: int | None,
    low: float | None,
    high: float | None,
) -> Shown:
    """Return a texture as a picture; see `Frame.show`."""
    if array.ndim == 4:
        layer = 0 if layer is None and len(array) == 1 else layer
        if layer is None and (channel is not None or info.semantic not in _COLORS):
            raise _mistake(f"'{name}' has {len(array)} layers; choose one: layer=0")
    elif layer not in (None, 0):
        raise _mistake(f"'{name}' has no layers, so there is no layer {layer}")
    if layer is not None and array.ndim == 4:
        array, name = _chosen(array, 0, layer, name, "layer")
    if channel is not None:
        array, name = _chosen(array, -1, channel, name, "channel")
        array = array[..., None]
    elif info.semantic in _COLORS and array.shape[-1] > 1:
        return Shown(name, viewable(array, info.semantic, info.encoding))
    elif array.shape[-1] > 1:
        raise _mistake(f"'{name}' has {array.shape[-1]} channels; choose one: channel=0")
    values = array[..., 0].astype(np.float64)
    finite = values[np.isfinite(values)]
    least, most = (float(finite.min()), float(finite.max())) if finite.size else (0.0, 1.0)
    low, high = least if low is None else low, most if high is None else high
    return Shown(name, heat_map((values - low) / max(high - low, 1e-30)), low, high)


def _chosen(array: Pixels, axis: int, number: int, name: str, what: str) -> tuple[Pixels, str]:
    if not 0 <= number < array.shape[axis]:
        raise _mistake(f"'{name}' has {array.shape[axis]} {what}s, so there is no {what} {number}")
    return array.take(number, axis), f"{name}, {what} {number}"


def _mistake(text: str) -> InputError:
    return InputError(Problem("RG205", text))
