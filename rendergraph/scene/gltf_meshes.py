"""Primitives of a glTF file as meshes: every one checked, used by a node or not."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from rendergraph.projection import unit
from rendergraph.scene.files import Reading, UniqueNames
from rendergraph.scene.geometry import Indices, fan_triangles, filled_normals, flat, strip_triangles
from rendergraph.scene.gltf_buffers import Accessor, Buffers
from rendergraph.scene.gltf_json import JsonObject
from rendergraph.scene.model import FARTHEST, Floats, Mesh, extremes

_FLOAT = (5126,)
_SMALL = (5126, 5121, 5123)
_QUANTIZED = (5126, 5120, 5121, 5122, 5123)
_UNSIGNED = (5121, 5123, 5125)
_KNOWN = ("POSITION", "NORMAL", "TANGENT", "TEXCOORD_0", "TEXCOORD_1", "COLOR_0")
_MODES = ("points", "lines", "line loops", "line strips", "triangles", "triangle strips", "triangle fans")


class Primitives:
    """Makes a `Mesh` of each primitive; equal ones (same accessors, same mode) are one mesh."""

    def __init__(self, buffers: Buffers, reading: Reading, quantized: bool) -> None:
        self._buffers, self._reading, self._quantized = buffers, reading, quantized
        self._names = UniqueNames()
        self._made: dict[tuple[object, ...], int | None] = {}
        self._bytes = 0
        self.meshes: list[Mesh] = []

    def mesh(self, part: JsonObject, name: str) -> int | None:
        """Index of the primitive's mesh in `meshes`; None where it is left out (points, lines, no positions)."""
        attributes = part.part("attributes")
        if attributes is None:
            raise part.wrong("'attributes' is missing")
        numbers = {key: attributes.index(key, len(self._buffers.accessors), "accessors") for key in attributes.value}
        indices = part.index("indices", len(self._buffers.accessors), "accessors")
        mode = part.integer("mode", 4, 0, 6)
        key = (tuple(sorted(numbers.items())), indices, mode)
        if key not in self._made:
            mesh = self._make(part, {k: v for k, v in numbers.items() if v is not None}, indices, mode, name)
            self._made[key] = None if mesh is None else len(self.meshes)
            if mesh is not None:
                self.meshes.append(mesh)
        return self._made[key]

    def _make(
        self, part: JsonObject, numbers: dict[str, int], indices: int | None, mode: int, name: str
    ) -> Mesh | None:
        accessors = {key: self._buffers.accessors[number] for key, number in numbers.items()}
        for key, accessor in accessors.items():
            self._check(part, key, accessor)
        if len({accessor.count for accessor in accessors.values()}) > 1:
            raise part.wrong("its attributes have different counts")
        if "POSITION" not in accessors:
            self._reading.warn("RG333", "no-position", f"{part.path}: primitives without POSITION are left out")
            return None
        count = accessors["POSITION"].count
        self._grow(part, count * 96)
        corners = self._corners(part, indices, count)
        if mode < 4:
            self._reading.warn(
                "RG333", _MODES[mode], f"{part.path}: {_MODES[mode]} are left out; only triangles are drawn"
            )
            return None
        if mode == 4:
            if len(corners) % 3:
                raise part.wrong(f"{len(corners)} corners are no whole number of triangles")
            triangles = np.ascontiguousarray(corners.reshape(-1, 3))
        elif len(corners) < 3:
            raise part.wrong(f"{len(corners)} corners make no triangle")
        else:
            triangles = strip_triangles(corners) if mode == 5 else fan_triangles(corners)
        if not len(triangles):
            self._reading.warn("RG332", "empty", f"{part.path}: a primitive without any triangle of area is left out")
            return None
        self._sane_bounds(accessors["POSITION"], self._buffers.floats(numbers["POSITION"]))
        return self._assemble(part, numbers, triangles, self._names.unique(name, "mesh"))

    def _assemble(self, part: JsonObject, numbers: dict[str, int], triangles: Indices, name: str) -> Mesh:
        def values(key: str) -> Floats | None:
            return self._buffers.floats(numbers[key]) if key in numbers else None

        positions = self._buffers.floats(numbers["POSITION"])
        if np.abs(positions).max() > FARTHEST:
            raise self._reading.error("RG306", f"{part.path}: a vertex lies beyond {FARTHEST:g} m")
        normals, tangents = values("NORMAL"), values("TANGENT")
        uv0, uv1, colors = values("TEXCOORD_0"), values("TEXCOORD_1"), self._colors(part, values("COLOR_0"))
        if normals is None:  # glTF: without normals the client computes flat ones and ignores tangents
            self._grow(part, triangles.size * 64)
            return flat(Mesh(name, positions, triangles, positions, None, uv0, uv1, colors))
        fixed, missing = filled_normals(positions, triangles, normals.astype(np.float64))
        if missing:
            self._reading.warn(
                "RG332", "normals", f"{part.path}: {missing} normals of length zero are computed from faces"
            )
        if tangents is not None:
            hand = np.where(tangents[:, 3:] < 0, -1.0, 1.0)
            tangents = np.concatenate([unit(tangents[:, :3]), hand], axis=1).astype(np.float32)
        return Mesh(name, positions, triangles, fixed, tangents, uv0, uv1, colors)

    def _check(self, part: JsonObject, key: str, accessor: Accessor) -> None:
        quantized = self._quantized
        if key == "POSITION":
            accessor.need(part, key, ("VEC3",), _QUANTIZED if quantized else _FLOAT)
        elif key == "NORMAL":
            accessor.need(part, key, ("VEC3",), (5126, 5120, 5122) if quantized else _FLOAT, normalized=True)
        elif key == "TANGENT":
            accessor.need(part, key, ("VEC4",), (5126, 5120, 5122) if quantized else _FLOAT, normalized=True)
        elif key.startswith("TEXCOORD_"):
            accessor.need(part, key, ("VEC2",), _QUANTIZED if quantized else _SMALL, normalized=not quantized)
        elif key.startswith("COLOR_"):
            accessor.need(part, key, ("VEC3", "VEC4"), _SMALL, normalized=True)
        if key not in _KNOWN and not key.startswith(("_", "JOINTS_", "WEIGHTS_")):
            self._reading.warn("RG333", f"attribute {key}", f"{part.path}: attribute '{key}' is left out")

    def _corners(self, part: JsonObject, indices: int | None, count: int) -> Indices:
        if indices is None:
            return np.arange(count, dtype=np.uint32)
        accessor = self._buffers.accessors[indices]
        accessor.need(part, "indices", ("SCALAR",), _UNSIGNED)
        if accessor.normalized:
            raise part.wrong("'indices' must not be normalized")
        self._grow(part, accessor.count * 4)
        corners = self._buffers.array(indices).reshape(-1).astype(np.uint32)
        high = int(corners.max())
        if high >= count:
            raise self._reading.error("RG305", f"{part.path}: index {high} is out of range; there are {count} vertices")
        return corners

    def _sane_bounds(self, accessor: Accessor, positions: Floats) -> None:
        if not (accessor.part.has("min") and accessor.part.has("max")) or accessor.component != 5126:
            return
        low = np.array(accessor.part.numbers("min", 3), np.float32)
        high = np.array(accessor.part.numbers("max", 3), np.float32)
        slack = 1e-4 * max(1e-30, float(np.abs(positions).max()))
        least, most = extremes(positions)
        if (least < low - slack).any() or (most > high + slack).any():
            self._reading.warn(
                "RG332", "bounds", f"{accessor.part.path}: positions pass 'min' or 'max'; the data is used"
            )

    def _colors(self, part: JsonObject, colors: Floats | None) -> Floats | None:
        if colors is None:
            return None
        if ((colors < 0) | (colors > 1)).any():
            self._reading.warn("RG332", "colors", f"{part.path}: vertex colours outside 0 to 1 are clamped")
        full: npt.NDArray[np.float32] = np.ones((len(colors), 4), np.float32)
        full[:, : colors.shape[1]] = np.clip(colors, 0, 1)
        return full

    def _grow(self, part: JsonObject, size: int) -> None:
        """Count what meshes need; primitives that say the same bytes over and over end here."""
        self._bytes += size
        if self._bytes > 64 * self._buffers.total + self._reading.limits.memory_bytes:
            raise self._reading.over(f"{part.path}: meshes need {self._bytes:,} bytes", "memory_bytes")
        if size // 96 > self._reading.limits.vertices:
            raise self._reading.over(f"{part.path} has {size // 96:,} vertices", "vertices")
