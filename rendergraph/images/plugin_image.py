"""Images that a plugin decodes: what it gives held against the same limits as a file of ours."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from rendergraph.declare import Added
from rendergraph.declare.extension import ImageLoader
from rendergraph.errors import InputError, Place, Problem, shown_file
from rendergraph.images.pixels import ImageLimits, Pixels, as_rgba, finite
from rendergraph.scene.model import ImageSource


def decode_by_plugin(
    source: ImageSource,
    loader: Added[ImageLoader],
    *,
    srgb: bool,
    warn: Callable[[Problem], None] | None,
    limits: ImageLimits,
) -> Pixels:
    """A scene's image of a kind that a plugin reads, as `decode` gives it.

    Raises:
        InputError: the file cannot be read, the loader raises, or what it gives is no picture or too large.
    """
    try:
        data = source.path.read_bytes()
    except OSError as error:
        text = f"the image cannot be read: {error.strerror}"
        raise InputError(Problem("RG350", text, Place(source.label))) from None
    what = f"image '{source.label}'"
    pixels = loader.run("RG497", f"{what} cannot be read", data)
    mistake = _mistake(pixels, limits)
    if mistake:
        text = f"{what} cannot be read: the loader of plugin '{loader.plugin}' gave {mistake}"
        raise InputError(Problem("RG498", text, Place(shown_file(loader.file))))
    pixels = pixels.reshape(*pixels.shape[:2], -1)
    if pixels.dtype == np.uint8:
        return as_rgba(pixels)
    with np.errstate(over="ignore"):  # what a half float cannot hold becomes infinite, and is said so
        light = pixels.astype(np.float16)
    return as_rgba(finite(source, light, warn))


def _mistake(pixels: object, limits: ImageLimits) -> str:
    if not isinstance(pixels, np.ndarray):
        return f"{type(pixels).__name__}, not an array"
    if pixels.ndim not in (2, 3) or not all(pixels.shape) or (pixels.ndim == 3 and pixels.shape[2] > 4):
        return f"an array of shape {pixels.shape}, not (height, width) or (height, width, 1 to 4)"
    if pixels.dtype != np.uint8 and not np.issubdtype(pixels.dtype, np.floating):
        return f"{pixels.dtype} values, not uint8 or floats"
    height, width = pixels.shape[:2]
    if max(height, width) > limits.side or height * width * 8 > limits.bytes:
        return f"{width}×{height} pixels; the limit is {limits.side} a side and {limits.bytes >> 20} MiB"
    return ""
