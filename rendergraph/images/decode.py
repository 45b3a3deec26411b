"""Reading images: a scene's textures and environments, and pictures written earlier.

Images are untrusted: only regular files of six kinds, told by their first bytes, are opened, and the header is held
against limits before anything is decoded.
"""

from __future__ import annotations

import contextlib
import os
import stat
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

import numpy as np
from msgspec import Struct

from rendergraph.errors import InputError, Place, Problem
from rendergraph.images.encode import PREFIX
from rendergraph.images.files import is_text
from rendergraph.images.pixels import ImageLimits, Pixels, as_rgba, check_shape, finite, name_of, not_negative
from rendergraph.images.view import from_srgb
from rendergraph.scene.image_header import MOST_CHANNELS, READ, ChannelsError, colour_channels, image_kind
from rendergraph.scene.model import ImageSource, MadeImage

if TYPE_CHECKING:
    import OpenImageIO as oiio

_SUFFIXES = {"png": ".png", "jpeg": ".jpg", "exr": ".exr", "hdr": ".hdr", "bmp": ".bmp", "tga": ".tga"}


def decode(
    source: ImageSource,
    *,
    srgb: bool,
    warn: Callable[[Problem], None] | None = None,
    limits: ImageLimits = ImageLimits(),
) -> Pixels:
    """A scene's image, ready to be uploaded.

    Grey becomes three equal channels and a missing alpha 1; alpha is not multiplied in. Integer images keep their
    encoding (`srgb` ones are uploaded to an sRGB format); images of more than 8 bits that are not sRGB become floats
    0…1. HDR and EXR values are linear light, whatever `srgb` says; NaN becomes 0 and what is beyond the largest half
    float becomes 65504, with a warning that counts the pixels.

    Args:
        source: a file, or the bytes of one.
        srgb: whether the values are sRGB encoded.
        warn: told what was replaced.
        limits: what the header may claim.

    Returns:
        (height, width, 4), top row first, uint8 or float16.

    Raises:
        InputError: missing, of another kind, broken, or beyond a limit.
    """
    if source.loader is not None:
        from rendergraph.images.plugin_image import decode_by_plugin  # for such images alone

        return decode_by_plugin(source, source.loader, srgb=srgb, warn=warn, limits=limits)
    with _opened(source, limits) as image:
        light = image.kind in (".hdr", ".exr")
        wide = image.spec.format.basesize() > 1
        pixels = image.read(_color_channels(image), "half" if light or (wide and not srgb) else "uint8")
        pixels = _in_display_window(image, pixels)
    if light:
        pixels = finite(image.source, pixels, warn)
    return as_rgba(pixels)


def decode_light(
    source: ImageSource | MadeImage,
    *,
    warn: Callable[[Problem], None] | None = None,
    limits: ImageLimits = ImageLimits(),
) -> Pixels:
    """The picture around a scene, ready to be uploaded: light, nowhere negative.

    Returns:
        (height, width, 4), top row first, float16.

    Raises:
        InputError: missing, of another kind, broken, or beyond a limit.
    """
    if isinstance(source, MadeImage):
        return source.make()
    pixels = decode(source, srgb=True, warn=warn, limits=limits)
    check_shape(source, pixels, warn)
    if pixels.dtype == np.uint8:
        return np.concatenate([from_srgb(pixels[..., :3]), pixels[..., 3:] / np.float32(255)], axis=-1).astype(
            np.float16
        )
    return not_negative(source, pixels, warn)


def read(path: Path | str) -> Pixels:
    """A picture's values as they are: uint8, uint16, float16 or float32, top row first.

    Returns:
        (height, width, channels) in the order `R,G,B,A`, or (layers, height, width, channels) where channels are named
        `000.Y`, `001.Y` and so on.

    Raises:
        InputError: missing, of another kind, broken, or beyond a limit.
    """
    with _opened(ImageSource(Path(path)), ImageLimits()) as image:
        names = list(image.spec.channelnames)
        pixels = image.read(range(len(names)), None)
    order = sorted(range(len(names)), key=lambda i: _channel_order(names[i]))
    pixels = pixels[..., order]
    layers = {name.partition(".")[0] for name in names if "." in name}
    if layers and all(name.partition(".")[0].isdigit() for name in names) and len(names) % len(layers) == 0:
        height, width, _ = pixels.shape
        pixels = np.moveaxis(pixels.reshape(height, width, len(layers), -1), 2, 0)
    return np.ascontiguousarray(pixels)


