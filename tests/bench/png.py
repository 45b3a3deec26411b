"""A PNG writer of a few lines, for programs that should import nothing else."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path
from typing import Any


def write_png(path: Path, pixels: Any) -> None:
    """Write a (height, width, 3) uint8 array, top row first."""
    height, width, _ = pixels.shape
    rows = b"".join(b"\0" + pixels[y].tobytes() for y in range(height))
    with open(path, "wb") as file:
        file.write(b"\x89PNG\r\n\x1a\n")
        for kind, data in (
            (b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)),
            (b"IDAT", zlib.compress(rows, 4)),
            (b"IEND", b""),
        ):
            file.write(struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data)))
