"""Buffers, views and accessors of a glTF file as NumPy arrays, all of them checked whether used or not."""

from __future__ import annotations

import base64
import binascii
import struct
from collections.abc import Sequence
from pathlib import Path
from urllib.parse import unquote, unquote_to_bytes

import numpy as np
import numpy.typing as npt
from rendergraph.pipelines.formats.gltf.schema import Accessor, Buffer, BufferView, Gltf, Sparse, check_index

from rendergraph.errors import InputError
from rendergraph.scene.reading import Reading

_COMPONENTS: dict[int, np.dtype[np.generic]] = {
    5120: np.dtype("<i1"),
    5121: np.dtype("<u1"),
    5122: np.dtype("<i2"),
    5123: np.dtype("<u2"),
    5125: np.dtype("<u4"),
    5126: np.dtype("<f4"),
}
_SHAPES = {
    "SCALAR": (1, 1),
    "VEC2": (1, 2),
    "VEC3": (1, 3),
    "VEC4": (1, 4),
    "MAT2": (2, 2),
    "MAT3": (3, 3),
    "MAT4": (4, 4),
}
"""Columns and rows of an element."""
_JSON, _BIN = 0x4E4F534A, 0x004E4942


def split_glb(data: bytes, reading: Reading) -> tuple[bytes, bytes | None]:
    """Return the JSON and the binary chunk of a .glb file."""
    if len(data) < 12 or data[:4] != b"glTF":
        raise reading.error("RG303", "is not a binary glTF (it does not start with 'glTF')")
    _, version, total = struct.unpack_from("<4sII", data)
    if version != 2:
        raise reading.error("RG303", f"is binary glTF version {version}; only version 2 is read")
    if total > len(data):
        raise reading.error("RG304", f"is truncated: its header specifies {total:,} bytes, the file has {len(data):,}")
    if total < len(data):
        reading.warn("RG332", "glb-end", f"{len(data) - total:,} bytes after the GLB's end are left out")
    chunks: list[bytes | None] = [None, None]
    at, number = 12, 0
    while at < total:
        if at + 8 > total:
            raise reading.error("RG304", "is truncated inside a chunk's header")
        length, kind = struct.unpack_from("<II", data, at)
        if at + 8 + length > total:
            raise reading.error("RG304", f"is truncated: a chunk of {length:,} bytes extends beyond the end")
        if kind in (_JSON, _BIN) or number == 0:
            if (kind, number) not in ((_JSON, 0), (_BIN, 1)):
                raise reading.error("RG304", "does not have its JSON chunk first and its BIN chunk second")
            chunks[number] = data[at + 8 : at + 8 + length]
        at += 8 + length
        number += 1
    if chunks[0] is None:
        raise reading.error("RG304", "is truncated: it has no JSON chunk")
    return chunks[0], chunks[1]


def uri_bytes(uri: str, where: str, reading: Reading) -> bytes | Path:
    """Return the bytes of a data URI, or the path of a file inside the roots."""
    if uri[:5].lower() != "data:":
        return reading.resolve(unquote(uri))
    head, comma, body = uri.partition(",")
    if not comma:
        raise reading.error("RG304", f"{where} has a data URI without a comma")
    if not head.lower().endswith(";base64"):
        return unquote_to_bytes(body)
    try:
        return base64.b64decode(body, validate=True)
    except (binascii.Error, ValueError):
        raise reading.error("RG304", f"{where} has a data URI with broken base64") from None


