"""Image files: their format, size and channels, read by OpenImageIO before anything is decoded.

Images are untrusted. Only regular files of six formats, recognised by their first bytes, are opened, and the header is
checked against the limits; mistakes are ImageErrors. `images.decode` continues with the opened file.
"""

from __future__ import annotations

import contextlib
import os
import re
import stat
import struct
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from msgspec import Struct

from rendergraph.scene.model import ImageSource, SceneLimits

if TYPE_CHECKING:
    import OpenImageIO as oiio

READ = "PNG, JPEG, HDR, EXR, BMP and TGA are read"
MOST_CHANNELS = 256
_RATIO_FROM = 64 << 20
_MAGIC = {b"\x89PNG\r\n\x1a\n": ".png", b"\xff\xd8\xff": ".jpg", b"v/1\x01": ".exr", b"#?": ".hdr", b"BM": ".bmp"}
_FORMATS = {".png": "png", ".jpg": "jpeg", ".exr": "openexr", ".hdr": "hdr", ".bmp": "bmp", ".tga": "targa"}
"""Extension to OpenImageIO's name of the format."""
_JPEG_SEGMENT = re.compile(rb"\xff+([\x01-\xfe])(..)", re.DOTALL)
_JPEG_FRAMES = {bytes([marker]) for marker in range(0xC0, 0xD0)} - {b"\xc4", b"\xc8", b"\xcc"}


class ImageError(Exception):
    """A mistake in an image; the reason continues "the image …"."""

    def __init__(self, code: str, reason: str) -> None:
        super().__init__(reason)
        self.code, self.reason = code, reason


class ImageFile(Struct):
    """An opened image; `kind` is the extension of its format, `bytes` the size of the file."""

    kind: str
    path: str
    bytes: int
    handle: oiio.ImageInput
    spec: oiio.ImageSpec

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the decoded image; an EXR file may store only a part of it, or more."""
        return self.spec.full_width, self.spec.full_height

    def read(self, channels: range, kind: str | None, limits: SceneLimits) -> Any:
        """Return the pixels of these channels, as `kind` or as the file stores them."""
        import OpenImageIO as oiio  # loaded with the first picture read

        texel = oiio.TypeDesc(kind) if kind else self.spec.format
        _check_size(*self._extent(), self.bytes, limits, len(channels) * texel.basesize())
        with _silence:
            pixels = self.handle.read_image(0, 0, channels.start, channels.stop, texel)
        problem = _error_of(self.handle)
        if pixels is None or problem:
            raise ImageError("RG352", f"is broken: {_one_line(problem, self.path)}")
        return pixels

    def check(self, limits: SceneLimits) -> None:
        if self.handle.format_name() != _FORMATS[self.kind]:
            raise ImageError("RG351", f"is not what it claims to be; {READ}")
        if self.spec.deep:
            raise ImageError("RG354", "is deep (several samples per pixel); flatten it first")
        if self.spec.nchannels > MOST_CHANNELS:
            raise ImageError("RG353", f"has {self.spec.nchannels} channels, the limit is {MOST_CHANNELS}")
        if self.spec.depth > 1:
            raise ImageError("RG353", f"has {self.spec.depth} layers of depth; only flat images are read")
        _check_size(*self._extent(), self.bytes, limits, 4 * min(2, self.spec.format.basesize()))

    def _extent(self) -> tuple[int, int]:
        return max(self.spec.width, self.spec.full_width), max(self.spec.height, self.spec.full_height)

    def color_channels(self) -> range:
        """Return the colour channels, which are consecutive in OpenImageIO's order."""
        names = [name.upper() for name in self.spec.channelnames]
        if self.kind != ".exr":
            return range(min(len(names), 4))
        if "RY" in names or "BY" in names:
            raise ImageError("RG354", "contains luminance and chroma; convert it to R, G, B")
        color = ["R", "G", "B"] if "R" in names else ["Y"]
        if not set(color) <= set(names):
            listed = ", ".join(self.spec.channelnames[:8])
            raise ImageError("RG354", f"has the channels {listed}; R, G, B (and A) or Y are needed")
        color += ["A"] if "R" in names and "A" in names else []
        first = names.index(color[0])
        if names[first : first + len(color)] != color:
            raise ImageError("RG354", "has channels R, G, B, A that are not next to each other")
        return range(first, first + len(color))


def read_header(source: ImageSource, limits: SceneLimits) -> tuple[tuple[int, int], int]:
    """Return the size of the decoded image, width and height, and the number of its channels."""
    head, size = _first_bytes(source)
    if _kind_of(head, source) == ".jpg":  # OpenImageIO decodes a progressive JPEG when opening it
        width, height, channels = _jpeg_frame(source)
        _check_size(width, height, size, limits)
        return (width, height), channels
    with open_image(source, limits) as image:
        return image.size, len(image.color_channels())


def _jpeg_frame(source: ImageSource) -> tuple[int, int, int]:
    head, _ = _first_bytes(source, 1 << 20)
    at = 2
    while (segment := _JPEG_SEGMENT.match(head, at)) is not None:
        if segment[1] in _JPEG_FRAMES and len(head) >= segment.end() + 6:
            height, width, channels = struct.unpack_from(">HHB", head, segment.end() + 1)
            return width, height, channels
        at = segment.end() - 2 + int.from_bytes(segment[2])
    raise ImageError("RG352", "is broken: it has no JPEG frame header")


