"""What an image file's first bytes say, without decoding it: its kind, size and channels.

Enough to refuse what is no image that can be read and what would balloon; `images.decode` goes by the same kinds and
channels, so that `check` refuses what drawing would.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Sequence

from msgspec import Struct

HEAD_BYTES = 1 << 20
READ = "PNG, JPEG, HDR, EXR, BMP and TGA are read"
MOST_CHANNELS = 256
_MAGIC = {b"\x89PNG\r\n\x1a\n": "png", b"\xff\xd8\xff": "jpeg", b"v/1\x01": "exr", b"#?": "hdr", b"BM": "bmp"}


class NoImageError(ValueError):
    """The bytes are those of something else."""


class ChannelsError(ValueError):
    """The image holds no colour that can be used."""


class Header(Struct, frozen=True):
    """What the first bytes say; sizes are None where they do not.

    Attributes:
        format: `png`, `jpeg`, `exr`, `hdr`, `bmp`, `tga`, or a plugin's.
        width, height: the larger of what is stored and what is shown.
        channels: in the file.
        channel_bytes: of a decoded channel.
        cropped: what is stored and what is shown differ.
    """

    format: str
    width: int | None = None
    height: int | None = None
    channels: int = 4
    channel_bytes: int = 1
    cropped: bool = False

    @property
    def size(self) -> tuple[int, int] | None:
        """Width and height of the decoded image; None where only decoding tells."""
        return None if self.width is None or self.height is None or self.cropped else (self.width, self.height)

    @property
    def decoded_bytes(self) -> int | None:
        """Bytes of the decoded image, which has four channels; None where the size is not known."""
        if self.width is None or self.height is None:
            return None
        return self.width * self.height * 4 * self.channel_bytes


def image_kind(start: bytes, suffix: str = "") -> str | None:
    """The kind of image that begins like this, None where none does; TGA has no mark and goes by its extension."""
    for magic, kind in _MAGIC.items():
        if start.startswith(magic):
            return kind
    return "tga" if suffix.lower() == ".tga" else None


def colour_channels(names: Sequence[str]) -> tuple[str, ...]:
    """The channels of an EXR that are its colour: `R`, `G`, `B` and perhaps `A`, or `Y`.

    Raises:
        ChannelsError: it has none; the text continues "the image …".
    """
    upper = [name.upper() for name in names]
    if "RY" in upper or "BY" in upper:
        raise ChannelsError("holds luminance and chroma; convert it to R, G, B")
    needed = ("R", "G", "B") if "R" in upper else ("Y",)
    if not all(name in upper for name in needed):
        raise ChannelsError(f"has the channels {', '.join(names[:8])}; R, G, B (and A) or Y are needed")
    return (*needed, "A") if "R" in upper and "A" in upper else needed


def read(head: bytes, suffix: str = "") -> Header:
    """What an image's first bytes say.

    Args:
        head: the first `HEAD_BYTES` bytes, or all.
        suffix: the file's extension, for formats that have no mark of their own.

    Raises:
        NoImageError: it is something else; the text continues "the file …".
        ValueError: its header is broken; likewise.
    """
    if not head:
        raise ValueError("is empty")
    kind = image_kind(head, suffix)
    if kind is None:
        raise NoImageError(f"is no image of a known kind; {READ}")
    try:
        return _READERS[kind](head)
    except (struct.error, IndexError):
        raise ValueError("ends inside its header") from None


def _png(head: bytes) -> Header:
    if head[12:16] != b"IHDR":
        raise ValueError("has a broken PNG header")
    width, height, depth, color = struct.unpack(">IIBB", head[16:26])
    channels = {0: 1, 2: 3, 3: 3, 4: 2, 6: 4}.get(color)
    if channels is None or depth not in (1, 2, 4, 8, 16):
        raise ValueError("has a broken PNG header")
    return Header("png", width, height, channels, 2 if depth == 16 else 1)


def _jpeg(head: bytes) -> Header:
    at = 2
    while at + 4 <= len(head):
        if head[at] != 0xFF:
            raise ValueError("has a broken JPEG header")
        marker = head[at + 1]
        if marker == 0xFF or 0xD0 <= marker <= 0xD8 or marker == 0x01:  # fill bytes and markers without a length
            at += 1 if marker == 0xFF else 2
            continue
        if 0xC0 <= marker <= 0xCF and marker not in (0xC4, 0xC8, 0xCC):
            height, width, channels = struct.unpack(">HHB", head[at + 5 : at + 10])
            return Header("jpeg", width, height, channels)
        if marker in (0xD9, 0xDA):
            raise ValueError("has a JPEG header without a size")
        at += 2 + max(2, struct.unpack(">H", head[at + 2 : at + 4])[0])
    if len(head) < HEAD_BYTES:
        raise ValueError("ends inside its header")
    return Header("jpeg")


def _hdr(head: bytes) -> Header:
    found = re.search(rb"\n([+-])([XY]) (\d{1,9}) ([+-])([XY]) (\d{1,9})\r?\n", head[:65536])
    if not head.startswith((b"#?RADIANCE", b"#?RGBE")) or not found or found[2] == found[5]:
        raise ValueError("has a broken HDR header")
    first, second = int(found[3]), int(found[6])
    height, width = (first, second) if found[2] == b"Y" else (second, first)
    return Header("hdr", width, height, 3, 2)


def _bmp(head: bytes) -> Header:
    if struct.unpack("<I", head[14:18])[0] == 12:  # the first version's, of OS/2
        width, height = struct.unpack("<HH", head[18:22])
    else:
        width, height = struct.unpack("<ii", head[18:26])
    return Header("bmp", width, abs(height), 3)  # a negative height has the top row first


def _tga(head: bytes) -> Header:
    width, height, bits = struct.unpack("<HHB", head[12:17])
    return Header("tga", width, height, max(1, bits // 8))


def _exr(head: bytes) -> Header:
    (flags,) = struct.unpack("<I", head[4:8])
    if flags & 0xFF != 2:
        raise ValueError("has a broken EXR header")
    if flags & 0x800:
        raise ChannelsError("is deep (several samples a pixel); flatten it first")
    at, sides, windows, names = 8, [], [], list[str]()
    while at < len(head) and head[at]:
        name, at = _zero_ended(head, at)
        kind, at = _zero_ended(head, at)
        (size,) = struct.unpack("<I", head[at : at + 4])
        value, at = head[at + 4 : at + 4 + size], at + 4 + size
        if name in (b"dataWindow", b"displayWindow") and kind == b"box2i":
            x0, y0, x1, y1 = struct.unpack("<iiii", value)
            sides.append((x1 - x0 + 1, y1 - y0 + 1))
            windows.append(value)
        if name == b"channels" and kind == b"chlist":
            names = _channel_names(value)
    if not sides:
        raise ValueError("has an EXR header without a size")
    if names:
        colour_channels(names)
    for width, height in sides:
        if min(width, height) < 1:
            raise ValueError(f"is {width}×{height} texels")
    width, height = (max(side) for side in zip(*sides, strict=True))
    return Header("exr", width, height, max(1, len(names)), 2, cropped=len(set(windows)) > 1)


def _channel_names(value: bytes) -> list[str]:
    names, at = list[str](), 0
    while at < len(value) and value[at]:
        name, at = _zero_ended(value, at)
        names.append(name.decode("ascii", "replace"))
        at += 16
        if len(names) > MOST_CHANNELS:
            raise ChannelsError(f"has more than {MOST_CHANNELS} channels")
    return names


def _zero_ended(head: bytes, at: int) -> tuple[bytes, int]:
    end = head.find(b"\0", at, at + 256)
    if end < 0:
        raise ValueError("has a broken EXR header")
    return head[at:end], end + 1


_READERS = {"png": _png, "jpeg": _jpeg, "exr": _exr, "hdr": _hdr, "bmp": _bmp, "tga": _tga}