def _element_bytes(kind: str, component: int) -> int:
    """Bytes of an element; columns of matrices start at multiples of four."""
    columns, rows = _SHAPES[kind]
    column = rows * _COMPONENTS[component].itemsize
    return columns * (column if columns == 1 else -(-column // 4) * 4)


class Buffers:
    """All accessors of a file, decoded on demand and cached."""

    def __init__(self, gltf: Gltf, binary: bytes | None, reading: Reading) -> None:
        self._reading = reading
        self.accessors, self._views = gltf.accessors, gltf.buffer_views
        self._buffers = [self._buffer(buffer, index, binary) for index, buffer in enumerate(gltf.buffers)]
        self.total = sum(map(len, self._buffers))
        for number, view in enumerate(self._views):
            self._check_view(view, f"bufferViews[{number}]")
        self._declared = self._copied = self._unbacked = 0
        self._sparse: dict[int, tuple[npt.NDArray[np.int64], npt.NDArray[np.generic]]] = {}
        for number, accessor in enumerate(self.accessors):
            self._check_accessor(accessor, number)
        self._arrays: dict[int, npt.NDArray[np.generic]] = {}
        for number, accessor in enumerate(self.accessors):
            if accessor.component_type == 5126 and not np.isfinite(self.array(number)).all():
                raise reading.error("RG306", f"accessors[{number}] contains NaN or infinity")

    def array(self, index: int) -> npt.NDArray[np.generic]:
        """Return an accessor as (count, width) in its own component type."""
        if index not in self._arrays:
            self._arrays[index] = self._decode(index)
        return self._arrays[index]

    def floats(self, index: int) -> npt.NDArray[np.float32]:
        """Return an accessor as float32 (count, width); normalised whole numbers become -1…1 or 0…1."""
        accessor, raw = self.accessors[index], self.array(index)
        if accessor.component_type == 5126:
            return np.ascontiguousarray(raw, np.float32)
        values = raw.astype(np.float32)
        if accessor.normalized:
            values /= np.iinfo(raw.dtype).max  # type: ignore[type-var]  # every other component type is an integer
            np.maximum(values, -1.0, out=values)
        return values

    def view_bytes(self, index: int, where: str) -> bytes:
        """Return the bytes of a view; views that overlap may not add up to much more than the file."""
        check_index(self._reading, index, self._views, f"{where}.bufferView", "buffer views")
        view = self._views[index]
        self._copied += view.byte_length
        if self._copied > 4 * self.total + (64 << 20):
            raise self._reading.over(f"images inside the file take {self._copied:,} bytes", "memory_bytes")
        return bytes(self._buffers[view.buffer][view.byte_offset : view.byte_offset + view.byte_length])

    def accessor(self, index: int, use: str) -> Accessor:
        """Return the accessor for a use, which is its place and key."""
        check_index(self._reading, index, self.accessors, use, "accessors")
        return self.accessors[index]

    def check_use(
        self, index: int, use: str, types: Sequence[str], components: Sequence[int], normalized: bool = False
    ) -> Accessor:
        """Return an accessor that has the type its use needs."""
        accessor, name = self.accessor(index, use), f"accessors[{index}]"
        if accessor.type not in types or accessor.component_type not in components:
            raise self._error(
                f"{use} must be {' or '.join(types)} of component type {' or '.join(map(str, components))}, "
                f"but {name} is {accessor.type} of {accessor.component_type}"
            )
        if normalized and accessor.component_type != 5126 and not accessor.normalized:
            raise self._error(f"{use} must be normalized if it has whole numbers, but {name} is not")
        return accessor

    def _error(self, text: str) -> InputError:
        return self._reading.error("RG304", text)

    def _buffer(self, buffer: Buffer, index: int, binary: bytes | None) -> memoryview:
        where, length = f"buffers[{index}]", buffer.byte_length
        if buffer.uri is not None:
            content = uri_bytes(buffer.uri, where, self._reading)
            data = self._reading.read(content, "buffer") if isinstance(content, Path) else content
        elif index or binary is None:
            raise self._error(f"{where} has no 'uri', and there is no binary chunk for it")
        else:
            data = binary
        if len(data) < length:
            raise self._error(f"{where} is truncated: 'byteLength' is {length:,}, but there are {len(data):,} bytes")
        return memoryview(data)[:length]

    def _check_view(self, view: BufferView, where: str) -> None:
        check_index(self._reading, view.buffer, self._buffers, f"{where}.buffer", "buffers")
        end, length = view.byte_offset + view.byte_length, len(self._buffers[view.buffer])
        if end > length:
            raise self._error(f"{where} ends at byte {end:,}, but its buffer has {length:,}")

    def _check_accessor(self, accessor: Accessor, number: int) -> None:
        where, component, kind = f"accessors[{number}]", accessor.component_type, accessor.type
        if accessor.normalized and component in (5125, 5126):
            raise self._error(f"{where}: 'normalized' is for 8- and 16-bit components only")
        self._check_fit(where, accessor.buffer_view, accessor.byte_offset, component, kind, accessor.count)
        if accessor.buffer_view < 0:
            self._unbacked += accessor.count * _element_bytes(kind, component)
            if self._unbacked > self._reading.limits.memory_bytes:
                raise self._reading.over(f"accessors without a view declare {self._unbacked:,} bytes", "memory_bytes")
        columns, rows = _SHAPES[kind]
        for bound, values in (("min", accessor.min), ("max", accessor.max)):
            if values and len(values) != columns * rows:
                raise self._error(f"{where}: '{bound}' must be {columns * rows} numbers")
        if accessor.sparse is not None:
            self._sparse[number] = self._sparse_values(accessor.sparse, f"{where}.sparse", accessor)

    def _check_fit(self, where: str, index: int, offset: int, component: int, kind: str, count: int) -> None:
        """Check that `count` elements at `offset` lie inside a view and are aligned."""
        check_index(self._reading, index, self._views, f"{where}.bufferView", "buffer views")
        size, item = _element_bytes(kind, component), _COMPONENTS[component].itemsize
        if index < 0:
            if offset:
                raise self._error(f"{where} has a 'byteOffset' without a 'bufferView'")
            return
        view = self._views[index]
        stride = view.byte_stride or size
        if stride < size:
            raise self._error(f"{where}: elements of {size} bytes do not fit their view's stride of {stride}")
        if offset % item or view.byte_offset % item or stride % item:
            raise self._error(f"{where} is not aligned to its components of {item} bytes")
        end = offset + stride * (count - 1) + size
        if end > view.byte_length:
            raise self._error(f"{where} needs {end:,} bytes of its buffer view, which has {view.byte_length:,}")
        # Accessors may share bytes, but a small file in which all of them use the whole buffer would cost without end.
        self._declared += count * size
        if self._declared > 16 * self.total + (64 << 20):
            raise self._error(f"accessors overlap: together they read {self._declared:,} of {self.total:,} bytes")

    def _sparse_values(
        self, sparse: Sparse, where: str, accessor: Accessor
    ) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.generic]]:
        if sparse.count > accessor.count:
            raise self._error(f"{where}: 'count' is {sparse.count}, more than the accessor's {accessor.count}")
        indices, values = sparse.indices, sparse.values
        rows = (indices.buffer_view, indices.byte_offset, indices.component_type, "SCALAR", sparse.count)
        replaced = (values.buffer_view, values.byte_offset, accessor.component_type, accessor.type, sparse.count)
        self._check_fit(f"{where}.indices", *rows)
        self._check_fit(f"{where}.values", *replaced)
        numbers = self._elements(*rows).reshape(-1).astype(np.int64)
        if int(numbers.max()) >= accessor.count or (np.diff(numbers) <= 0).any():
            raise self._error(f"{where}.indices must increase and be below {accessor.count}")
        return numbers, self._elements(*replaced)

    def _elements(self, index: int, offset: int, component: int, kind: str, count: int) -> npt.NDArray[np.generic]:
        view, dtype, size = self._views[index], _COMPONENTS[component], _element_bytes(kind, component)
        columns, rows = _SHAPES[kind]
        shape, strides = (count, columns, rows), (view.byte_stride or size, size // columns, dtype.itemsize)
        start = view.byte_offset + offset
        array: npt.NDArray[np.generic] = np.ndarray(shape, dtype, self._buffers[view.buffer], start, strides)
        return array.reshape(count, columns * rows)

    def _decode(self, index: int) -> npt.NDArray[np.generic]:
        accessor = self.accessors[index]
        view, component, kind, count = accessor.buffer_view, accessor.component_type, accessor.type, accessor.count
        if view < 0:
            columns, rows = _SHAPES[kind]
            array: npt.NDArray[np.generic] = np.zeros((count, columns * rows), _COMPONENTS[component])
        else:
            array = self._elements(view, accessor.byte_offset, component, kind, count)
        if index in self._sparse:
            array = array.copy()
            rows_, values = self._sparse[index]
            array[rows_] = values
        return array
