"""PNG files of 8 bits by the standard library, in half of OpenImageIO's time, and without the time to import it."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator, Mapping

import numpy as np
import numpy.typing as npt

_COLOR_TYPES = {1: 0, 3: 2, 4: 6}
"""Grey, RGB and RGBA by their number of channels (PNG specification, 11.2.1)."""
_LEFT = 1
"""The filter that leaves the difference to the pixel on the left; to choose one row by row costs more than it saves."""
_LEVEL = 4


def png(pixels: npt.NDArray[np.uint8], texts: Mapping[str, str]) -> Iterator[bytes]:
    """The parts of a PNG file in order.

    Args:
        pixels: (height, width, 1, 3 or 4 channels), top row first, sRGB-encoded; alpha is not multiplied in.
        texts: what else the file says, by keyword: 1 to 79 letters of ASCII.
    """
    height, width, count = pixels.shape
    yield b"\x89PNG\r\n\x1a\n"
    yield _chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, _COLOR_TYPES[count], 0, 0, 0))
    yield _chunk(b"sRGB", b"\0")
    for keyword, text in texts.items():
        yield _chunk(b"iTXt", keyword.encode("ascii") + b"\0\0\0\0\0" + text.encode())
    yield _chunk(b"IDAT", zlib.compress(_filtered(pixels.reshape(height, width * count), count).data, _LEVEL))
    yield _chunk(b"IEND", b"")


def _filtered(rows: npt.NDArray[np.uint8], count: int) -> npt.NDArray[np.uint8]:
    made = np.empty((rows.shape[0], rows.shape[1] + 1), np.uint8)
    made[:, 0] = _LEFT
    made[:, 1 : count + 1] = rows[:, :count]
    np.subtract(rows[:, count:], rows[:, :-count], out=made[:, count + 1 :])
    return made


def _chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(data, zlib.crc32(kind)))
