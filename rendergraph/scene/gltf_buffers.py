"""Buffers, views and accessors of a glTF file as NumPy arrays, all of them checked whether used or not."""

from __future__ import annotations

import base64
import binascii
import struct
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import unquote, unquote_to_bytes

import numpy as np
import numpy.typing as npt

from rendergraph.document import shown
from rendergraph.scene.files import Reading
from rendergraph.scene.gltf_json import JsonObject

_COMPONENTS: dict[int, np.dtype[np.generic]] = {
    5120: np.dtype("<i1"),
    5121: np.dtype("<u1"),
    5122: np.dtype("<i2"),
    5123: np.dtype("<u2"),
    5125: np.dtype("<u4"),
    5126: np.dtype("<f4"),
}
_TYPES = {
    "SCALAR": (1, 1),
    "VEC2": (1, 2),
    "VEC3": (1, 3),
    "VEC4": (1, 4),
    "MAT2": (2, 2),
    "MAT3": (3, 3),
    "MAT4": (4, 4),
}
_UNSIGNED = (5121, 5123, 5125)


def split_glb(data: bytes, reading: Reading) -> tuple[bytes, bytes | None]:
    """The JSON and the binary chunk of a .glb.

    Raises:
        InputError: it is no GLB 2.0, or a length does not fit.
    """
    if len(data) < 12 or data[:4] != b"glTF":
        raise reading.error("RG303", "is no binary glTF (it does not start with 'glTF')")
    _, version, total = struct.unpack_from("<4sII", data)
    if version != 2:
        raise reading.error("RG303", f"is binary glTF version {version}; only version 2 is read")
    if total > len(data):
        raise reading.error("RG304", f"is truncated: its header says {total:,} bytes, the file has {len(data):,}")
    if total < len(data):
        reading.warn("RG332", "glb-end", f"{len(data) - total:,} bytes after the GLB's end are left out")
    text: bytes | None = None
    binary: bytes | None = None
    at, number = 12, 0
    while at < total:
        if at + 8 > total:
            raise reading.error("RG304", "is truncated inside a chunk's header")
        length, kind = struct.unpack_from("<II", data, at)
        if at + 8 + length > total:
            raise reading.error("RG304", f"is truncated: a chunk of {length:,} bytes passes the end")
        if number == 0 and kind != 0x4E4F534A:
            raise reading.error("RG304", "its first chunk is not JSON")
        if kind == 0x4E4F534A and number == 0:
            text = data[at + 8 : at + 8 + length]
        elif kind == 0x004E4942 and number == 1:
            binary = data[at + 8 : at + 8 + length]
        elif kind in (0x4E4F534A, 0x004E4942):
            raise reading.error("RG304", "has a JSON or BIN chunk in the wrong place")
        at += 8 + length
        number += 1
    if text is None:
        raise reading.error("RG304", "is truncated: it has no JSON chunk")
    return text, binary


def uri_bytes(uri: str, part: JsonObject, reading: Reading, what: str) -> bytes | Path:
    """The bytes of a data URI, or the path of a file inside the roots."""
    if uri[:5].lower() == "data:":
        head, comma, body = uri.partition(",")
        if not comma:
            raise part.wrong(f"{what} has a data URI without a comma")
        if not head.lower().endswith(";base64"):
            return unquote_to_bytes(body)
        try:
            return base64.b64decode(body, validate=True)
        except (binascii.Error, ValueError):
            raise part.wrong(f"{what} has a data URI with broken base64") from None
    return reading.beside(unquote(uri))


@dataclass(frozen=True)
class View:
    """A checked buffer view."""

    buffer: int
    offset: int
    length: int
    stride: int


@dataclass(frozen=True)
class Accessor:
    """A checked accessor's description."""

    part: JsonObject
    view: View | None
    offset: int
    component: int
    type: str
    count: int
    normalized: bool
    sparse: tuple[npt.NDArray[np.int64], npt.NDArray[np.generic]] | None

    @property
    def width(self) -> int:
        """Components of one element."""
        columns, rows = _TYPES[self.type]
        return columns * rows

    @property
    def bytes(self) -> int:
        """Bytes of one element; columns of matrices start at multiples of four."""
        return _element_bytes(self.type, self.component)

    def need(
        self, part: JsonObject, use: str, types: Sequence[str], components: Sequence[int], normalized: bool = False
    ) -> None:
        """Check that the accessor has the type a use asks for.

        Raises:
            InputError: it has another.
        """
        if self.type not in types or self.component not in components:
            raise part.wrong(
                f"{use} takes {' or '.join(types)} of component type {' or '.join(map(str, components))}, "
                f"but {self.part.path} is {self.type} of {self.component}"
            )
        if normalized and self.component != 5126 and not self.normalized:
            raise part.wrong(f"{use} takes whole numbers only normalized, but {self.part.path} is not")