def read_metadata(path: Path | str) -> dict[str, str]:
    """The texts `write` put into an EXR or PNG file; empty where there are none.

    Raises:
        InputError: missing, not an image, or broken.
    """
    with _opened(ImageSource(Path(path)), ImageLimits()) as image:
        found = [(entry.name, entry.value) for entry in image.spec.extra_attribs]
    return {name[len(PREFIX) :]: text for name, text in found if name.startswith(PREFIX) and isinstance(text, str)}


# --- opening ---------------------------------------------------------------------------------------------------------


class _Image(Struct):
    source: ImageSource
    kind: str
    path: str
    size: int
    handle: oiio.ImageInput
    spec: oiio.ImageSpec
    limits: ImageLimits

    def read(self, channels: range, kind: str | None) -> Pixels:
        """Decoded pixels of these channels, as `kind` or as the file holds them."""
        import OpenImageIO as oiio  # loaded with the first picture read

        wanted = oiio.TypeDesc(kind) if kind else self.spec.format
        _check_size(self, len(channels), wanted.basesize())
        with _hush:
            pixels = self.handle.read_image(0, 0, channels.start, channels.stop, wanted)
        problem = _error_of(self.handle)
        if pixels is None or problem:
            _broken(self, problem)
        return np.asarray(pixels)


@contextlib.contextmanager
def _opened(source: ImageSource, limits: ImageLimits) -> Iterator[_Image]:
    import OpenImageIO as oiio  # loaded with the first picture read

    start, size = _beginning(source)
    kind = _kind_of(source, start)
    with contextlib.ExitStack() as stack:
        path = os.path.abspath(source.path)
        if source.data is not None or Path(path).suffix.lower() != kind or not is_text(path):
            # OpenImageIO chooses the decoder by the extension and reads no memory, and takes texts for names: give the
            # file the name it deserves.
            import tempfile  # for such images alone

            folder = stack.enter_context(tempfile.TemporaryDirectory(prefix="rendergraph-"))
            named = Path(folder, f"image{kind}")
            if source.data is not None:
                named.write_bytes(source.data)
            else:
                named.symlink_to(path)
            path = str(named)
        config = oiio.ImageSpec()
        config.attribute("oiio:UnassociatedAlpha", 1)
        with _hush:
            handle = oiio.ImageInput.open(path, config)
        if handle is None:
            _refuse(source, "RG352", f"the image is broken: {_plain(_error_of(oiio), path)}")
        stack.callback(handle.close)
        image = _Image(source, kind, path, size, handle, handle.spec(), limits)
        if handle.format_name() != _FORMAT_NAMES[kind]:
            _refuse(source, "RG351", f"the image is not what it claims to be; {READ}")
        if image.spec.deep:
            _refuse(source, "RG354", "the image is deep (several samples a pixel); flatten it first")
        if image.spec.nchannels > MOST_CHANNELS:
            _refuse(source, "RG353", f"the image has {image.spec.nchannels} channels; {MOST_CHANNELS} are the limit")
        _check_size(image, 1, 1)
        yield image


_FORMAT_NAMES = {
    ".png": "png",
    ".jpg": "jpeg",
    ".exr": "openexr",
    ".hdr": "hdr",
    ".bmp": "bmp",
    ".tga": "targa",
}


def _beginning(source: ImageSource) -> tuple[bytes, int]:
    """The first bytes and the length of the encoded image."""
    if source.data is not None:
        return source.data[:16], len(source.data)
    try:
        mode = os.stat(source.path)
        if not stat.S_ISREG(mode.st_mode):
            what = "a folder" if stat.S_ISDIR(mode.st_mode) else "not a regular file"
            _refuse(source, "RG350", f"the image cannot be read: it is {what}")
        with open(source.path, "rb") as file:
            return file.read(16), mode.st_size
    except FileNotFoundError:
        _refuse(source, "RG350", "there is no such image")
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else str(error)
        _refuse(source, "RG350", f"the image cannot be read: {reason}")


