"""Size and channels from an image file's first bytes, without decoding it.

Enough to refuse what is no image and what would balloon: PNG, JPEG, Radiance HDR and OpenEXR are looked into, other
formats that image libraries read are accepted by their first bytes or their extension.
"""

from __future__ import annotations

import re
import struct
from dataclasses import dataclass

HEAD_BYTES = 1 << 20
_MAGIC = {b"BM": "bmp", b"GIF8": "gif", b"II*\0": "tiff", b"MM\0*": "tiff", b"RIFF": "webp", b"DDS ": "dds"}
_BY_EXTENSION = {".tga", ".pnm", ".ppm", ".pgm", ".pfm", ".pic"}


class NoImageError(ValueError):
    """The bytes are those of something else."""


@dataclass(frozen=True)
class Header:
    """What the first bytes say; sizes are None where they do not."""

    format: str
    width: int | None = None
    height: int | None = None
    channels: int = 4
    channel_bytes: int = 1


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
    for magic, reader in ((b"\x89PNG", _png), (b"\xff\xd8", _jpeg), (b"#?", _hdr), (b"\x76\x2f\x31\x01", _exr)):
        if head.startswith(magic):
            try:
                return reader(head)
            except (struct.error, IndexError):
                raise ValueError("ends inside its header") from None
    for magic, name in _MAGIC.items():
        if head.startswith(magic):
            return Header(name)
    if suffix.lower() in _BY_EXTENSION:
        return Header(suffix.lower()[1:])
    raise NoImageError("is no image that can be read (PNG, JPEG, HDR, EXR)")


def _png(head: bytes) -> Header:
    if head[:8] != b"\x89PNG\r\n\x1a\n" or head[12:16] != b"IHDR":
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
    return Header("hdr", width, height, 3, 4)


def _exr(head: bytes) -> Header:
    (flags,) = struct.unpack("<I", head[4:8])
    if flags & 0xFF != 2:
        raise ValueError("has a broken EXR header")
    at, width, height, channels = 8, None, None, 0
    while at < len(head) and head[at]:
        name, at = _zero_ended(head, at)
        kind, at = _zero_ended(head, at)
        (size,) = struct.unpack("<I", head[at : at + 4])
        value, at = head[at + 4 : at + 4 + size], at + 4 + size
        if name == b"dataWindow" and kind == b"box2i" and width is None:
            x0, y0, x1, y1 = struct.unpack("<iiii", value)
            width, height = x1 - x0 + 1, y1 - y0 + 1
        if name == b"channels" and not channels:
            channels = value.count(b"\x01\0\0\0\x01\0\0\0")  # each full-resolution channel ends with its sampling
    if width is None or height is None:
        raise ValueError("has an EXR header without a size")
    return Header("exr", width, height, max(1, channels), 4)


def _zero_ended(head: bytes, at: int) -> tuple[bytes, int]:
    end = head.find(b"\0", at, at + 256)
    if end < 0:
        raise ValueError("has a broken EXR header")
    return head[at:end], end + 1
