"""Primitives of a glTF file as meshes: every one checked, used by a node or not."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from msgspec.structs import replace
from rendergraph.pipelines.formats.gltf.buffers import Buffers
from rendergraph.pipelines.formats.gltf.schema import Accessor, Primitive

from rendergraph.errors import InputError
from rendergraph.projection import unit
from rendergraph.scene.geometry import Indices, fan_triangles, filled_normals, flat, strip_triangles
from rendergraph.scene.model import FARTHEST, Floats, Mesh
from rendergraph.scene.reading import Reading, UniqueNames
from rendergraph.scene.rig import Deform
from rendergraph.scene.triangles import extremes

_FLOAT = (5126,)
_SMALL = (5126, 5121, 5123)
_SIGNED = (5126, 5120, 5122)
_QUANTIZED = (5126, 5120, 5121, 5122, 5123)
_UNSIGNED = (5121, 5123, 5125)
_READ = ("POSITION", "NORMAL", "TANGENT", "TEXCOORD_0", "TEXCOORD_1", "COLOR_0")
_TYPES = {
    "POSITION": (("VEC3",), (_FLOAT, _QUANTIZED)),
    "NORMAL": (("VEC3",), (_FLOAT, _SIGNED)),
    "TANGENT": (("VEC4",), (_FLOAT, _SIGNED)),
    "TEXCOORD": (("VEC2",), (_SMALL, _QUANTIZED)),
    "COLOR": (("VEC3", "VEC4"), (_SMALL, _SMALL)),
    "JOINTS": (("VEC4",), ((5121, 5123), (5121, 5123))),
    "WEIGHTS": (("VEC4",), (_SMALL, _SMALL)),
}
"""Element types of attributes, and their component types, without and with KHR_mesh_quantization."""
_TARGETS = {"POSITION": "positions", "NORMAL": "normals", "TANGENT": "tangents"}
_MODES = ("points", "lines", "line loops", "line strips", "triangles", "triangle strips", "triangle fans")


class Primitives:
    """Builds a `Mesh` of each primitive; equal ones (same accessors, same mode) are one mesh."""

    def __init__(self, buffers: Buffers, reading: Reading, quantized: bool) -> None:
        self._buffers, self._reading, self._quantized = buffers, reading, quantized
        self._names = UniqueNames()
        self._mesh_of: dict[tuple[object, ...], int | None] = {}
        self._bytes = 0
        self.meshes: list[Mesh] = []
        self.places: list[str] = []

    def mesh(self, primitive: Primitive, name: str, where: str) -> int | None:
        """Return the index of the primitive's mesh in `meshes`; None for points, lines and without positions."""
        accessors = tuple(tuple(sorted(part.items())) for part in (primitive.attributes, *primitive.targets))
        key = (accessors, primitive.indices, primitive.mode)
        if key not in self._mesh_of:
            mesh = self._build(primitive, name, where)
            self._mesh_of[key] = None if mesh is None else len(self.meshes)
            if mesh is not None:
                self.meshes.append(mesh)
                self.places.append(where)
        return self._mesh_of[key]

    def _build(self, primitive: Primitive, name: str, where: str) -> Mesh | None:
        attributes, mode = primitive.attributes, primitive.mode
        accessors = {key: self._attribute(key, number, where) for key, number in attributes.items()}
        if len({accessor.count for accessor in accessors.values()}) > 1:
            raise self._error(f"{where}: its attributes have different counts")
        if "POSITION" not in accessors:
            self._reading.warn("RG333", "no-position", f"{where}: primitives without POSITION are left out")
            return None
        count = accessors["POSITION"].count
        self._add_bytes(where, count * 96)
        corners = self._corners(where, primitive.indices, count)
        if mode < 4:
            text = f"{where}: {_MODES[mode]} are left out; only triangles are drawn"
            self._reading.warn("RG333", _MODES[mode], text)
            return None
        if mode == 4:
            if len(corners) % 3:
                raise self._error(f"{where}: {len(corners)} corners are not a multiple of 3")
            triangles = np.ascontiguousarray(corners.reshape(-1, 3))
        elif len(corners) < 3:
            raise self._error(f"{where}: {len(corners)} corners are fewer than a triangle has")
        else:
            triangles = strip_triangles(corners) if mode == 5 else fan_triangles(corners)
        if not len(triangles):
            self._reading.warn("RG332", "empty", f"{where}: a primitive without any triangle of area is left out")
            return None
        self._check_bounds(attributes["POSITION"])
        mesh = self._assemble(where, attributes, triangles, self._names.unique(name, "mesh"))
        deform = self._deform(where, primitive, mesh)
        if "NORMAL" in attributes:
            return mesh if deform is None else replace(mesh, deform=deform)
        # glTF: without normals the client computes flat ones and ignores tangents, those of targets as well.
        self._add_bytes(where, triangles.size * 64)
        made = flat(mesh)
        if deform is None:
            return made
        found, still = deform.at(triangles.reshape(-1)), made.normals
        bent = [flat(replace(mesh, positions=mesh.positions + d)).normals - still for d in deform.targets["positions"]]
        targets = {"positions": found.targets["positions"], **({"normals": np.stack(bent)} if bent else {})}
        rest = {"positions": made.positions, "normals": still}
        return replace(made, deform=replace(found, rest=rest, targets=targets))

    def _error(self, text: str) -> InputError:
        return self._reading.error("RG304", text)

    def _assemble(self, where: str, attributes: dict[str, int], triangles: Indices, name: str) -> Mesh:
        positions, normals, tangents, uv0, uv1, colors = (
            self._buffers.floats(attributes[key]) if key in attributes else None for key in _READ
        )
        assert positions is not None  # the caller has looked
        if np.abs(positions).max() > FARTHEST:
            raise self._reading.error("RG306", f"{where}: a vertex lies beyond {FARTHEST:g} m")
        if colors is not None:
            colors = self._clamped_colors(where, colors)
        if normals is None:
            return Mesh(name, positions, triangles, positions, None, uv0, uv1, colors)
        filled, missing = filled_normals(positions, triangles, normals.astype(np.float64))
        if missing:
            text = f"{where}: {missing} normals of length zero are computed from faces"
            self._reading.warn("RG332", "normals", text)
        if tangents is not None:
            hand = np.where(tangents[:, 3:] < 0, -1.0, 1.0)
            tangents = np.concatenate([unit(tangents[:, :3]), hand], axis=1).astype(np.float32)
        return Mesh(name, positions, triangles, filled, tangents, uv0, uv1, colors)

    def _deform(self, where: str, primitive: Primitive, mesh: Mesh) -> Deform | None:
        """How skins and morph targets move the mesh of a primitive."""
        attributes, count = primitive.attributes, len(mesh.positions)
        sets = [n for n in range(len(attributes)) if f"JOINTS_{n}" in attributes or f"WEIGHTS_{n}" in attributes]
        if not sets and not primitive.targets:
            return None
        self._add_bytes(where, count * (36 * len(primitive.targets) + 32 * len(sets)))
        joints, weights = [np.zeros((count, 0), np.int32)], [np.zeros((count, 0))]
        for number in sets:
            names = f"JOINTS_{number}", f"WEIGHTS_{number}"
            if missing := [name for name in names if name not in attributes]:
                raise self._error(f"{where} has no {missing[0]}, which belongs to its other joints and weights")
            joints.append(self._buffers.array(attributes[names[0]]).astype(np.int32))
            weights.append(self._buffers.floats(attributes[names[1]]).astype(np.float64))
        share, joint = np.concatenate(weights, axis=1), np.concatenate(joints, axis=1)
        total = share.sum(axis=1, keepdims=True)
        if sets and ((share < 0).any() or not total.all()):
            vertex = int(np.argmax((share < 0).any(axis=1) | (total[:, 0] == 0)))
            what = f"sum to {total[vertex, 0]:g}" if total[vertex, 0] <= 0 else "are partly negative"
            raise self._error(f"{where}.WEIGHTS_0: the weights of vertex {vertex} {what}")
        joint[share == 0] = 0
        rest = {name: stream for name in _TARGETS.values() if (stream := getattr(mesh, name)) is not None}
        return Deform(rest, self._targets(where, primitive, mesh), joint, (share / total).astype(np.float32))

    def _targets(self, where: str, primitive: Primitive, mesh: Mesh) -> dict[str, Floats]:
        """The displacements of the morph targets, float32 (t, n, 3) by stream."""
        shape = (len(primitive.targets), len(mesh.positions), 3)
        found: dict[str, Floats] = {"positions": np.zeros(shape, np.float32)}
        for number, target in enumerate(primitive.targets):
            for key, index in target.items():
                use, stream = f"{where}.targets[{number}].{key}", _TARGETS.get(key)
                accessor = self._buffers.accessor(index, use)
                if stream is None:
                    self._reading.warn("RG333", f"target {key}", f"{use}: morph targets of '{key}' are left out")
                    continue
                self._buffers.check_use(index, use, ("VEC3",), _TYPES[key][1][self._quantized])
                if accessor.count != shape[1]:
                    raise self._error(f"{use} has {accessor.count} values, but the primitive {shape[1]} vertices")
                values = self._buffers.floats(index)
                if np.abs(values).max() > FARTHEST:
                    raise self._reading.error("RG306", f"{use}: a vertex moves farther than {FARTHEST:g} m")
                if getattr(mesh, stream) is not None:
                    found.setdefault(stream, np.zeros(shape, np.float32))[number] = values
        return found

    def _attribute(self, key: str, number: int, where: str) -> Accessor:
        """The accessor of an attribute, whose type must be one of those that the attribute may have."""
        use, kind = f"{where}.{key}", key.partition("_")[0]
        if key not in _READ and kind not in ("", "JOINTS", "WEIGHTS"):
            self._reading.warn("RG333", f"attribute {key}", f"{where}: attribute '{key}' is left out")
        if kind not in _TYPES:
            return self._buffers.accessor(number, use)
        types, components = _TYPES[kind]
        normalized = kind not in ("POSITION", "JOINTS") and not (self._quantized and kind == "TEXCOORD")
        return self._buffers.check_use(number, use, types, components[self._quantized], normalized)

    def _corners(self, where: str, indices: int, count: int) -> Indices:
        if indices < 0:
            return np.arange(count, dtype=np.uint32)
        accessor = self._buffers.check_use(indices, f"{where}.indices", ("SCALAR",), _UNSIGNED)
        if accessor.normalized:
            raise self._error(f"{where}: 'indices' must not be normalized")
        self._add_bytes(where, accessor.count * 4)
        corners = self._buffers.array(indices).reshape(-1).astype(np.uint32)
        high = int(corners.max())
        if high >= count:
            raise self._reading.error("RG305", f"{where}: index {high} is out of range; there are {count} vertices")
        return corners

    def _check_bounds(self, number: int) -> None:
        accessor, positions = self._buffers.accessors[number], self._buffers.floats(number)
        if not accessor.min or not accessor.max or accessor.component_type != 5126:
            return
        slack = 1e-4 * max(1e-30, float(np.abs(positions).max()))
        least, most = np.array(accessor.min, np.float32) - slack, np.array(accessor.max, np.float32) + slack
        low, high = extremes(positions)
        if (low < least).any() or (high > most).any():
            text = f"accessors[{number}]: positions exceed 'min' or 'max'; the data is used"
            self._reading.warn("RG332", "bounds", text)

    def _clamped_colors(self, where: str, colors: Floats) -> Floats:
        if ((colors < 0) | (colors > 1)).any():
            self._reading.warn("RG332", "colors", f"{where}: vertex colours outside 0 to 1 are clamped")
        full: npt.NDArray[np.float32] = np.ones((len(colors), 4), np.float32)
        full[:, : colors.shape[1]] = np.clip(colors, 0, 1)
        return full

    def _add_bytes(self, where: str, size: int) -> None:
        """Count the memory of meshes, so that primitives that use the same bytes over and over end here."""
        self._bytes += size
        if self._bytes > 64 * self._buffers.total + self._reading.limits.memory_bytes:
            raise self._reading.over(f"{where}: meshes need {self._bytes:,} bytes", "memory_bytes")
        if size // 96 > self._reading.limits.vertices:
            raise self._reading.over(f"{where} has {size // 96:,} vertices", "vertices")