def _kind_of(source: ImageSource, start: bytes) -> str:
    if not start:
        _refuse(source, "RG352", "the image is broken: the file is empty")
    kind = image_kind(start, "" if source.data is not None else source.path.suffix)
    if kind is None:
        _refuse(source, "RG351", f"this is no image of a known kind; {READ}")
    return _SUFFIXES[kind]


def _check_size(image: _Image, channels: int, item: int) -> None:
    spec, limits = image.spec, image.limits
    width, height = max(spec.width, spec.full_width), max(spec.height, spec.full_height)
    if max(width, height) > limits.side or spec.depth > 1:
        depth = f"×{spec.depth}" if spec.depth > 1 else ""
        text = f"the image is {width}×{height}{depth} pixels; the limit is {limits.side} a side"
        _refuse(image.source, "RG353", text)
    decoded = width * height * max(4, channels) * item
    if decoded > limits.bytes:
        text = f"the image takes {decoded >> 20} MiB decoded; the limit is {limits.bytes >> 20} MiB"
        _refuse(image.source, "RG353", text)
    if decoded > limits.ratio_from and decoded > limits.ratio * image.size:
        text = (
            f"the image claims {decoded >> 20} MiB in a file of {image.size} bytes; "
            f"above {limits.ratio_from >> 20} MiB the limit is {limits.ratio}:1"
        )
        _refuse(image.source, "RG353", text)


def _refuse(source: ImageSource, code: str, text: str) -> NoReturn:
    raise InputError(Problem(code, text, Place(name_of(source))))


def _broken(image: _Image, problem: str) -> NoReturn:
    _refuse(image.source, "RG352", f"the image is broken: {_plain(problem, image.path)}")


def _error_of(thing: Any) -> str:
    """OpenImageIO's words; they may quote the file's own bytes, which need not be text."""
    try:
        return str(thing.geterror())
    except UnicodeDecodeError as error:
        return bytes(error.object).decode("ascii", "replace")


def _plain(problem: str, path: str) -> str:
    lines = [line for line in problem.splitlines() if line.strip()] or ["it cannot be decoded"]
    line = lines[0].replace(path, "the file").replace(f'"{os.path.basename(path)}"', "the file")
    return "".join(c if c.isprintable() else "?" for c in line)[:200]


class _Hush:
    """Keeps libpng from writing to stderr beside our message: it does so itself, past Python.

    Images are decoded in several threads; the first one in redirects, the last one out restores.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._inside = 0
        self._kept = -1

    def __enter__(self) -> None:
        with self._lock:
            self._inside += 1
            if self._inside > 1:
                return
            try:
                self._kept = os.dup(2)
            except OSError:  # no stderr at all
                return
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, 2)
            os.close(nowhere)

    def __exit__(self, *problem: object) -> None:
        with self._lock:
            self._inside -= 1
            if self._inside == 0 and self._kept >= 0:
                os.dup2(self._kept, 2)
                os.close(self._kept)
                self._kept = -1


_hush = _Hush()


# --- pixels ----------------------------------------------------------------------------------------------------------


def _color_channels(image: _Image) -> range:
    """The channels that are the colour, side by side as OpenImageIO sorts them."""
    names = [name.upper() for name in image.spec.channelnames]
    if image.kind != ".exr":
        return range(min(len(names), 4))
    try:
        wanted = list(colour_channels(image.spec.channelnames))
    except ChannelsError as problem:
        _refuse(image.source, "RG354", f"the image {problem}")
    first = names.index(wanted[0])
    if names[first : first + len(wanted)] != wanted:
        _refuse(image.source, "RG354", "the image's channels R, G, B, A are not side by side")
    return range(first, first + len(wanted))


def _in_display_window(image: _Image, pixels: Pixels) -> Pixels:
    """An EXR may hold a part of its picture, or more than it."""
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
