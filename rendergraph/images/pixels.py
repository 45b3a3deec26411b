"""Decoded pixels as they go to the GPU: finite, with four channels, within limits."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt
from msgspec import Struct

from rendergraph.errors import Place, Problem
from rendergraph.images.encode import HALF_MAX
from rendergraph.scene.model import ImageSource

Pixels: TypeAlias = npt.NDArray[Any]


class ImageLimits(Struct, frozen=True):
    """What an image may claim.

    Attributes:
        side: pixels of the longer side; a driver's own limit may be lower.
        bytes: decoded size as RGBA.
        ratio: decoded to encoded size, where the decoded size is above `ratio_from` bytes.
    """

    side: int = 16384
    bytes: int = 2 << 30
    ratio: int = 1000
    ratio_from: int = 64 << 20


def name_of(source: ImageSource) -> str:
    """What messages call an image."""
    return source.label or str(source.path)


def finite(source: ImageSource, pixels: Pixels, warn: Callable[[Problem], None] | None) -> Pixels:
    """Light without NaN and infinity; `warn` is told how much was replaced."""
    if np.isfinite(pixels).all():
        return pixels
    unknown = int((np.isnan(pixels) | np.isneginf(pixels)).any(axis=-1).sum())
    large = int(np.isposinf(pixels).any(axis=-1).sum())
    said = [f"{_pixels(unknown)} NaN or -inf, taken as 0"] if unknown else []
    said += [f"{_pixels(large)} infinite or beyond {HALF_MAX:.0f}, taken as {HALF_MAX:.0f}"] if large else []
    if warn:
        warn(Problem("RG355", "; ".join(said), Place(name_of(source)), severity="warning"))
    return np.nan_to_num(pixels, nan=0.0, posinf=HALF_MAX, neginf=0.0)


def not_negative(source: ImageSource, pixels: Pixels, warn: Callable[[Problem], None] | None) -> Pixels:
    """Light that is nowhere less than none; `warn` is told how much was replaced."""
    below = (pixels[..., :3] < 0).any(axis=-1)
    if not below.any():
        return pixels
    if warn:
        text = f"{_pixels(int(below.sum()))} negative, taken as 0"
        warn(Problem("RG355", text, Place(name_of(source)), severity="warning"))
    return np.maximum(pixels, 0)


def check_shape(source: ImageSource, pixels: Pixels, warn: Callable[[Problem], None] | None) -> None:
    """Warn of a picture that is far from twice as wide as high, as one of everything around is, unless it is even."""
    height, width = pixels.shape[:2]
    if warn and not 1.5 <= width / height <= 2.7 and (pixels != pixels[0, 0]).any():
        text = f"it is {width}×{height}, but a picture of everything around is twice as wide as high; it is stretched"
        warn(Problem("RG356", text, Place(name_of(source)), severity="warning"))


def as_rgba(pixels: Pixels) -> Pixels:
    """Four channels from one to four: grey three times, and an alpha of one."""
    height, width, count = pixels.shape
    one = 255 if pixels.dtype == np.uint8 else 1
    rgba = np.full((height, width, 4), one, dtype=pixels.dtype)
    if count <= 2:
        rgba[..., :3] = pixels[..., :1]
        rgba[..., 3:] = pixels[..., 1:] if count == 2 else one
    else:
        rgba[..., :count] = pixels
    return rgba


def _pixels(count: int) -> str:
    return f"{count} pixels are" if count != 1 else "1 pixel is"
