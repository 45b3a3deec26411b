"""STL files: triangles without anything else, binary or as text.

The format has no unit and no axis up; most programs that write it mean millimetres and +Z. Positions are taken as they
are: place and scale the object in the scene file.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import numpy.typing as npt

from rendergraph.api import MeshData

Corners = npt.NDArray[np.float32]

_HEAD = 84  # 80 bytes of anything, and the number of triangles
_TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
_SOLID = re.compile(rb"\s*solid\b")
_NUMBERS = re.compile(rb"\bvertex\s+(\S+)\s+(\S+)\s+(\S+)")


def read_stl(path: Path) -> MeshData:
    """The triangles of an STL file, flat: each has the normal that its corners' order gives.

    Raises:
        ValueError: the file is neither kind of STL, or is cut short.
    """
    data = path.read_bytes()
    # Binary files may begin with "solid" too, so their length is asked first.
    corners = _binary(data) if _is_binary(data) else _text(data)
    return MeshData(corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3), name=path.stem)


def _count(data: bytes) -> int:
    return int.from_bytes(data[80:_HEAD], "little")


def _is_binary(data: bytes) -> bool:
    if len(data) >= _HEAD and len(data) == _HEAD + _TRIANGLE.itemsize * _count(data):
        return True
    return not _SOLID.match(data)


def _binary(data: bytes) -> Corners:
    if len(data) < _HEAD:
        raise ValueError(f"it has {len(data)} bytes, and a binary STL at least {_HEAD}")
    wanted = _HEAD + _TRIANGLE.itemsize * _count(data)
    if len(data) < wanted:
        raise ValueError(f"it is cut short: {_count(data)} triangles take {wanted} bytes, it has {len(data)}")
    return np.frombuffer(data, _TRIANGLE, _count(data), _HEAD)["corners"]


def _text(data: bytes) -> Corners:
    if not data.rstrip().endswith(b"endsolid") and b"endsolid" not in data:
        raise ValueError("it is cut short: there is no 'endsolid'")
    numbers = [tuple(map(float, found)) for found in _NUMBERS.findall(data)]
    if len(numbers) % 3 or len(numbers) != 3 * data.count(b"endfacet"):
        raise ValueError(f"it has {len(numbers)} corners in {data.count(b'endfacet')} facets, not three in each")
    return np.array(numbers, np.float32).reshape(-1, 3, 3)
