"""Read images: textures and environments of a scene, and pictures written earlier. Mistakes raise InputErrors."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from rendergraph.declare import Added
from rendergraph.declare.extensions import ImageLoader
from rendergraph.errors import InputError, Place, Problem, shown_file
from rendergraph.images.encode import HALF_MAX, PREFIX, REC709
from rendergraph.images.viewable import from_srgb
from rendergraph.scene.image_files import ImageError, ImageFile, open_image
from rendergraph.scene.model import ImageSource, MadeImage, SceneLimits

Pixels: TypeAlias = npt.NDArray[Any]
Warn: TypeAlias = Callable[[Problem], None]
_BRADFORD = np.array([(0.8951, 0.2664, -0.1614), (-0.7502, 1.7135, 0.0367), (0.0389, -0.0685, 1.0296)])


def decode(source: ImageSource, *, srgb: bool, warn: Warn | None = None, limits: SceneLimits = SceneLimits()) -> Pixels:
    """Decode a scene's image for upload: (height, width, 4), top row first, uint8 or float16.

    Grey becomes three equal channels and a missing alpha 1; alpha is straight. Integer images keep their encoding
    (`srgb` ones are uploaded to an sRGB format); images with more than 8 bits that are not sRGB become floats 0…1. HDR
    and EXR values are linear light, whatever `srgb` says; NaN becomes 0 and values beyond the largest half float become
    65504, with a warning that counts the pixels. Colours (`srgb`) of an EXR file with other primaries are converted to
    Rec. 709.
    """
    if source.loader is not None:
        return _decode_by_plugin(source, source.loader, warn, limits)
    with _opened(source, limits) as image:
        is_light = image.kind in (".hdr", ".exr")
        is_wide = image.spec.format.basesize() > 1
        kind = "half" if is_light or (is_wide and not srgb) else "uint8"
        pixels = _in_display_window(image, np.asarray(image.read(image.color_channels(), kind, limits)))
        primaries = image.spec.get("chromaticities") if srgb and image.kind == ".exr" else None
    if not is_light:
        return _as_rgba(pixels)
    pixels = _finite(source, pixels, warn)
    if primaries is not None and pixels.shape[-1] >= 3 and not np.allclose(primaries, REC709, atol=1e-3):
        colors = pixels[..., :3].astype(np.float32) @ to_rec709(primaries).T.astype(np.float32)
        pixels[..., :3] = np.clip(colors, 0, HALF_MAX)  # colours outside Rec. 709 are clipped
    return _as_rgba(pixels)


def to_rec709(primaries: Sequence[float]) -> npt.NDArray[np.float64]:
    """Return the matrix (3, 3) from colours with these primaries to linear Rec. 709.

    `primaries` are x and y of red, green, blue and white, as in OpenEXR. White stays white, by von Kries adaptation in
    the Bradford cone space (Lam 1985).
    """
    source, white = _to_xyz(primaries)
    target, daylight = _to_xyz(REC709)
    adapted = np.linalg.inv(_BRADFORD) @ np.diag(_BRADFORD @ daylight / (_BRADFORD @ white)) @ _BRADFORD
    return np.asarray(np.linalg.inv(target) @ adapted @ source)


def _to_xyz(primaries: Sequence[float]) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """Return the matrix from RGB to XYZ, and the XYZ of white with a Y of 1 (SMPTE RP 177, 1993)."""
    x, y = np.array(primaries, np.float64).reshape(4, 2).T
    columns = np.stack([x / y, np.ones(4), (1 - x - y) / y])
    return columns[:, :3] * np.linalg.solve(columns[:, :3], columns[:, 3]), columns[:, 3]


def decode_light(
    source: ImageSource | MadeImage, *, warn: Warn | None = None, limits: SceneLimits = SceneLimits()
) -> Pixels:
    """Decode an environment map for upload: linear light without negative values, (height, width, 4) in float16."""
    if isinstance(source, MadeImage):
        return source.make()
    pixels = decode(source, srgb=True, warn=warn, limits=limits)
    height, width = pixels.shape[:2]
    if not 1.5 <= width / height <= 2.7 and (pixels != pixels[0, 0]).any():
        text = f"it is {width}×{height}, but an environment map is twice as wide as high; it is stretched"
        _warn(warn, "RG356", text, source)
    if pixels.dtype == np.uint8:
        colors = from_srgb(pixels[..., :3])
        return np.concatenate([colors, pixels[..., 3:] / np.float32(255)], axis=-1).astype(np.float16)
    negative = (pixels[..., :3] < 0).any(axis=-1)
    if not negative.any():
        return pixels
    _warn(warn, "RG355", f"{_counted(int(negative.sum()))} negative, replaced by 0", source)
    return np.maximum(pixels, 0)


def read(path: Path | str) -> Pixels:
    """Read a picture's values as they are: uint8, uint16, float16 or float32, top row first.

    The shape is (height, width, channels) in the order `R,G,B,A`, or (layers, height, width, channels) if channels are
    named `000.Y`, `001.Y` and so on.
    """
    limits = SceneLimits()
    with _opened(ImageSource(Path(path)), limits) as image:
        names = list(image.spec.channelnames)
        pixels = np.asarray(image.read(range(len(names)), None, limits))
    order = sorted(range(len(names)), key=lambda i: _channel_order(names[i]))
    pixels = pixels[..., order]
    layers = {name.partition(".")[0] for name in names if "." in name}
    if layers and all(name.partition(".")[0].isdigit() for name in names) and len(names) % len(layers) == 0:
        height, width, _ = pixels.shape
        pixels = np.moveaxis(pixels.reshape(height, width, len(layers), -1), 2, 0)
    return np.ascontiguousarray(pixels)


def read_metadata(path: Path | str) -> dict[str, str]:
    """Read the metadata that `write` stored in an EXR or PNG file; empty if there is none."""
    with _opened(ImageSource(Path(path)), SceneLimits()) as image:
        attributes = [(entry.name, entry.value) for entry in image.spec.extra_attribs]
    return {name[len(PREFIX) :]: text for name, text in attributes if name.startswith(PREFIX) and isinstance(text, str)}


@contextlib.contextmanager
def _opened(source: ImageSource, limits: SceneLimits) -> Iterator[ImageFile]:
    try:
        with open_image(source, limits) as image:
            yield image
    except ImageError as error:
        raise _error(source, error.code, f"the image {error.reason}") from None


def _error(source: ImageSource, code: str, text: str) -> InputError:
    return InputError(Problem(code, text, Place(source.label or str(source.path))))


def _warn(warn: Warn | None, code: str, text: str, source: ImageSource) -> None:
    if warn:
        warn(_error(source, code, text).problems[0].as_warning())


def _counted(count: int) -> str:
    return f"{count} pixels are" if count != 1 else "1 pixel is"


def _in_display_window(image: ImageFile, pixels: Pixels) -> Pixels:
    """Place the data window of an EXR file in its display window; the rest is 0."""
    spec = image.spec
    window = (spec.full_x, spec.full_y, spec.full_width, spec.full_height)
    if image.kind != ".exr" or window == (spec.x, spec.y, spec.width, spec.height):
        return pixels
    whole = np.zeros((spec.full_height, spec.full_width, pixels.shape[-1]), dtype=pixels.dtype)
    left, top = max(spec.x, spec.full_x), max(spec.y, spec.full_y)
    right = min(spec.x + spec.width, spec.full_x + spec.full_width)
    bottom = min(spec.y + spec.height, spec.full_y + spec.full_height)
    if right > left and bottom > top:
        part = pixels[top - spec.y : bottom - spec.y, left - spec.x : right - spec.x]
        whole[top - spec.full_y : bottom - spec.full_y, left - spec.full_x : right - spec.full_x] = part
    return whole


def _channel_order(name: str) -> tuple[str, int, str]:
    layer, dot, channel = name.rpartition(".")
    known = "RGBAYZ"
    return layer if dot else "", known.find(channel) if channel in known else len(known), channel


def _finite(source: ImageSource, pixels: Pixels, warn: Warn | None) -> Pixels:
    """Replace NaN and infinity, with a warning that counts the pixels."""
    if np.isfinite(pixels).all():
        return pixels
    unknown = int((np.isnan(pixels) | np.isneginf(pixels)).any(axis=-1).sum())
    large = int(np.isposinf(pixels).any(axis=-1).sum())
    texts = [f"{_counted(unknown)} NaN or -inf, replaced by 0"] if unknown else []
    texts += [f"{_counted(large)} infinite or beyond {HALF_MAX:.0f}, replaced by {HALF_MAX:.0f}"] if large else []
    _warn(warn, "RG355", "; ".join(texts), source)
    return np.nan_to_num(pixels, nan=0.0, posinf=HALF_MAX, neginf=0.0)


def _as_rgba(pixels: Pixels) -> Pixels:
    """Return four channels from one to four: grey is repeated, and a missing alpha is 1."""
    if pixels.shape[-1] <= 2:
        pixels = np.concatenate([np.repeat(pixels[..., :1], 3, axis=-1), pixels[..., 1:]], axis=-1)
    rgba = np.full((*pixels.shape[:2], 4), 255 if pixels.dtype == np.uint8 else 1, dtype=pixels.dtype)
    rgba[..., : pixels.shape[-1]] = pixels
    return rgba


def _decode_by_plugin(
    source: ImageSource, loader: Added[ImageLoader], warn: Warn | None, limits: SceneLimits
) -> Pixels:
    try:
        data = source.path.read_bytes()
    except OSError as error:
        raise _error(source, "RG350", f"the image cannot be read: {error.strerror}") from None
    what = f"image '{source.label}'"
    pixels = loader.run("RG497", f"{what} cannot be read", data)
    mistake = _plugin_mistake(pixels, limits)
    if mistake:
        text = f"{what} cannot be read: the loader of plugin '{loader.plugin}' returned {mistake}"
        raise InputError(Problem("RG498", text, Place(shown_file(loader.file))))
    pixels = pixels.reshape(*pixels.shape[:2], -1)
    if pixels.dtype == np.uint8:
        return _as_rgba(pixels)
    with np.errstate(over="ignore"):  # values beyond half floats become infinite, and are reported
        light = pixels.astype(np.float16)
    return _as_rgba(_finite(source, light, warn))


def _plugin_mistake(pixels: object, limits: SceneLimits) -> str:
    if not isinstance(pixels, np.ndarray):
        return f"{type(pixels).__name__}, not an array"
    if pixels.ndim not in (2, 3) or not all(pixels.shape) or (pixels.ndim == 3 and pixels.shape[2] > 4):
        return f"an array of shape {pixels.shape}, not (height, width) or (height, width, 1 to 4)"
    if pixels.dtype != np.uint8 and not np.issubdtype(pixels.dtype, np.floating):
        return f"{pixels.dtype} values, not uint8 or floats"
    height, width = pixels.shape[:2]
    if max(height, width) > limits.image_side or height * width * 8 > limits.image_bytes:
        megabytes = limits.image_bytes >> 20
        return f"{width}×{height} pixels; the limit is {limits.image_side} per side and {megabytes} MiB"
    return ""