@contextlib.contextmanager
def open_image(source: ImageSource, limits: SceneLimits) -> Iterator[ImageFile]:
    """Open an image whose header is within the limits."""
    head, size = _first_bytes(source)
    kind = _kind_of(head, source)
    try:
        import OpenImageIO as oiio  # loaded with the first picture read
    except ImportError as error:
        raise ImageError("RG350", f"cannot be read: OpenImageIO is not available ({error})") from None
    if kind == ".jpg":  # JPEGs and compressed BMPs may be decoded on opening
        _check_size(*_jpeg_frame(source)[:2], size, limits)
    elif kind == ".bmp" and len(head) >= 26 and head[14] > 12:
        width, height = struct.unpack_from("<ii", head, 18)
        _check_size(width, abs(height), size, limits)
    with contextlib.ExitStack() as stack:
        path = stack.enter_context(_readable_path(source, kind))
        config = oiio.ImageSpec()
        config.attribute("oiio:UnassociatedAlpha", 1)
        with _silence:
            handle = oiio.ImageInput.open(path, config)
        if handle is None:
            raise ImageError("RG352", f"is broken: {_one_line(_error_of(oiio), path)}")
        stack.callback(handle.close)
        image = ImageFile(kind, path, size, handle, handle.spec())
        image.check(limits)
        yield image


@contextlib.contextmanager
def _readable_path(source: ImageSource, kind: str) -> Iterator[str]:
    """Yield a path for OpenImageIO, which chooses the decoder by extension and cannot read from memory."""
    path = os.path.abspath(source.path)
    if source.data is None and Path(path).suffix.lower() == kind and is_text(path):
        yield path
        return
    import tempfile  # only for such images

    with tempfile.TemporaryDirectory(prefix="rendergraph-") as folder:
        other = Path(folder, f"image{kind}")
        other.symlink_to(path) if source.data is None else other.write_bytes(source.data)
        yield str(other)


def _first_bytes(source: ImageSource, count: int = 32) -> tuple[bytes, int]:
    if source.data is not None:
        return source.data[:count], len(source.data)
    try:
        status = os.stat(source.path)
        if not stat.S_ISREG(status.st_mode):
            raise ImageError("RG350", "is not a regular file")
        with open(source.path, "rb") as file:
            return file.read(count), status.st_size
    except FileNotFoundError:
        raise ImageError("RG350", "does not exist") from None
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else str(error)
        raise ImageError("RG350", f"cannot be read: {reason}") from None


def _kind_of(head: bytes, source: ImageSource) -> str:
    """Return the extension of the format; TGA has no magic number, so the name decides."""
    if not head:
        raise ImageError("RG352", "is broken: the file is empty")
    is_tga = source.data is None and source.path.suffix.lower() == ".tga"
    kind = next((kind for magic, kind in _MAGIC.items() if head.startswith(magic)), ".tga" if is_tga else None)
    if kind is None:
        raise ImageError("RG351", f"has an unknown format; {READ}")
    return kind


def _check_size(width: int, height: int, size: int, limits: SceneLimits, texel_bytes: int = 4) -> None:
    """Check a decoded image of at least four bytes per texel, whose file has `size` bytes, against the limits."""
    if max(width, height) > limits.image_side:
        raise ImageError("RG353", limits.exceeded(f"is {width}×{height} pixels", "image_side"))
    decoded = width * height * max(4, texel_bytes)
    if decoded > limits.image_bytes:
        raise ImageError("RG353", limits.exceeded(f"takes {decoded:,} bytes decoded", "image_bytes"))
    if decoded > _RATIO_FROM and decoded > limits.image_ratio * size:
        text = f"takes {decoded:,} bytes decoded and {size:,} encoded, a ratio of {decoded // max(size, 1):,}"
        raise ImageError("RG353", limits.exceeded(text, "image_ratio"))


def _error_of(thing: Any) -> str:
    """Return OpenImageIO's message; it may quote bytes of the file, which need not be text."""
    try:
        return str(thing.geterror())
    except UnicodeDecodeError as error:
        return bytes(error.object).decode("ascii", "replace")


def _one_line(problem: str, path: str) -> str:
    lines = [line for line in problem.splitlines() if line.strip()] or ["it cannot be decoded"]
    line = lines[0].replace(path, "the file").replace(f'"{os.path.basename(path)}"', "the file")
    return "".join(c if c.isprintable() else "?" for c in line)[:200]


def is_text(path: str) -> bool:
    """Return whether a path is text; file names may be any bytes."""
    try:
        path.encode()
    except UnicodeEncodeError:
        return False
    return True


class _Silence:
    """Keeps libpng from writing to stderr.

    Images are opened in several threads: the first one to enter redirects, the last one to leave restores.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._inside = 0
        self._stderr = -1

    def __enter__(self) -> None:
        with self._lock:
            self._inside += 1
            if self._inside > 1:
                return
            try:
                self._stderr = os.dup(2)
            except OSError:  # the process has no stderr
                return
            devnull = os.open(os.devnull, os.O_WRONLY)
            os.dup2(devnull, 2)
            os.close(devnull)

    def __exit__(self, *problem: object) -> None:
        with self._lock:
            self._inside -= 1
            if self._inside == 0 and self._stderr >= 0:
                os.dup2(self._stderr, 2)
                os.close(self._stderr)
                self._stderr = -1


_silence = _Silence()