def _element_bytes(kind: str, component: int) -> int:
    columns, rows = _TYPES[kind]
    column = rows * _COMPONENTS[component].itemsize
    return columns * (column if columns == 1 else -(-column // 4) * 4)


class Buffers:
    """All accessors of a file, decoded on demand and kept."""

    def __init__(self, top: JsonObject, binary: bytes | None, reading: Reading) -> None:
        self._reading = reading
        self.buffers = [self._buffer(part, index, binary) for index, part in enumerate(top.parts("buffers"))]
        self.total = sum(len(buffer) for buffer in self.buffers)
        self.views = [self._view(part) for part in top.parts("bufferViews")]
        self._declared = self._copied = 0
        self._unbacked = 0
        self.accessors = [self._accessor(part) for part in top.parts("accessors")]
        self._arrays: dict[int, npt.NDArray[np.generic]] = {}
        for index, accessor in enumerate(self.accessors):
            if accessor.component == 5126 and not np.isfinite(self.array(index)).all():
                raise reading.error("RG306", f"{accessor.part.path} holds NaN or infinity")

    def array(self, index: int) -> npt.NDArray[np.generic]:
        """An accessor as (count, width) in its own component type."""
        if index not in self._arrays:
            self._arrays[index] = self._decode(self.accessors[index])
        return self._arrays[index]

    def floats(self, index: int) -> npt.NDArray[np.float32]:
        """An accessor as float32 (count, width); normalised whole numbers become -1…1 or 0…1."""
        accessor, raw = self.accessors[index], self.array(index)
        if accessor.component == 5126:
            return np.ascontiguousarray(raw, np.float32)
        values = raw.astype(np.float32)
        if accessor.normalized:
            values /= np.iinfo(raw.dtype).max  # type: ignore[type-var]  # every other component type is an integer
            np.maximum(values, -1.0, out=values)
        return values

    def view_bytes(self, index: int) -> bytes:
        """The bytes of a view.

        Raises:
            InputError: the views asked for overlap so much that copies would balloon.
        """
        view = self.views[index]
        self._copied += view.length
        if self._copied > 4 * self.total + (64 << 20):
            raise self._reading.over(f"images inside the file take {self._copied:,} bytes", "memory_bytes")
        return bytes(self.buffers[view.buffer][view.offset : view.offset + view.length])

    def _buffer(self, part: JsonObject, index: int, binary: bytes | None) -> memoryview:
        length = part.integer("byteLength", low=1)
        if not part.has("uri"):
            if index or binary is None:
                raise part.wrong("has no 'uri', and there is no binary chunk for it")
            data: bytes = binary
        else:
            found = uri_bytes(part.text("uri"), part, self._reading, "buffer")
            data = self._reading.read(found, "buffer") if isinstance(found, Path) else found
        if len(data) < length:
            raise part.wrong(f"is truncated: 'byteLength' is {length:,}, but there are {len(data):,} bytes")
        return memoryview(data)[:length]

    def _view(self, part: JsonObject) -> View:
        buffer = part.index("buffer", len(self.buffers), "buffers")
        if buffer is None:
            raise part.wrong("'buffer' is missing")
        offset, length = part.integer("byteOffset", 0), part.integer("byteLength", low=1)
        if offset + length > len(self.buffers[buffer]):
            raise part.wrong(f"ends at byte {offset + length:,}, but its buffer has {len(self.buffers[buffer]):,}")
        stride = part.integer("byteStride", 4, 4, 252) if part.has("byteStride") else 0
        if stride % 4:
            raise part.wrong(f"'byteStride' is {stride}, not a multiple of 4")
        return View(buffer, offset, length, stride)

    def _accessor(self, part: JsonObject) -> Accessor:
        component = part.integer("componentType")
        kind = part.text("type")
        if component not in _COMPONENTS:
            raise part.wrong(f"'componentType' {component} is none of {', '.join(map(str, _COMPONENTS))}")
        if kind not in _TYPES:
            raise part.wrong(f"'type' '{shown(kind)}' is none of {', '.join(_TYPES)}")
        count, offset = part.integer("count", low=1), part.integer("byteOffset", 0)
        number = part.index("bufferView", len(self.views), "buffer views")
        view = None if number is None else self.views[number]
        normalized = part.flag("normalized")
        if normalized and component in (5125, 5126):
            raise part.wrong("'normalized' is for 8- and 16-bit components only")
        self._fits(part, view, offset, component, kind, count)
        if view is None:
            self._unbacked += count * _element_bytes(kind, component)
            if self._unbacked > self._reading.limits.memory_bytes:
                raise self._reading.over(f"accessors without a view declare {self._unbacked:,} bytes", "memory_bytes")
        columns, rows = _TYPES[kind]
        for bound in ("min", "max"):
            if part.has(bound):
                part.numbers(bound, columns * rows)
        sparse = part.part("sparse")
        table = None if sparse is None else self._sparse(sparse, count, component, kind)
        return Accessor(part, view, offset, component, kind, count, normalized, table)

    def _fits(self, part: JsonObject, view: View | None, offset: int, component: int, kind: str, count: int) -> None:
        """Check that `count` elements at `offset` lie inside a view and are aligned."""
        size, item = _element_bytes(kind, component), _COMPONENTS[component].itemsize
        if view is None:
            if offset:
                raise part.wrong("has a 'byteOffset' without a 'bufferView'")
            return
        stride = view.stride or size
        if stride < size:
            raise part.wrong(f"elements of {size} bytes do not fit their view's stride of {stride}")
        if offset % item or view.offset % item or stride % item:
            raise part.wrong(f"is not aligned to its components of {item} bytes")
        end = offset + stride * (count - 1) + size
        if end > view.length:
            raise part.wrong(f"needs {end:,} bytes of its buffer view, which has {view.length:,}")
        # Accessors may share bytes, yet a small file whose accessors all say the whole buffer would cost without end.
        self._declared += count * size
        if self._declared > 16 * self.total + (64 << 20):
            raise part.wrong(f"accessors overlap: together they read {self._declared:,} of {self.total:,} bytes")

    def _sparse(
        self, part: JsonObject, count: int, component: int, kind: str
    ) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.generic]]:
        number = part.integer("count", low=1, high=count)
        where, what = part.part("indices"), part.part("values")
        if where is None or what is None:
            raise part.wrong("needs 'indices' and 'values'")
        index_type = where.integer("componentType")
        if index_type not in _UNSIGNED:
            raise where.wrong(f"'componentType' {index_type} is none of {', '.join(map(str, _UNSIGNED))}")
        places = self._run(where, index_type, "SCALAR", number).reshape(-1).astype(np.int64)
        if places.size and (int(places.max()) >= count or (np.diff(places) <= 0).any()):
            raise where.wrong(f"indices must rise and stay below {count}")
        return places, self._run(what, component, kind, number)

    def _run(self, part: JsonObject, component: int, kind: str, count: int) -> npt.NDArray[np.generic]:
        number = part.index("bufferView", len(self.views), "buffer views")
        if number is None:
            raise part.wrong("'bufferView' is missing")
        view, offset = self.views[number], part.integer("byteOffset", 0)
        self._fits(part, view, offset, component, kind, count)
        return self._elements(view, offset, component, kind, count)

    def _elements(self, view: View, offset: int, component: int, kind: str, count: int) -> npt.NDArray[np.generic]:
        dtype, size = _COMPONENTS[component], _element_bytes(kind, component)
        columns, rows = _TYPES[kind]
        shape, column = (count, columns, rows), size // columns
        strides = (view.stride or size, column, dtype.itemsize)
        array: npt.NDArray[np.generic] = np.ndarray(
            shape, dtype, self.buffers[view.buffer], view.offset + offset, strides
        )
        return array.reshape(count, columns * rows)

    def _decode(self, accessor: Accessor) -> npt.NDArray[np.generic]:
        if accessor.view is None:
            array: npt.NDArray[np.generic] = np.zeros((accessor.count, accessor.width), _COMPONENTS[accessor.component])
        else:
            array = self._elements(accessor.view, accessor.offset, accessor.component, accessor.type, accessor.count)
        if accessor.sparse is not None:
            array = array.copy()
            array[accessor.sparse[0]] = accessor.sparse[1]
        return array
